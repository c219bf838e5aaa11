#include "tools/resolved_config.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "tools/child_program.hpp"

namespace imud {

namespace {

std::string output_of(const std::vector<std::string>& arguments, const std::string& input = {}) {
  const ChildResult result = run_child(imud_program(), arguments, input);
  if (result.exit_code != 0)
    throw std::runtime_error(fmt::format("imud {}: exit code {}", arguments.front(), result.exit_code));
  return result.output;
}

}  // namespace

ResolvedConfig resolve_config(const std::string& path, const std::vector<std::string>& overrides) {
  std::vector<std::string> arguments = {"check", path, "--toml"};
  for (const std::string& text : overrides) arguments.insert(arguments.end(), {"--set", text});
  try {
    ResolvedConfig config;
    config.toml = output_of(arguments);
    config.checked = nlohmann::json::parse(output_of({"check", "-", "--json"}, config.toml));
    const auto& seed = config.checked.at("config").at("seed");  // imud writes large seeds as texts
    config.seed = seed.is_string() ? std::stoull(seed.get<std::string>()) : seed.get<std::uint64_t>();
    return config;
  } catch (const std::exception& error) {
    throw std::invalid_argument(error.what());
  }
}

}  // namespace imud
