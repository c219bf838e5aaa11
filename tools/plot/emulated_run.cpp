#include "tools/plot/emulated_run.hpp"

#include <fmt/format.h>
#include <stdlib.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>

#include "tools/child_program.hpp"
#include "tools/resolved_config.hpp"
#include "tools/setting_texts.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/port.hpp"

namespace imud {

namespace {

// A file that is removed with this.
class ScratchFile {
 public:
  ScratchFile() : path_("/tmp/imu-plot-XXXXXX") {
    FileDescriptor file(::mkstemp(path_.data()));
    if (!file) throw std::runtime_error(path_ + ": " + std::strerror(errno));
  }
  ~ScratchFile() { ::unlink(path_.c_str()); }
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;
  const std::string& path() const noexcept { return path_; }

 private:
  std::string path_;
};

std::string child_output(const std::vector<std::string>& arguments, const std::string& input = {},
                         ChildErrors errors = ChildErrors::shown) {
  const ChildResult result = run_child(imud_program(), arguments, input, errors);
  constexpr int incomplete = 3;  // as imud reports; faults may be the reason
  if (result.exit_code != 0 && result.exit_code != incomplete)
    throw std::runtime_error(fmt::format("imud {}: exit code {}", arguments.front(), result.exit_code));
  return result.output;
}

// Returns a setting's value as on a command line: a list with commas.
std::string setting_text(const nlohmann::json& value) {
  if (value.is_string()) return value;
  if (!value.is_array()) return value.dump();
  std::string text;
  for (const auto& item : value) text += fmt::format("{}{}", text.empty() ? "" : ",", item.get<std::string>());
  return text;
}

// Calls line(table, key, text) for each line of a TOML file that imud has written: its keys stand alone in their
// lines.
template <class Line>
void for_each_line(std::string_view text, Line line) {
  std::string_view table;
  while (!text.empty()) {
    const std::string_view all = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), all.size() + 1));
    if (all.starts_with('[')) table = all;
    line(table, all.substr(0, all.find(' ')), all);
  }
}

bool is_table(std::string_view table, std::string_view name) {
  return table == fmt::format("[[{}]]", name) || table.starts_with(fmt::format("[{}.", name));
}

// Returns the configuration with only the imu of that index and name, which sends to `port`, and
// without [[expect]]. A fault of the other imus becomes one without effect, so that all others keep the
// numbers from which they draw.
std::string with_one_imu(const std::string& resolved, std::size_t index, const std::string& name,
                         const std::string& port) {
  constexpr std::string_view none =
      "[[fault]]\ntarget = \"clock\"\nkind = \"jump\"\nvalue_s = 0\nat_s = 0\nfor_s = 1e-3\n\n";
  const std::string quoted = nlohmann::json(name).dump();
  std::string text, fault;
  bool is_ours = true;
  std::size_t imus = 0;
  const auto end_fault = [&] {
    text += is_ours ? fault : std::string(none);
    fault.clear();
    is_ours = true;
  };
  for_each_line(resolved, [&](std::string_view table, std::string_view key, std::string_view line) {
    if (line.starts_with("[[") && !fault.empty()) end_fault();
    if (is_table(table, "expect")) return;
    if (is_table(table, "fault")) {
      const bool names_imus = table == "[[fault]]" && key == "imu";
      if (names_imus) is_ours = line.find(quoted) != line.npos || line.find("\"*\"") != line.npos;
      fault += names_imus ? fmt::format("imu = {}\n", quoted) : fmt::format("{}\n", line);
      return;
    }
    if (line == "[[imu]]") ++imus;
    const bool is_imu = imus > 0 && (table == "[[imu]]" || table.starts_with("[imu."));
    if (is_imu && (imus != index + 1 || table.starts_with("[imu.sync"))) return;
    if (table == "[[imu]]" && (key == "port" || key == "second_port" || key == "also" || key == "pace")) return;
    text += fmt::format("{}\n", line);
    if (line == "[[imu]]") text += fmt::format("port = {}\n", nlohmann::json(port).dump());
  });
  if (!fault.empty()) end_fault();
  return text;
}

// Returns the configuration with the model "ideal", without the keys of its errors and without faults. The range
// stays.
std::string without_errors(const std::string& config) {
  std::string text;
  for_each_line(config, [&](std::string_view table, std::string_view key, std::string_view line) {
    if (is_table(table, "fault")) return;
    const bool has_errors = table == "[imu.gyro]" || table == "[imu.accelerometer]" ||
                            table == "[imu.magnetometer]" || table == "[imu.barometer]" ||
                            table == "[imu.navigation]";
    if (has_errors && key != table && !key.starts_with("max_") && !key.starts_with("min_")) return;
    if (table == "[[imu]]" && (key == "device_filters" || key == "internal_rate_hz" || key == "sampling_jitter_us"))
      return;
    text += table == "[[imu]]" && key == "model" ? "model = \"ideal\"\n" : fmt::format("{}\n", line);
  });
  return text;
}

}  // namespace

EmulatedRun::EmulatedRun(Options options) : options_(std::move(options)) {
  const ResolvedConfig resolved = resolve_config(options_.config, options_.overrides);
  seed_ = resolved.seed;
  std::string names;
  const auto& imus = resolved.checked.at("config").at("imu");
  for (std::size_t i = 0; i < imus.size(); ++i) {
    const auto& imu = imus[i];
    const std::string name = imu.at("name");
    names += fmt::format("{}{}", names.empty() ? "" : ", ", name);
    if (!name_.empty() || (!options_.imu.empty() && options_.imu != name)) continue;
    name_ = name;
    protocol_ = imu.at("protocol");
    if (imu.contains("device"))
      for (const auto& [key, value] : imu["device"].items()) settings_.push_back(key + "=" + setting_text(value));
    resolved_ = with_one_imu(resolved.toml, i, name, "PORT");
    frames_per_s_ = resolved.checked.at("imus").at(i).at("lines").at(0).at("frames_per_s");
  }
  if (name_.empty())
    throw std::invalid_argument(fmt::format("--imu {}: right would be one of {}", options_.imu, names));
}

StillRecording EmulatedRun::sent(std::uint64_t seed) {
  std::string config;
  for_each_line(resolved_, [&](std::string_view table, std::string_view key, std::string_view line) {
    // imud reads large seeds as texts.
    config += table.empty() && key == "seed" ? fmt::format("seed = \"{}\"\n", seed) : fmt::format("{}\n", line);
  });
  return record(config);
}

StillRecording EmulatedRun::truth() { return record(without_errors(resolved_)); }

StillRecording EmulatedRun::record(const std::string& config) {
  const Protocol& protocol = *find_protocol(protocol_);
  const bool is_can = protocol.link == Link::can;
  const ScratchFile file, summary;
  std::string port = standard_input_port(is_can, is_can);
  port.replace(port.size() - 1, 1, file.path());
  std::string text = config;
  text.replace(text.find("\"PORT\""), 6, nlohmann::json(port).dump());
  child_output({"replay", "-", options_.capture, "--fast", "--quiet", "--summary", summary.path()}, text,
               has_run_ ? ChildErrors::discarded : ChildErrors::shown);
  has_run_ = true;

  const auto decoder = protocol.make_decoder(settings_from(protocol.settings, settings_));
  const auto opened = open_port(port, Role::listener);
  RecordingOptions options;
  options.rate_hz = options_.rate_hz;
  options.largest_missing = 100;
  DecodeOptions input{.program = "imu-plot", .protocol = protocol_, .port = port};
  StillRecorder recorder(protocol, options, input.count);
  receive_all(*opened, *decoder, recorder, input);
  const std::uint64_t frames =
      nlohmann::json::parse(std::ifstream(summary.path())).at("imus").at(0).at("frames").get<std::uint64_t>();
  // Frames of the start-up have no measurement.
  if (recorder.measurements() > 0)
    recorder.set_nominal_rate(
        frames_per_s_ /
        std::max(1.0, std::round(static_cast<double>(frames) / static_cast<double>(recorder.measurements()))));
  return recorder.finish();
}

}  // namespace imud
