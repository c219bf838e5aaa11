#include "emulator/plan/inclinometers.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <vector>

namespace imud {
namespace {
bool has_inclinometers(const Protocol& protocol, const Settings& settings) {
  return protocol.product != nullptr && protocol.product(settings).inclinometer.has_value();
}
}  // namespace

std::string inclinometer_objection(const Protocol& protocol, const Settings& settings) {
  if (has_inclinometers(protocol, settings)) return {};
  std::vector<std::string> others;
  for (const Protocol* other : protocols())
    if (other->takes_inclinometers)
      others.push_back(fmt::format("{} with [imu.inclinometer]", other->name));
    else if (has_inclinometers(*other, Settings(other->settings)))
      others.emplace_back(other->name);
  return fmt::format("needs inclinometers, which {} does not have; these do: {}", protocol.name,
                     fmt::join(others, ", "));
}

}  // namespace imud
