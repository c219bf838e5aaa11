// The names of the numbers that frames carry.
#include <algorithm>

#include "core/numbers/nearest.hpp"
#include "protocols/frames/layout/frame_element.hpp"

namespace imud {
namespace {

constexpr std::string_view alive_counter = "alive_counter", frame_counter = "frame_counter";

struct StatusName {
  std::string_view name;
  std::uint32_t bits;
};
constexpr std::uint32_t axes = 7;
constexpr StatusName status_names[] = {
    {"gyro_saturated", axes* status::gyro_saturated_x},
    {"gyro_saturated_x", status::gyro_saturated_x},
    {"gyro_saturated_y", status::gyro_saturated_x << 1},
    {"gyro_saturated_z", status::gyro_saturated_x << 2},
    {"accelerometer_saturated", axes* status::accelerometer_saturated_x},
    {"accelerometer_saturated_x", status::accelerometer_saturated_x},
    {"accelerometer_saturated_y", status::accelerometer_saturated_x << 1},
    {"accelerometer_saturated_z", status::accelerometer_saturated_x << 2},
    {"truth_extrapolated", status::truth_extrapolated},
    {"truth_stale", status::truth_stale},
    {"not_valid", status::not_valid},
    {"at_rest", status::at_rest},
    {"self_test_failed", status::self_test_failed},
    {"starting", FrameSource::starting},
};

}  // namespace

std::optional<FrameSource> find_frame_source(std::string_view name) {
  FrameSource source;
  source.name = name.substr(name.starts_with('-'));
  if (name == alive_counter || name == frame_counter) {
    source.kind = name == alive_counter ? FrameSource::Kind::alive_counter : FrameSource::Kind::frame_counter;
    return source;
  }
  for (const StatusName& bit : status_names)
    if (bit.name == name) {
      source.kind = FrameSource::Kind::status;
      source.bits = bit.bits;
      return source;
    }
  const auto in = find_measured(name);
  if (!in) return std::nullopt;
  source.kind = FrameSource::Kind::quantity;
  source.in = *in;
  if (!in->quantity->units.empty())
    source.unit = name.substr(name.starts_with('-') + in->quantity->name.size() + 1);  // without its underscore
  return source;
}

std::string unknown_frame_source(std::string_view name) {
  std::vector<std::string> known = {std::string(alive_counter), std::string(frame_counter)};
  for (const StatusName& bit : status_names) known.emplace_back(bit.name);
  const std::string_view plain = name.substr(name.starts_with('-'));
  std::string fault = "there is no quantity \"" + std::string(plain) + "\"";
  const MeasuredQuantity* begun = nullptr;  // the quantity with which the name begins
  for (const MeasuredQuantity& quantity : measured_quantities()) {
    if (plain == quantity.name || plain.starts_with(std::string(quantity.name) + "_")) begun = &quantity;
    if (quantity.units.empty()) known.emplace_back(quantity.name);
    for (const KeyUnit& unit : quantity.units) known.push_back(std::string(quantity.name).append(unit.suffix));
  }
  if (begun != nullptr && !begun->units.empty()) {
    fault.append("; the units of ").append(begun->name).append(" are");
    for (const KeyUnit& unit : begun->units) fault.append(" ").append(unit.suffix);
    return fault;
  }
  const std::string meant = nearest(plain, known);
  if (!meant.empty()) return fault + "; did you mean \"" + meant + "\"?";
  return fault + "; a name is a quantity and its unit, such as rate_x_deg_per_s; protocols/README.md lists them";
}

}  // namespace imud
