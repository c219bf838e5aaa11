#include "emulator/commands/found_config.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <vector>

#include "emulator/ground/text_file.hpp"

namespace imud {

std::string found_config() {
  // The XDG Base Directory Specification 0.8: a folder that is no absolute path is ignored.
  const auto folder = [](const char* variable) {
    const char* value = std::getenv(variable);
    return std::string(value != nullptr && *value == '/' ? value : "");
  };
  std::vector<std::string> places = {"./imud.toml"};
  if (const std::string own = folder("XDG_CONFIG_HOME"); !own.empty())
    places.push_back(own + "/imud/imud.toml");
  else if (const std::string home = folder("HOME"); !home.empty())
    places.push_back(home + "/.config/imud/imud.toml");
  places.emplace_back("/etc/imud/imud.toml");
  for (const std::string& place : places) {
    std::error_code none;  // a folder that may not be entered has no configuration
    if (!std::filesystem::is_regular_file(place, none)) continue;
    fmt::print(stderr, "imud: configuration {}\n", place);
    return place;
  }
  throw OpenError(fmt::format("no configuration is given, and there is no {}; `imud init` makes one",
                              fmt::join(places, ", no ")));
}

}  // namespace imud
