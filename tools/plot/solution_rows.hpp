// SolutionRow: the navigation solution of a sample, and a device that sends nothing else, within a process.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>

#include "emulator/plan/config.hpp"
#include "transports/port.hpp"

namespace imud {

// Plain numbers, as they pass from a device to its port in this process.
struct SolutionRow {
  std::int64_t time_ns = 0;  // of the device's clock
  bool has_place = false;
  std::uint16_t aids_used = 0, aids_rejected = 0;  // bits of namespace aid, when each was due last
  std::array<double, 4> q_LP{};                    // w, x, y, z; v_L = q_LP * v_P
  std::array<double, 3> r_E{}, v_L{};              // m, m/s; valid if has_place
  double latitude = 0, longitude = 0;              // rad; valid if has_place
  std::array<double, 9> sigma{};                   // rad about north, east, down; m/s; m; only of a filter
  double fix_age_s = 0;                            // since the last fix that the filter used
};

// Returns the imu with a device that sends a SolutionRow for each sample, to solution_port().
ImuConfig with_solution_rows(const ImuConfig& imu);
std::unique_ptr<Port> solution_port(std::function<void(const SolutionRow&)> receive);

}  // namespace imud
