#include "emulator/check.hpp"

#include <fmt/format.h>

#include "core/igrf.hpp"
#include "emulator/line_load.hpp"

namespace imud {

namespace {

std::string clock_word(ClockMode clock) {
  return clock == ClockMode::realtime ? "realtime" : clock == ClockMode::lockstep ? "lockstep" : "fast";
}

}  // namespace

int check(const std::string& path, const Config& config) {
  fmt::print("{}: good\n", path);
  fmt::print("{:<8} seed {}, clock {}\n", "run", config.seed, clock_word(config.clock));
  fmt::print("{:<8} {} from {}\n", "truth", config.truth.format->name, config.truth.port);
  const EarthModel& earth = config.imus.front().model.earth;  // the same for all
  if (earth.frame != EarthModel::Frame::none && decimal_year(earth.start_gps_ns) > igrf14_end)
    fmt::print("{:<8} warning: IGRF-14 ends in {}; the magnetic field at `start` is extrapolated\n", "earth",
               igrf14_end);
  for (const ImuConfig& imu : config.imus) {
    const LineLoad load = line_load(imu);
    fmt::print("{:<8} {} at {} Hz to {}: {}\n", imu.name, imu.protocol->name, imu.rate_hz, imu.port, load.text());
    if (!imu.second_port.empty())
      fmt::print("{:<8} second port {}: {}\n", "", imu.second_port, line_load(imu, 1).text());
    if (load.percent > 70.0 && imu.protocol->link == Link::can)
      fmt::print("{:<8} warning: above 70 % a CAN bus delays frames of low priority\n", "");
    if (imu.before_first == BeforeFirst::rest) fmt::print("{:<8} samples a vehicle at rest until truth comes\n", "");
  }
  return 0;
}

}  // namespace imud
