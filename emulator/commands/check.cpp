#include "emulator/commands/check.hpp"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>
#include <utility>
#include <vector>

#include "core/units.hpp"
#include "emulator/config/config_parts.hpp"
#include "emulator/config/line_load.hpp"
#include "emulator/config/presets.hpp"
#include "emulator/control/running_keys.hpp"
#include "emulator/control/token.hpp"
#include "emulator/drive/assembly.hpp"
#include "emulator/ground/error_text.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/plan/config.hpp"
#include "emulator/report/clock_watch.hpp"
#include "emulator/report/outcome.hpp"
#include "emulator/truth/capture_check.hpp"

namespace imud {
namespace {

using Json = nlohmann::ordered_json;

// Makes the objects that a run makes before it begins. Throws the same errors as a run.
void make_parts(const Config& config, const CheckOptions& options) {
  check_figures(options.required, config);
  Assembly(config, no_ports);
}

// Returns a colon and a text about the imu's model; empty if there is nothing to say.
std::string model_note(const ImuConfig& imu) {
  if (const Preset* preset = find_preset(imu.errors_model)) {
    const std::vector<Preset::Figure> figures = preset->figures();
    return fmt::format(": {}; {} of its {} values are unconfirmed", preset->summary(),
                       std::ranges::count(figures, false, &Preset::Figure::is_confirmed), figures.size());
  }
  if (imu.protocol->product == nullptr) return {};
  return imu.errors_model == "white" ? ": white noise alone" : ": none";
}

// Describes the delay of live truth, and the latency that it adds.
std::string delay_text(const TruthConfig& truth) {
  if (truth.clock.automatic_percent > 0)
    return "the sensors sample behind the truth by an automatic delay, which adds a truth interval, its jitter and "
           "0.5 ms of latency: 11 ms at 100 Hz; it is settled before the first sample, within 1 s after the first "
           "truth";
  if (truth.clock.delay.count() == 0)
    return "the sensors sample without delay: no latency is added, and motion is extrapolated from truth to truth";
  return fmt::format(
      "the sensors sample {0:g} ms behind the truth, which adds {0:g} ms of latency; motion is extrapolated if a "
      "truth "
      "interval and its jitter are longer",
      1e3 * seconds(truth.clock.delay));
}

// Returns a text about the grid of the samples and the present state of the grid's clock; empty if there is no clock.
std::string epoch_text(const Config& config) {
  ClockFigures clock;
  clock.epoch = epoch_of(config);
  if (clock.epoch == Epoch::none) return {};
  if (clock.epoch != Epoch::monotonic) clock.state = read_clock_state();
  const std::string error = clock_error_text(clock);
  return fmt::format("samples are on the grid of {}{}{}", word_of(epoch_words, clock.epoch),
                     error.empty() ? "" : ", ", error);
}

// Describes the unit's own filter.
std::string solution_text(const ImuConfig& imu, const EarthModel& earth) {
  const NavigatorModel& navigator = imu.navigator;
  const double antennas_heading = imu.model.navigation.antennas_heading;
  const auto aid = [](double rate_hz, std::string_view what, const std::string& accuracy) {
    return rate_hz > 0 ? fmt::format("{} at {:g} Hz ({})", what, rate_hz, accuracy) : fmt::format("no {}", what);
  };
  const bool is_coarse = navigator.alignment == NavigatorModel::Alignment::coarse;
  const std::string headings = aid(navigator.magnetic_rate_hz, "magnetic headings",
                                   fmt::format("{:.3g} deg", navigator.heading / units::degree));
  if (navigator.kind == NavigatorModel::Kind::attitude) {
    const bool has_place = earth.frame == EarthModel::Frame::local || earth.frame == EarthModel::Frame::inertial;
    return fmt::format(
        "attitude by the unit's filter: gravity ({:.3g} m/s^2 when quiet), {}, {}; {}", navigator.quiet_acceleration,
        headings,
        has_place
            ? "true by the declination of the place of the alignment"
            : "true where the truth has a place, else magnetic; without a place and a magnetic field of the truth "
              "the heading drifts from 0",
        is_coarse ? fmt::format("it levels for {:g} s", navigator.alignment_s) : "it begins at the true attitude");
  }
  const std::string antennas = antennas_heading > 0 ? fmt::format(", headings by two antennas with them ({:.3g} deg)",
                                                                  antennas_heading / units::degree)
                                                    : std::string();
  const std::string height = navigator.barometer_rate_hz > 0
                                 ? fmt::format(", {}", aid(navigator.barometer_rate_hz, "barometric heights",
                                                           fmt::format("{:.3g} m", navigator.barometric_height)))
                                 : std::string();
  return fmt::format(
      "solution by the unit's filter{}: {}{}, {}{}{}; {}",
      navigator.estimates_scale_factors ? ", with scale factors" : "",
      aid(navigator.gnss_rate_hz, "fixes",
          fmt::format("{:.3g} m, {:.3g} m/s north", std::hypot(navigator.position.x(), navigator.slow_position.x()),
                      std::hypot(navigator.velocity.x(), navigator.slow_velocity.x()))),
      antennas, headings, height, navigator.zero_velocity ? ", no velocity at rest" : "",
      is_coarse ? fmt::format("no place of its own until it has aligned, {:g} s and the latency after the first fix",
                              navigator.alignment_s)
                : "it begins at the true attitude");
}

void print_text(const std::string& path, const Config& config) {
  fmt::print("{}: good\n", path);
  fmt::print("{:<8} seed {}, clock {}\n", "run", config.seed, word_of(clock_words, config.clock));
  if (const std::string epoch = epoch_text(config); !epoch.empty()) fmt::print("{:<8} {}\n", "epoch", epoch);
  fmt::print("{:<8} {} from {}\n", "truth", config.truth.format->name, config.truth.port);
  if (has_live_truth(config)) fmt::print("{:<8} {}\n", "", delay_text(config.truth));
  if (const std::string derived = fit_text(config.truth); !derived.empty()) fmt::print("{:<8} {}\n", "", derived);
  fmt::print("{:<8} {}\n", "earth", earth_text(config.truth));
  for (const ImuConfig& imu : config.imus) {
    fmt::print("{:<8} {} at {} Hz to {}: {}\n", imu.name, imu.protocol->name, imu.rate_hz, imu.port, imu.load.text());
    if (!imu.second_port.empty())
      fmt::print("{:<8} second port {}: {}\n", "", imu.second_port, imu.second_load.text());
    if (imu.protocol->layout != nullptr)
      for (const std::string& line : imu.protocol->layout(imu.settings)) fmt::print("{:<8} {}\n", "", line);
    for (const std::string& copy : imu.also) fmt::print("{:<8} the same bytes to {}\n", "", copy);
    if (imu.before_first == BeforeFirst::rest) fmt::print("{:<8} samples a vehicle at rest until truth comes\n", "");
    fmt::print("{:<8} errors of the model {}{}\n", "", imu.errors_model, model_note(imu));
    for (const TriadTerms& triad : triad_terms(imu.model)) {
      const std::string text = triad.text();
      fmt::print("{:<8} {} noise: {}\n", "", triad.name, text.empty() ? "none" : text);
      if (const std::string bias = triad.bias_text(); !bias.empty())
        fmt::print("{:<8} {} constant errors: {}\n", "", triad.name, bias);
    }
    for (const TriadFilter& triad : triad_filters(imu.model))
      fmt::print("{:<8} {} filter{} at {} Hz: {}\n", "", triad.name, imu.device_filters ? " of the product" : "",
                 triad.rate_hz, triad.text());
    if (imu.navigator.is_on) fmt::print("{:<8} {}\n", "", solution_text(imu, config.truth.earth));
  }
  for (const BusLoad& bus : bus_loads(config.imus))
    if (bus.imus.size() > 1) fmt::print("{:<8} {}, {} imus: {}\n", "bus", bus.address, bus.imus.size(), bus.text());
  for (const FaultConfig& fault : config.faults) fmt::print("{:<8} {}\n", fault.name, fault.text());
  for (const ExpectConfig& expect : config.expectations)
    fmt::print("{:<8} expected: {}\n", expect.name, expect.text());
  for (const std::string& warning : config.warnings) fmt::print("warning: {}\n", warning);
  fmt::print("imud check --toml prints the value of every key\n");
}

Json load_json(const std::string& port, const LineLoad& load) {
  Json json = {{"port", port},
               {"frames_per_s", load.frames_per_s},
               {"bits_per_s", load.bits_per_s},
               {"average_bits_per_s", load.average_bits_per_s}};
  json["line_bits_per_s"] = load.line_bits_per_s > 0.0 ? Json(load.line_bits_per_s) : Json();
  json["percent"] = load.line_bits_per_s > 0.0 ? Json(load.percent) : Json();
  json["average_percent"] = load.line_bits_per_s > 0.0 ? Json(load.average_percent) : Json();
  return json;
}

// The path of a file may be no UTF-8.
void print_object(const Json& json) { fmt::print("{}\n", json.dump(2, ' ', false, Json::error_handler_t::replace)); }

void print_json(const std::string& path, const Config& config) {
  std::ostringstream resolved;
  resolved << toml::json_formatter(toml::parse(config.resolved()));
  Json imus = Json::array();
  for (const ImuConfig& imu : config.imus) {
    Json lines = Json::array({load_json(imu.port, imu.load)});
    if (!imu.second_port.empty()) lines.push_back(load_json(imu.second_port, imu.second_load));
    Json imu_json = {{"name", imu.name}, {"model", imu.errors_model}, {"lines", std::move(lines)}};
    if (imu.protocol->layout != nullptr) imu_json["layout"] = imu.protocol->layout(imu.settings);
    for (const TriadTerms& triad : triad_terms(imu.model)) {
      const auto& [x, y, z] = triad.axes;
      for (const AllanWords& term : allan_words())
        imu_json["noise"][triad.name][std::string(1, term.letter)] =
            Json::array({x.*term.value, y.*term.value, z.*term.value});
    }
    for (const TriadFilter& triad : triad_filters(imu.model)) {
      const Vector3& cut_off = triad.filter.cut_off_hz;
      imu_json["filters"][triad.name] = {
          {"rate_hz", triad.rate_hz},      {"low_pass_hz", {cut_off[0], cut_off[1], cut_off[2]}},
          {"order", triad.filter.order},   {"length", triad.filter.length},
          {"stages", triad.filter.stages}, {"group_delay_s", {triad.delay_s(0), triad.delay_s(1), triad.delay_s(2)}}};
      if (triad.taps) imu_json["filters"][triad.name]["fir_taps"] = *triad.taps;
    }
    imus.push_back(std::move(imu_json));
  }
  Json buses = Json::array();
  for (const BusLoad& bus : bus_loads(config.imus)) {
    Json names = Json::array();
    for (const std::size_t i : bus.imus) names.push_back(config.imus[i].name);
    buses.push_back({{"port", bus.address},
                     {"imus", std::move(names)},
                     {"line_bits_per_s", bus.line_bits_per_s},
                     {"percent", bus.percent},
                     {"average_percent", bus.average_percent}});
  }
  Json fit;
  if (config.truth.fit)
    fit = {{"text", fit_text(config.truth)},
           {"delay_s", seconds(config.truth.fit->delay)},
           {"longest_delay_s", seconds(config.truth.fit->delay) * PoseFit::widest_factor(config.truth.fit->widest)},
           {"bandwidth_hz", PoseFit::bandwidth_hz(config.truth.fit->delay)}};
  Json delay;
  if (has_live_truth(config)) {
    const bool is_automatic = config.truth.clock.automatic_percent > 0;
    delay = {{"text", delay_text(config.truth)},
             {"automatic", is_automatic},
             {"delay_ms", is_automatic ? Json() : Json(1e3 * seconds(config.truth.clock.delay))}};
  }
  const Json json = {{"path", path},
                     {"good", true},
                     {"faults", Json::array()},
                     {"warnings", config.warnings},
                     {"delay", std::move(delay)},
                     {"derived", std::move(fit)},
                     {"epoch", epoch_text(config)},
                     {"earth", earth_text(config.truth)},
                     {"imus", std::move(imus)},
                     {"buses", std::move(buses)},
                     {"running_keys", running_keys_json()},
                     {"config", Json::parse(resolved.str())}};
  print_object(json);
}

int print_faults(const std::string& path, const std::vector<std::string>& faults) {
  print_object({{"path", path}, {"good", false}, {"faults", faults}});
  return 2;
}

// Returns the error of a file with a token; empty if it is good, or if there is none.
std::string token_fault(const std::string& file) {
  try {
    if (!file.empty()) Token::read_secret(file);
    return {};
  } catch (const OpenError& error) {
    return error.what();
  }
}

}  // namespace

int check(const std::string& path, std::span<const std::string> overrides, const CheckOptions& options) {
  try {
    Config config = load_config(path, overrides, options.capture, options.scenarios);
    make_parts(config, options);
    const CaptureFindings findings = check_capture(config);
    if (!options.capture.empty() && !options.repeats && !findings.no_truth.empty())
      throw ConfigError({findings.no_truth});
    if (!findings.faults.empty() && !options.repeats) throw ConfigError(findings.faults);
    config.warnings.insert(config.warnings.end(), findings.warnings.begin(), findings.warnings.end());
    if (epoch_of(config) != Epoch::none)
      if (const std::string fault = epoch_fault(config.realtime, read_clock_state()); !fault.empty())
        config.warnings.push_back("imud run does not begin: " + fault);
    for (const auto& [listen, file] : {std::pair(config.control.listen, config.control.token_file),
                                       std::pair(config.web.listen, config.web.token_file)})
      if (const std::string fault = listen.empty() ? std::string() : token_fault(file); !fault.empty())
        config.warnings.push_back("imud run does not begin: " + fault);
    if (options.layout == CheckLayout::text) print_text(path, config);
    if (options.layout == CheckLayout::toml) fmt::print("{}", config.resolved());
    if (options.layout == CheckLayout::json) print_json(path, config);
    return 0;
  } catch (const ConfigError& error) {
    if (options.layout != CheckLayout::json) throw;
    return print_faults(path, error.faults);
  } catch (const PortError& error) {
    if (options.layout != CheckLayout::json) throw;
    return print_faults(path, {error.what()});
  } catch (const RequirementError& error) {
    if (options.layout != CheckLayout::json) throw;
    return print_faults(path, {fmt::format("--require {}", error.what())});
  }
}

}  // namespace imud
