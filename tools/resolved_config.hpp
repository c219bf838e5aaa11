// ResolvedConfig: a configuration of imud with the value of every key, as `imud check` has it.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace imud {

struct ResolvedConfig {
  std::string toml;
  nlohmann::json checked;  // the output of `imud check --json`
  std::uint64_t seed = 0;
};

// Has imud resolve the configuration at `path` with the overrides KEY=VALUE. Throws std::invalid_argument if it has
// faults, which imud has reported on standard error.
ResolvedConfig resolve_config(const std::string& path, const std::vector<std::string>& overrides = {});

}  // namespace imud
