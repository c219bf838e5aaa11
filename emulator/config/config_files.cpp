#include <filesystem>
#include <map>
#include <system_error>
#include <utility>

#include "emulator/config/config_parts.hpp"
#include "transports/file/file_replacement.hpp"
#include "transports/file/output_path.hpp"

namespace imud {

namespace {

// Returns the path without symbolic links, `.` and `..`; empty if it cannot be.
std::string canonical_path(const std::filesystem::path& path) {
  std::error_code error;
  const auto all = std::filesystem::weakly_canonical(std::filesystem::absolute(path, error), error);
  return error ? std::string() : all.string();
}

// Returns the path in a port's text; empty if its transport has none, or if it is a standard stream.
std::string path_in(const std::string& port) {
  const Transport* transport = transport_of(port);
  if (transport == nullptr || !transport->has_path) return {};
  const std::size_t begin = transport->name.size() + 1;
  const std::string path = port.substr(begin, port.find('?') - begin);
  return path == "-" ? std::string() : path;
}

}  // namespace

std::string regular_file(const std::string& path) {
  std::error_code error;
  const auto type = std::filesystem::status(path, error).type();
  const bool fits = type == std::filesystem::file_type::regular || type == std::filesystem::file_type::not_found;
  return fits ? canonical_path(path) : std::string();
}

std::string path_of(const std::string& port) {
  const std::filesystem::path path = path_in(port);
  if (path.empty()) return {};
  if (!transport_of(port)->makes_link) return canonical_path(path);
  return (std::filesystem::path(canonical_path(path.has_parent_path() ? path.parent_path() : ".")) / path.filename())
      .string();
}

std::string file_of(const std::string& port) {
  const std::string path = path_in(port);
  return path.empty() ? std::string() : regular_file(path);
}

void check_files(Config& config, const std::string& path, const toml::array& tables, Faults& faults) {
  std::map<std::string, std::string_view> inputs;
  if (std::string file = path == "-" ? std::string() : regular_file(path); !file.empty())
    inputs.emplace(std::move(file), "the configuration");
  if (std::string truth = file_of(config.truth.port); !truth.empty()) inputs.emplace(std::move(truth), "the truth");
  for (const auto& [file, use] : inputs) config.files.push_back(file);
  for (std::size_t i = 0; i < config.imus.size(); ++i) {
    std::vector<std::pair<std::string_view, std::string>> ports = {{"port", config.imus[i].port},
                                                                   {"second_port", config.imus[i].second_port}};
    for (const std::string& copy : config.imus[i].also) ports.emplace_back("also", copy);
    for (const auto& [port_key, port] : ports) {
      const std::string_view key = port_key;
      const std::string file = file_of(port);
      if (file.empty()) continue;
      const auto claim = [&](const std::string& written, std::string_view what) {
        for (const auto& [input, use] : inputs)
          if (written == input || is_same_file(written, input))
            faults.add(tables[i].source().begin.line, fmt::format("imu.{}.{}", i, key),
                       fmt::format("{}is the file of {}; give another", what, use));
        config.files.push_back(written);
      };
      claim(file, "");
      if (config.imus[i].port_settings.replaces_file)
        claim(fmt::format("{}{}", file, FileReplacement::suffix), "is written as another file first, which ");
    }
  }
}

}  // namespace imud
