// The requests of the host to the unit's own filter, by commands and by settings.
// Sources: mip_sdk e5a847d, commands_filter.h and commands_3dm.h; 3DM-GX5-45 Data Communications Protocol 8500-0064
// C, page 85 (initial heading), page 96 (sources of heading); of 0x41: KumarRobotics/imu_3dm_gx4 f8351ad, imu.cpp; of
// the models that estimate scale factors: MSCL bc6d5bf, MipNodeFeatures.cpp.
#include <cmath>

#include "core/sample.hpp"
#include "core/units.hpp"
#include "protocols/mip/mip.hpp"

namespace imud::mip {
namespace {

constexpr std::uint16_t of_receiver = aid::position | aid::velocity;

Vector3 row_of(const Kept& kept, std::size_t first) noexcept {
  const auto bytes = std::as_bytes(std::span(kept.bytes));
  return Reader(bytes.subspan(first, 12)).take_floats();
}

}  // namespace

// The offset, in gauss, is subtracted before the matrix is applied (the order is an assumption: the SDK says only
// that both are applied to the scaled vector).
NavigationAids Configuration::aids(const Model& model) const noexcept {
  NavigationAids aids;
  const auto withhold = [&aids](std::uint16_t which, bool is_withheld) {
    if (is_withheld) aids.withheld |= which;
  };
  const auto is_disabled = [&](unsigned source) {
    const Kept* const measurement = find_kept(model, filter_command, 0x50, source);
    return measurement != nullptr && measurement->bytes[2] == 0;
  };
  withhold(of_receiver, is_disabled(0));
  withhold(aid::antennas_heading, is_disabled(1));
  withhold(aid::pressure, is_disabled(2));
  withhold(aid::magnetic_heading, is_disabled(4));
  constexpr std::uint8_t external = 2;
  if (const Kept* const source = find_kept(model, filter_command, 0x15))
    withhold(of_receiver, source->bytes[0] == external);
  if (const Kept* const source = find_kept(model, filter_command, 0x18)) {
    constexpr unsigned with_magnetometer = 1U << 1 | 1U << 4 | 1U << 6 | 1U << 7;
    withhold(aid::magnetic_heading, source->bytes[0] > 7 || (with_magnetometer >> source->bytes[0] & 1U) == 0);
  }
  if (const Kept* const measurements = find_kept(model, filter_command, 0x41)) {
    withhold(aid::gravity, (measurements->bytes[1] & 1U) == 0);
    withhold(aid::magnetic_heading, (measurements->bytes[1] & 2U) == 0);
  }
  if (const Kept* const automatic = find_kept(model, filter_command, 0x19)) aids.waits = automatic->bytes[0] == 0;
  if (const Kept* const estimates = find_kept(model, filter_command, 0x14); model.is(gx5_45)) {
    aids.estimates_gyro_scale = (estimates->bytes[1] & 4U) != 0;
    aids.estimates_accelerometer_scale = (estimates->bytes[1] & 8U) != 0;
  }
  aids.field_bias = units::gauss * row_of(*find_kept(model, three_dm, 0x3A), 0);
  const Kept& matrix = *find_kept(model, three_dm, 0x3B);
  for (int row = 0; row < 3; ++row)
    aids.field_gain.row(row) = row_of(matrix, 12 * static_cast<std::size_t>(row)).transpose();
  return aids;
}

// The initial attitude, and the initial heading of a GX5, are of the sensor's axes, and are taken only while the
// filter initializes. A device of the 7 series takes a heading at any time, unless the magnetometer aids its filter;
// this is the heading of the vehicle's axes. Roll and pitch of an initial attitude are not used: they are known from
// gravity.
Memory::Code Memory::act_on_filter(std::uint8_t command, Data data, Fields& fields) noexcept {
  enum Command : std::uint8_t { reset = 0x01, initial_attitude = 0x02 };
  if (command == reset) {
    fields.reset_filter();
    return ok;
  }
  constexpr double largest = units::pi + 1e-6;  // a float's pi is more than pi
  Reader reader(data.last(sizeof(float)));
  const auto heading = double{reader.take<float>()};
  if (!(std::abs(heading) <= largest)) return bad_parameter;
  const bool is_settable = command != initial_attitude && model_.is(series_7);
  if (is_settable && (fields.requests().aids.withheld & aid::magnetic_heading) == 0) return ok;
  fields.requests().give(
      {.azimuth = heading,
       .ahead_P = is_settable ? Vector3(active_.q_PV * Vector3::UnitX()) : Vector3(Vector3::UnitX()),
       .only_in_alignment = !is_settable});
  return ok;
}

}  // namespace imud::mip
