// imu_number: the imu of a configuration that a command line chooses.
#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <stdexcept>
#include <string>
#include <vector>

#include "emulator/plan/config.hpp"

namespace imud {

// Returns the number of the first imu of this name, or of any if `name` is empty, that has the protocol; nullptr: any
// protocol. `file`: the configuration, for the message. Throws std::invalid_argument, which lists the imus.
inline std::size_t imu_number(const std::string& file, const std::vector<ImuConfig>& imus, const std::string& name,
                              const Protocol* protocol = nullptr) {
  std::string known;
  for (std::size_t i = 0; i < imus.size(); ++i) {
    if ((protocol == nullptr || imus[i].protocol == protocol) && (name.empty() || name == imus[i].name)) return i;
    known += fmt::format("{}{} ({})", known.empty() ? "" : ", ", imus[i].name, imus[i].protocol->name);
  }
  throw std::invalid_argument(
      fmt::format("{}: has no imu{}{}; there are {}", file, name.empty() ? "" : " " + name,
                  protocol == nullptr ? "" : fmt::format(" with the protocol {}", protocol->name), known));
}

}  // namespace imud
