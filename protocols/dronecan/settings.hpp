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
    {.key = "node_id", .help = "node id; 0: allocated by another node", .initial = std::int64_t{42}, .max = 125},
    {.key = "unique_id",
     .help = "32 hexadecimal digits, different for each unit; empty: made from node_id",
     .initial = std::string_view("")},
    {.key = "name", .help = "name in GetNodeInfo: a-z 0-9 . - _", .initial = std::string_view("org.imud.imu")},
    {.key = "software_version", .help = "MAJOR.MINOR", .initial = std::string_view("1.0")},
    {.key = "hardware_version", .help = "MAJOR.MINOR", .initial = std::string_view("1.0")},
    {.key = "sample_rate_hz",
     .help = "samples per second inside the product, Hz",
     .initial = std::int64_t{1000},
     .min = 1,
     .max = highest_sample_rate},
    {.key = "raw_imu_hz",
     .help = "ahrs.RawIMU per second, Hz: a divisor of sample_rate_hz; 0: none",
     .initial = std::int64_t{200},
     .max = highest_sample_rate},
    {.key = "solution_hz", .help = "ahrs.Solution, likewise", .initial = std::int64_t{0}, .max = highest_sample_rate},
    {.key = "magnetic_field_hz",
     .help = "ahrs.MagneticFieldStrength2, likewise; none where the place is not known",
     .initial = std::int64_t{0},
     .max = highest_sample_rate},
    {.key = "static_pressure_hz",
     .help = "air_data.StaticPressure, likewise; none where the place is not known",
     .initial = std::int64_t{0},
     .max = highest_sample_rate},
    {.key = "static_temperature_hz",
     .help = "air_data.StaticTemperature, likewise",
     .initial = std::int64_t{0},
     .max = highest_sample_rate},
    {.key = "gnss_fix2_hz",
     .help = "gnss.Fix2, likewise; without a fix where the place is not known",
     .initial = std::int64_t{0},
     .max = highest_sample_rate},
    {.key = "gnss_auxiliary_hz",
     .help = "gnss.Auxiliary, likewise",
     .initial = std::int64_t{0},
     .max = highest_sample_rate},
    {.key = "priority",
     .help = "of the measurements; 0: the highest",
     .initial = std::int64_t{16},
     .max = lowest_priority},
    {.key = "sensor_id", .help = "in MagneticFieldStrength2", .initial = std::int64_t{0}, .max = 255},
    {.key = "integrals", .help = "RawIMU has integrated values", .initial = true},
    {.key = "timestamp",
     .help = "of RawIMU, Solution and Fix2: the time of the bus, 0 while it is not known; or the time since power-on",
     .initial = time_bases[0],
     .choices = time_bases},
    {.key = "start_up_ms",
     .help = "time in the mode initialization, without measurements, ms",
     .initial = std::int64_t{1000},
     .max = 60000},
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
// Responses are not listed: they are sent only if a host asks, and have the node's id as the other messages have.
std::vector<CanMessage> can_messages(const Settings& settings, double rate_hz);
std::vector<CanFilter> can_filters(const Settings& settings);

std::unique_ptr<Decoder> make_decoder(const Settings& settings);

}  // namespace imud::dronecan
