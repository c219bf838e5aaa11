// The options of DroneCAN in imud's configuration, and the product as delivered.
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "protocols/dronecan/node.hpp"
#include "protocols/protocol.hpp"

namespace imud::dronecan {

// The messages with measurements, in ascending order of their identifiers.
struct Stream {
  const DataType* type;
  Key rate;
  std::size_t size;  // bytes of the payload
};
inline constexpr std::array<Stream, 7> streams = {{
    {&solution, solution_hz, sizeof(SolutionWire)},
    {&magnetic_field, magnetic_field_hz, sizeof(MagneticFieldWire)},
    {&raw_imu, raw_imu_hz, sizeof(RawImuWire)},
    {&static_pressure, static_pressure_hz, sizeof(StaticPressureWire)},
    {&static_temperature, static_temperature_hz, sizeof(StaticTemperatureWire)},
    {&gnss_auxiliary, gnss_auxiliary_hz, gnss_auxiliary_size},
    {&gnss_fix2, gnss_fix2_hz, gnss_fix2_size},
}};
inline constexpr unsigned status_priority = 24;  // of NodeStatus and Allocation

inline constexpr std::array<std::string_view, 2> time_bases = {"bus", "device"};
inline constexpr Setting declared_settings[] = {
    integer_setting("node_id", "node id; 0: allocated by another node", 42, 0, 125),
    text_setting("unique_id", "32 hexadecimal digits, different for each unit; empty: made from node_id", ""),
    text_setting("name", "name in GetNodeInfo: a-z 0-9 . - _", "org.imud.imu"),
    text_setting("software_version", "MAJOR.MINOR", "1.0"),
    text_setting("hardware_version", "MAJOR.MINOR", "1.0"),
    integer_setting("sample_rate_hz", "samples per second inside the product, Hz", 1000, 1, highest_sample_rate),
    integer_setting("raw_imu_hz", "ahrs.RawIMU per second, Hz: a divisor of sample_rate_hz; 0: none", 200, 0,
                    highest_sample_rate),
    integer_setting("solution_hz", "ahrs.Solution, likewise", 0, 0, highest_sample_rate),
    integer_setting("magnetic_field_hz", "ahrs.MagneticFieldStrength2, likewise; none where the place is not known",
                    0, 0, highest_sample_rate),
    integer_setting("static_pressure_hz", "air_data.StaticPressure, likewise; none where the place is not known", 0,
                    0, highest_sample_rate),
    integer_setting("static_temperature_hz", "air_data.StaticTemperature, likewise", 0, 0, highest_sample_rate),
    integer_setting("gnss_fix2_hz", "gnss.Fix2, likewise; without a fix where the place is not known", 0, 0,
                    highest_sample_rate),
    integer_setting("gnss_auxiliary_hz", "gnss.Auxiliary, likewise", 0, 0, highest_sample_rate),
    integer_setting("gyro_filter_hz",
                    "cut-off of the low-pass filter of the latest rates, Hz; 0, or from half of sample_rate_hz on: "
                    "none",
                    20, 0, highest_filter),
    integer_setting("accelerometer_filter_hz", "the same of the latest specific forces, Hz", 20, 0, highest_filter),
    integer_setting("priority", "of the measurements; 0: the highest", 16, 0, lowest_priority),
    integer_setting("sensor_id", "in MagneticFieldStrength2", 0, 0, 255),
    flag_setting("integrals", "RawIMU has integrated values", true),
    text_setting(
        "timestamp",
        "of RawIMU, Solution and Fix2: the time of the bus, 0 while it is not known; or the time since power-on",
        time_bases[0], time_bases),
    integer_setting("start_up_ms", "time in the mode initialization, without measurements, ms", 1000, 0, 60000),
};

struct Configuration {
  Identity identity;
  Values values;  // of the parameters, as delivered
  std::int64_t sample_rate;
  bool is_device_time;  // of the timestamps
};

// All throw std::invalid_argument, whose message lists the valid values.
Configuration configuration_of(const Settings& settings);
Product product_of(const Settings& settings);
// Responses are not listed: they are sent only if a host asks, and their identifiers have the node's id like the
// listed messages.
std::vector<CanMessage> can_messages(const Settings& settings, double rate_hz);
std::vector<CanFilter> can_filters(const Settings& settings);

std::unique_ptr<Decoder> make_decoder(const Settings& settings);

}  // namespace imud::dronecan
