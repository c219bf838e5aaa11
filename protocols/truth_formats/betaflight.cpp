// The state that Betaflight's simulator target receives on UDP port 9003: `fdm_packet`, 18 little-endian doubles, 144
// bytes. Versions up to 4.4 do not have the last double, the pressure.
//
// | double  | field (src/platform/SIMULATOR/target/SITL/target.h)                        |
// |---------|----------------------------------------------------------------------------|
// | 0       | timestamp, s                                                               |
// | 1 - 3   | imu_angular_velocity_rpy, rad/s                                            |
// | 4 - 6   | imu_linear_acceleration_xyz, m/s^2: specific force, about -9.81 in z at rest |
// | 7 - 10  | imu_orientation_quat, w x y z                                              |
// | 11 - 13 | velocity_xyz, m/s                                                          |
// | 14 - 16 | position_xyz, m from the origin; USE_VIRTUAL_GPS: longitude, latitude, altitude |
// | 17      | pressure, Pa                                                               |
//
// The simulators (Gazebo's ArduPilotPlugin, khancyr/ardupilot_gazebo at a28cab4, and BetaFlightPlugin) fill in
// front-right-down body axes and north-east-down; the quaternion turns from the body to north-east-down. Betaflight
// itself negates gyro y and z, and every acceleration (sitl.c, updateState), to get its own axes. The feed of its
// tests (src/test/sitl/sitl_harness.py at 301d01a) has other signs, and a turned quaternion. With virtual GPS the
// velocity is east, north, up, and the place is on WGS 84 (target.h).
#include "protocols/quantities/packed_datagram.hpp"

namespace imud {
namespace {

constexpr std::string_view position_choices[] = {"ned", "geodetic"};
constexpr Setting settings[] = {
    text_setting(
        "position",
        "position_xyz and velocity_xyz: m north, east, down of an origin; or longitude, latitude, altitude, and "
        "m/s east, north, up, as with USE_VIRTUAL_GPS",
        "ned", position_choices),
};

constexpr std::string_view local_fields[] = {
    "time_s:f64",         "{p,q,r}_rad_per_s:f64",           "specific_force_{x,y,z}_m_per_s2:f64",
    "q_LB_{w,x,y,z}:f64", "v_{north,east,down}_m_per_s:f64", "{north,east,down}_m:f64",
    "pressure_pa:f64",
};
// The rate counts as relative to the Earth, because the Earth of these simulators does not turn.
constexpr std::string_view geodetic_fields[] = {
    "time_s:f64",
    "{p,q,r}_BE_rad_per_s:f64",
    "specific_force_{x,y,z}_m_per_s2:f64",
    "q_LB_{w,x,y,z}:f64",
    "v_{east,north,up}_m_per_s:f64",
    "{longitude,latitude}_deg:f64",
    "height_m:f64",
    "pressure_pa:f64",
};

PackedTruth make_truth(std::span<const std::string_view> fields) {
  return {PackedLayout(fields, boost::endian::order::little), {}};
}

class BetaflightTruthDecoder final : public PackedDatagramDecoder {
 public:
  explicit BetaflightTruthDecoder(std::span<const std::string_view> fields)
      : PackedDatagramDecoder(make_truth(fields)), without_pressure_(make_truth(fields.first(fields.size() - 1))) {}

  std::size_t describe(TruthResult result, std::span<char> room) const noexcept override {
    if (!is_older(datagram())) return PackedDatagramDecoder::describe(result, room);
    RemarkWriter out(room);
    without_pressure_.describe(out);
    return out.size();
  }

 private:
  bool is_older(std::span<const std::byte> record) const noexcept {
    return record.size() == without_pressure_.layout().size();
  }
  TruthResult decode(std::span<const std::byte> record, Truth& truth) noexcept override {
    return is_older(record) ? without_pressure_.convert(record, arrival(), truth)
                            : PackedDatagramDecoder::decode(record, truth);
  }

  PackedTruth without_pressure_;
};

}  // namespace

extern constexpr TruthFormat betaflight_truth_format = {
    .name = "betaflight",
    .summary = "the state that simulators send to Betaflight's SITL: 18 doubles, or 17 without the pressure",
    .document = "Betaflight at 301d01a (2026), SITL/target.h, fdm_packet",
    .settings = settings,
    .make = [](const Settings& chosen) -> std::unique_ptr<TruthDecoder> {
      using Fields = std::span<const std::string_view>;
      return std::make_unique<BetaflightTruthDecoder>(
          chosen.text("position") == position_choices[1] ? Fields(geodetic_fields) : Fields(local_fields));
    },
    .force_from = "imu_linear_acceleration_xyz, which is in every datagram",
};

}  // namespace imud
