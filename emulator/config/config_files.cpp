#include <filesystem>
#include <utility>

#include "emulator/config/config_parts.hpp"
#include "transports/file/file_replacement.hpp"

namespace imud {
namespace {

// Returns the path in a port's text; empty if the transport has no path, or if the port is a standard stream.
std::string path_in(const std::string& port) {
  const Transport* transport = transport_of(port);
  if (transport == nullptr || !transport->has_path) return {};
  const std::size_t begin = transport->name.size() + 1;
  const std::string path = port.substr(begin, port.find('?') - begin);
  return path == "-" ? std::string() : path;
}

}  // namespace

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
  if (path != "-") config.files.add(regular_file(path), "the file of the configuration");
  config.files.add(file_of(config.truth.port), "the file of the truth");
  for (const Faults::NamedFile& file : faults.named_files())
    config.files.add(regular_file(file.path), fmt::format("the file of {}", file.key));
  const FilesInUse inputs = config.files;
  for (std::size_t i = 0; i < config.imus.size(); ++i) {
    for (const auto& [port_key, port] : ports_of(config.imus[i])) {
      const std::string key = fmt::format("imu.{}.{}", i, port_key);
      const std::string file = file_of(port);
      if (file.empty()) continue;
      const auto claim = [&](const std::string& written, std::string_view what) {
        if (const std::string_view use = inputs.use_of(written); !use.empty())
          faults.add(tables[i].source().begin.line, key, fmt::format("{}is {}; give another", what, use));
        config.files.add(written, fmt::format("the file of {}", key));
      };
      claim(file, "");
      if (config.imus[i].port_settings.replaces_file)
        claim(fmt::format("{}{}", file, FileReplacement::suffix), "is written as another file first, which ");
    }
  }
}

}  // namespace imud
