#include "emulator/seeds/seed_checks.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sha256.h>

#include <array>
#include <string>
#include <vector>

#include "emulator/config/config_parts.hpp"
#include "emulator/config/config_text.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/seeds/seed_arrays.hpp"
#include "transports/file/file_replacement.hpp"
#include "transports/file/output_path.hpp"
#include "transports/port.hpp"

namespace imud {

namespace {

// Returns the SHA-256 of a file in hexadecimal; empty if it cannot be read.
std::string sha256_of_file(const std::string& path) {
  std::array<char, SHA256_DIGEST_STRING_LENGTH> text;
  return SHA256File(path.c_str(), text.data()) == nullptr ? std::string() : std::string(text.data());
}

}  // namespace

void refuse_single_run_options(const RunOptions& options) {
  std::vector<std::string> refused;
  if (options.ready_fd) refused.emplace_back("--ready-fd");
  for (const auto& [option, path] : options.outputs)
    if (path != options.summary_file && path != options.labels_file) refused.push_back(option);
  if (!refused.empty())
    throw PortError(
        fmt::format("of a single run: {}; omit them with --seeds, --jobs and --npy", fmt::join(refused, ", ")));
}

void check_seed_ports(const Config& config, bool repeats, bool many, bool has_arrays) {
  for (std::size_t i = 0; i < config.imus.size(); ++i) {
    const ImuConfig& imu = config.imus[i];
    if (!repeats && imu.sync.is_connected())
      throw PortError(
          fmt::format("imu.{}.sync: the pins of runs beside one another cannot be connected; omit it", i));
    if (has_arrays) continue;
    for (const auto& [key, port] : ports_of(imu)) {
      if (port.empty()) continue;
      const Transport* transport = transport_of(port);
      if (transport == nullptr || !transport->has_path || transport->makes_link || transport->uart != Uart::none ||
          transport->is_standard_output == nullptr || transport->is_standard_output(PortSpec::parse(port)))
        throw PortError(fmt::format(
            "imu.{}.{}: \"{}\": runs beside one another write files; give {}, or --npy FILE", i, key, port,
            fmt::join(port_examples([](const Transport& t) { return t.has_path && t.is_standard_output != nullptr; }),
                      " or ")));
      if (many && port.find(seed_placeholder) == std::string::npos)
        throw PortError(
            fmt::format("imu.{}.{}: \"{}\": each seed needs a file of its own; give a name with {}, such "
                        "as imu1_{}.bin, or --npy FILE",
                        i, key, port, seed_placeholder, seed_placeholder));
    }
  }
}

void check_seed_files(const Config& config, const RunOptions& options, const std::string& npy) {
  FilesInUse files = config.files;
  for (const auto& [option, path] : options.outputs)
    if (const std::string fault = files.claim(path, "the file of " + option); !fault.empty()) throw OpenError(fault);
  if (npy.empty()) return;
  for (const std::string& path : array_paths(config, npy))
    for (const std::string& written : {path, fmt::format("{}{}", path, FileReplacement::suffix)})
      if (const std::string fault = files.claim(written, "a file of --npy"); !fault.empty()) throw OpenError(fault);
}

std::string origin_of(const Config& config, const RunOptions& options) {
  const std::string capture = file_of(config.truth.port);
  if (capture.empty()) return {};
  std::string limit;
  if (options.duration_s) limit = fmt::format(", --for {}", *options.duration_s);
  return fmt::format("imud {}, configuration {}, capture {}{}", IMUD_VERSION, sha256(config.resolved()),
                     sha256_of_file(capture), limit);
}

}  // namespace imud
