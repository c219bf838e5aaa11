#include "emulator/rack/rack_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "emulator/config/config_text.hpp"
#include "emulator/config/load_config.hpp"
#include "emulator/drive/assembly.hpp"
#include "emulator/ground/shell_word.hpp"
#include "emulator/rack/rack_conflicts.hpp"
#include "emulator/truth/capture_check.hpp"
#include "emulator/watch/run_text.hpp"

namespace imud {
namespace {

// Loads a configuration as the systemd unit would, and makes its parts on ports that are not opened.
Config load_run(const RackRun& run) {
  if (record_transport_of(run.file) != nullptr)
    throw ConfigError(
        {fmt::format("{}: is the record of a run; give its configuration, which `imud check {} --toml` "
                     "prints",
                     run.file, path_word(run.file))});
  const std::string name = "control.name=" + run.name;
  Config config = load_config(run.file, std::span(&name, 1));
  Assembly(config, no_ports);
  refuse_late_faults(config);
  return config;
}

}  // namespace

std::vector<LoadedRun> load_rack(const Rack& rack, std::vector<std::string>& warnings) {
  std::vector<LoadedRun> loaded;
  std::vector<std::string> faults;
  const auto add = [&faults](const std::string& fault) {
    if (std::ranges::find(faults, fault) == faults.end()) faults.push_back(fault);  // a file may be of several hosts
  };
  for (const RackHost& host : rack.hosts)
    for (const RackRun& run : host.runs) try {
        loaded.push_back({&host, &run, load_run(run)});
        for (const std::string& warning : loaded.back().config.warnings)
          if (std::ranges::find(warnings, warning) == warnings.end()) warnings.push_back(warning);
      } catch (const ConfigError& error) {
        for (const std::string& fault : error.faults) add(fault);
      } catch (const PortError& error) {
        add(fmt::format("{}: {}", run.file, error.what()));
      }
  RackConflicts conflicts(rack, warnings);
  for (const LoadedRun& one : loaded) {
    Faults unused("");
    conflicts.add(one, read_config_text(one.run->file, {}, unused).root);
  }
  for (const std::string& fault : conflicts.faults()) add(fault);
  if (!faults.empty()) throw ConfigError(std::move(faults));
  return loaded;
}

int rack_check(const std::string& path) {
  const Rack rack = read_rack(path);
  std::vector<std::string> warnings;
  const std::vector<LoadedRun> runs = load_rack(rack, warnings);
  std::vector<std::vector<std::string>> rows = {{"HOST", "BY", "RUN", "IMU", "PRODUCT", "HZ", "PORT"}};
  for (const LoadedRun& one : runs)
    for (const ImuConfig& imu : one.config.imus)
      rows.push_back({one.host->name, one.host->ssh.empty() ? "this machine" : "ssh " + one.host->ssh,
                      one.run->text(), imu.name, std::string(imu.protocol->name), fmt::format("{:g}", imu.rate_hz),
                      imu.port});
  const Config& first = runs.front().config;
  fmt::print("{}: good\n", path);
  for (const std::string& line : table_lines(rows, {0, 1, 2, 3, 4, 6})) fmt::print("{}\n", line);
  fmt::print("clock {}, epoch {}; truth {} from {}\n", word_of(clock_words, first.clock),
             word_of(epoch_words, epoch_of(first)), first.truth.format->name, first.truth.port);
  for (const std::string& warning : warnings) fmt::print("warning: {}\n", warning);
  return 0;
}

}  // namespace imud
