// Truth as JSON objects (RFC 8259): a line of a stream, or a datagram, an object.
//
// The setting `columns` maps quantities to paths in the object, {time_s = "t", p_rad_per_s = "imu.gyro.0"}. Without
// it the names at the top level are quantities, and other names are not used. An object may have its quantities in
// any order; one that has none of them is a record without state. A number may be in quotes. A byte order mark
// (UTF-8) before an object is ignored.
#include "protocols/quantities/json_truth_decoder.hpp"

namespace imud {
namespace {

std::unique_ptr<TruthDecoder> make(const Settings& settings) {
  const TruthAssembly::Axes axes = TruthAssembly::axes(settings);
  TruthMap map = parse_truth_map(settings.list(map_setting.key));
  const QuantitySet required = quantities_of(map);
  const TruthFrame frame = map.empty() ? TruthFrame{} : assembly_of(map, axes).frame();  // throws if it lacks some
  return std::make_unique<JsonTruthDecoder>(std::move(map), required, axes, frame);
}

constexpr Setting settings[] = {map_setting, level_setting, body_setting, accumulated_dv_setting};

}  // namespace

extern constexpr TruthFormat json_truth_format = {
    .name = "json",
    .summary = "JSON objects, a line or a datagram each, with the names of quantities, or by a map",
    .document = "RFC 8259; protocols/quantities/truth_quantities.hpp",
    .delimits_itself = true,
    .settings = settings,
    .make = make,
    .force_from = "specific_force_x_m_per_s2 to _z_m_per_s2, or an acceleration",
    .maps_quantities = true,
    .derives = true,
};

}  // namespace imud
