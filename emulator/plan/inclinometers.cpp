#include "emulator/plan/inclinometers.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <string_view>
#include <vector>

namespace imud {
namespace {
bool has_inclinometers(const Protocol& protocol, const Settings& settings) {
  return protocol.product != nullptr && protocol.product(settings).inclinometer.has_value();
}
}  // namespace

std::string inclinometer_objection(const Protocol& protocol, const Settings& settings) {
  if (has_inclinometers(protocol, settings)) return {};
  std::vector<std::string_view> others;
  for (const Protocol* other : protocols())
    if (has_inclinometers(*other, Settings(other->settings))) others.push_back(other->name);
  return fmt::format("needs inclinometers, which {} does not have; these do: {}", protocol.name,
                     fmt::join(others, ", "));
}

}  // namespace imud
