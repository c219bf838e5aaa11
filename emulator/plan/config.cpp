#include "emulator/plan/config.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace imud {

ConfigError::ConfigError(std::vector<std::string> all)
    : std::runtime_error(fmt::format("{}", fmt::join(all, "\n"))), faults(std::move(all)) {}

bool is_capture(const std::string& truth_port) noexcept {
  const Transport* transport = transport_of(truth_port);
  return transport != nullptr && transport->ends;
}

}  // namespace imud
