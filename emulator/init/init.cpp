#include "emulator/init/init.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <boost/algorithm/string/case_conv.hpp>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <vector>

#include "emulator/config/load_config.hpp"
#include "emulator/config/presets.hpp"
#include "emulator/frames/described_protocols.hpp"
#include "emulator/ground/shell_word.hpp"
#include "emulator/ground/table_reader.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/init/example.hpp"
#include "emulator/init/init_questions.hpp"
#include "emulator/init/simulators.hpp"
#include "transports/file/output_path.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

std::string frame_of(const InitOptions& options, const ChosenTruth& truth, const std::string& imu) {
  const Config config = config_of_text(truth.toml + imu);
  return earth_lines(options.place, config.truth.frame.kind == TruthFrame::Kind::earth,
                     truth.is_inertial || config.truth.frame.kind == TruthFrame::Kind::inertial);
}

// Returns the command that makes this configuration.
std::string command_of(const InitOptions& options) {
  std::string text = fmt::format("imud init {} --port {} --from {}", options.product, shell_word(options.port),
                                 shell_word(options.from));
  if (!options.truth.empty()) text += " --truth " + shell_word(options.truth);
  if (!options.place.empty()) text += " --place=" + shell_word(options.place);
  return text;
}

// Writes the text to standard output, or to a file, which must not exist unless it may be replaced.
void write(const std::string& path, const std::string& text, bool is_forced) {
  if (is_standard_output(path)) return fmt::print("{}", text);
  const auto refuse = [&](int error) {
    throw OpenError(fmt::format("{}: {}{}", path, std::strerror(error),
                                error == EEXIST ? "; --force replaces it, --output FILE takes another" : ""));
  };
  std::FILE* file = std::fopen(path.c_str(), is_forced ? "w" : "wx");
  if (file == nullptr) refuse(errno);
  const bool is_written = std::fwrite(text.data(), 1, text.size(), file) == text.size();
  if (std::fclose(file) != 0 || !is_written) refuse(errno);
}

// Returns a remark if imud has no figures of this unit and uses another unit's figures; otherwise an empty text.
std::string borrowed_errors(const ChosenProduct& product) {
  if (product.unit.empty()) return {};
  Settings settings(product.protocol->settings);
  settings.set_text("model", product.unit);
  const std::string_view model = default_model(*product.protocol, settings);
  if (find_preset(std::string(model)) == nullptr || product.unit.starts_with(model)) return {};
  return fmt::format(
      "The sensors have the errors of {0}: imud has none of {1} itself. Other errors are chosen by model (imud help "
      "imu.model).\n",
      model, product.unit);
}

// Returns the file of the configuration as a word of a command.
std::string file_word(const InitOptions& options) {
  return is_standard_output(options.output) ? "FILE" : path_word(options.output);
}

// Prints the next steps for this choice: to standard error if standard output has the configuration.
void print_next(const InitOptions& options, const ChosenProduct& product, const ChosenTruth& truth) {
  const std::string file = file_word(options);
  std::FILE* const out = is_standard_output(options.output) ? stderr : stdout;
  const std::string unit = product.unit.empty() ? "" : " --set model=" + product.unit;
  if (out == stderr)
    fmt::print(out, "Keep the configuration as FILE. Next:\n");
  else
    fmt::print("{} is written. Next:\n", options.output);
  fmt::print(out, "  imud check {}    # shows what the run would be\n", file);
  fmt::print(out, "  imud run {}    # until Ctrl-C\n", file);
  const Transport& port = *transport_of(options.port);
  // The client has the same address where there is a link, a file, or a receiver of datagrams.
  if (port.ends || port.makes_link || (port.keeps_datagrams && !port.has_path))
    fmt::print(out, "  imu-decode {} {}{}    # a client, {}\n", product.protocol->name, shell_word(options.port),
               unit, port.ends ? "after the run" : "in another terminal");
  else
    fmt::print(out, "The flight computer is the client, at the other end of {}.\n", options.port);
  fmt::print(out, "{}", borrowed_errors(product));
  if (!truth.remark.empty()) fmt::print(out, "{}\n", truth.remark);
  if (!truth.start.empty()) fmt::print(out, "While imud runs, start: {}\n", truth.start);
}

}  // namespace

std::span<const std::string_view> units_of(const Protocol& protocol) {
  for (const Setting& setting : protocol.settings)
    if (setting.key == "model") return setting.choices;
  return {};
}

ChosenProduct choose_product(const std::string& name) {
  const std::string lower = boost::to_lower_copy(name);
  if (const Protocol* protocol = resolve_protocol(lower)) return {protocol, {}};
  std::vector<std::string> known = protocol_names();
  for (const Protocol* protocol : protocols())
    for (const std::string_view unit : units_of(*protocol)) {
      if (unit == lower) return {protocol, lower};
      known.emplace_back(unit);
    }
  if (std::ranges::find(presets(), lower, &Preset::name) != presets().end())
    throw OpenError(fmt::format(
        "there is no product \"{0}\", but the preset of its errors: choose the product whose messages are "
        "sent, and give model = \"{0}\" in [[imu]]",
        lower));
  throw OpenError(
      fmt::format("there is no product \"{}\"; {}", name, suggestion(lower, known, "imud list shows all")));
}

void check_device_port(const Protocol& protocol, const std::string& port) {
  const bool is_can = protocol.link == Link::can;
  const auto fits = [&](const Transport& transport) {
    return transport.serves_device && transport.carries_can == is_can;
  };
  const Transport* transport = transport_of(port);
  if (transport == nullptr || !fits(*transport))
    throw OpenError(fmt::format("\"{}\" is no port for {}, which is on a {}; give {}", port, protocol.name,
                                is_can ? "CAN bus" : "serial line", fmt::join(port_examples(fits), ", ")));
  check_port(*transport, PortSpec::parse(port), PortSettings(Role::device));
}

std::string earth_lines(const std::string& place, bool is_on_earth, bool is_inertial) {
  if (place.empty())
    return "\n# the place of the simulation, for magnetic field, pressure, GNSS, and a vehicle at rest: imud help "
           "earth\n#[earth]\n";
  std::array<double, 3> numbers = {0, 0, 0};
  std::size_t count = 0;
  const char* at = place.data();
  const char* const end = at + place.size();
  bool is_good = true;
  while (is_good && count < numbers.size() && at != end) {
    if (count > 0) is_good = *at++ == ',';
    while (at != end && *at == ' ') ++at;
    const auto [next, error] = std::from_chars(at, end, numbers.at(count++));
    is_good = is_good && error == std::errc();
    at = next;
  }
  const auto [latitude, longitude, height] = numbers;
  if (!is_good || at != end || count < 2 || latitude < -90 || latitude > 90 || longitude < -180 || longitude > 360)
    throw OpenError(
        fmt::format("\"{}\" is no place; give LATITUDE,LONGITUDE in degrees, and a height in m if it is "
                    "not 0: 47.26,11.35,577",
                    place));
  const bool is_local = !is_on_earth && !is_inertial;
  const std::string_view prefix = is_local ? "" : "rest_";
  return fmt::format("\n[earth]\n{}# {}\n{}latitude_deg = {}\n{}longitude_deg = {}\n{}height_m = {}\n",
                     is_local ? "# the simulator's world is north-east-down at a place\nframe = \"local\"\n"
                     : is_inertial
                         ? "# the simulator's frame has its origin in the Earth's centre, and does not turn\nframe = "
                           "\"inertial\"\n"
                         : "",
                     is_local ? "its origin" : "where the vehicle rests until the first truth comes", prefix,
                     latitude, prefix, longitude, prefix, height);
}

const CLI::App* add_init_command(CLI::App& app, InitOptions& options) {
  CLI::App* command =
      app.add_subcommand("init",
                         "Write a configuration for a product, a port and a simulator; at a terminal, ask for what "
                         "is missing; without one, PRODUCT, --port and --from are needed");
  command->add_option("PRODUCT", options.product, "A protocol of imud list, or a product of one, such as vn-200");
  const auto add = [&](const std::string& name, std::string& value, const std::string& unit,
                       const std::string& help) { return command->add_option(name, value, help)->type_name(unit); };
  add("--port", options.port, "PORT", "Where the flight computer is connected, such as pty:imu1");
  std::vector<std::string_view> names;
  for (const Simulator& simulator : simulators()) names.push_back(simulator.name);
  add("--from", options.from, "SIMULATOR",
      fmt::format("{}; or a truth format of imud list, or a captured file", fmt::join(names, ", ")));
  add("--truth", options.truth, "PORT", "Another port for the truth than the simulator's usual one, or its number");
  add("--place", options.place, "LAT,LON,HEIGHT", "Where the simulation is, deg and m; the height may be left out");
  add("--output", options.output, "FILE", "The file to write (imud.toml); - is standard output");
  command->add_flag("--force", options.is_forced, "Replace the file if it exists");
  return command;
}

int init(InitOptions options) {
  const bool is_complete = !options.product.empty() && !options.port.empty() && !options.from.empty();
  if (!is_complete && ::isatty(STDIN_FILENO) == 1 && ::isatty(STDOUT_FILENO) == 1) ask(options);
  std::vector<std::string_view> missing;
  if (options.product.empty()) missing.emplace_back("PRODUCT");
  if (options.port.empty()) missing.emplace_back("--port PORT");
  if (options.from.empty()) missing.emplace_back("--from SIMULATOR");
  if (!missing.empty())
    throw OpenError(fmt::format("{} {} missing; at a terminal imud init asks", fmt::join(missing, ", "),
                                missing.size() == 1 ? "is" : "are"));
  const ChosenProduct product = choose_product(options.product);
  check_device_port(*product.protocol, options.port);
  const ChosenTruth truth = choose_truth(options.from, options.truth);
  const std::string imu = imu_text(*product.protocol, options.port, product.unit);
  const bool has_clock = truth.toml.find("\nclock") != truth.toml.npos;
  const std::string text = fmt::format(
      "# {}\n# A # before a key makes it a comment, which shows the default or an example. `imud check {}` shows "
      "what "
      "the\n# configuration does; `imud help KEY` explains a key, `man imud.toml` all of them.\n\n"
      "# seed of all random numbers\n#seed = 1\n{}\n{}{}{}",
      command_of(options), file_word(options),
      has_clock ? "" : "# what paces the samples (one of realtime, lockstep, fast)\n#clock = \"realtime\"\n",
      truth.toml, frame_of(options, truth, imu), imu);
  config_of_text(text);
  std::error_code none;
  if (std::filesystem::equivalent(options.output, options.from, none))
    throw OpenError(fmt::format("{} is the captured file; give another --output", options.output));
  write(options.output, text, options.is_forced);
  print_next(options, product, truth);
  return 0;
}

}  // namespace imud
