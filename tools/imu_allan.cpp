// imu-allan: the Allan deviation of a sensor at rest, and the noise terms that explain it.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "core/requirement.hpp"
#include "emulator/ground/progress_line.hpp"
#include "emulator/plan/number_check.hpp"
#include "tools/allan/allan_plot.hpp"
#include "tools/allan/allan_report.hpp"
#include "tools/allan/preset_text.hpp"
#include "tools/allan/recorded_input.hpp"
#include "tools/allan/still_recording.hpp"
#include "tools/gnuplot.hpp"
#include "tools/output_options.hpp"
#include "tools/program.hpp"
#include "tools/text_output.hpp"
#include "transports/file/output_path.hpp"

namespace imud {
namespace {

constexpr int limit_broken = 3;

struct Options {
  RecordedInput input{.source = {.program = "imu-allan"}, .recording = {}, .columns = {}};
  std::string kind = "overlapping";
  unsigned per_decade = 0;
  double confidence = 0.68;
  double fit_from_s = 0;
  double fit_to_s = std::numeric_limits<double>::infinity();
  std::vector<std::string> limits;
  std::string against;
  double tolerance_percent = 10;
  std::string json_path, data_path, plot_path, preset_path;
};

AllanKind kind_named(const std::string& name) {
  std::string names;
  for (const AllanKind kind : allan_kinds) {
    if (name_of(kind) == name) return kind;
    names += fmt::format("{}{}", names.empty() ? "" : ", ", name_of(kind));
  }
  throw std::invalid_argument(fmt::format("--deviation {}: right would be one of {}", name, names));
}

void check_outputs(Options& options, const OutputOptions& outputs) {
  if (!options.plot_path.empty()) {
    check_plot(options.plot_path);
    if (options.data_path.empty()) {
      options.data_path = data_path_beside(options.plot_path);
      check_data_path(options.data_path, "tau_s,");
    }
    if (is_standard_output(options.data_path))
      throw std::invalid_argument("--data -: the data of a plot are a file; right would be --data FILE");
  }
  if (!options.preset_path.empty() && !options.preset_path.ends_with(".toml"))
    throw std::invalid_argument(fmt::format("--to-config {}: right would be FILE.toml", options.preset_path));
  FilesInUse files;
  add_input_files(options.input.source, files);
  add_model_file(options.against, "--against", files);
  if (const std::string fault = outputs.claim(files); !fault.empty()) throw std::invalid_argument(fault);
}

// Throws if the range of the fit has fewer averaging times than a fit needs.
void require_fit_range(const AllanCurve& curve, const Options& options) {
  const auto count = std::ranges::count_if(curve.points, [&](const AllanCurve::Point& point) {
    return point.tau_s >= options.fit_from_s && point.tau_s <= options.fit_to_s;
  });
  if (count >= 2) return;
  throw std::invalid_argument(
      fmt::format("--fit-from, --fit-to: {} in this range; right would be two or more of {:.4g} s to {:.4g} s",
                  count == 1 ? "1 averaging time lies" : "0 averaging times lie", curve.points.front().tau_s,
                  curve.points.back().tau_s));
}

int analyse(Options& options, const OutputOptions& outputs, bool& running) {
  AllanReport report;
  report.protocol = options.input.source.protocol;
  report.port = options.input.source.port;
  report.confidence = options.confidence;
  report.tolerance = options.tolerance_percent / 100;
  // The name of the model is checked here, so that a wrong name is reported before a long recording. The terms are
  // computed later, at the recording's rate.
  if (!options.against.empty()) report.against = model_terms(options.against, 0);
  const AllanKind kind = kind_named(options.kind);
  if (options.fit_from_s >= options.fit_to_s)
    throw std::invalid_argument(fmt::format("--fit-from {} --fit-to {}: right would be a --fit-from below --fit-to",
                                            options.fit_from_s, options.fit_to_s));
  for (const std::string& limits : options.limits)
    for (Requirement& limit : parse_requirements(limits)) report.required.push_back(std::move(limit));
  for (const Requirement& limit : report.required) report.seen(limit);
  check_outputs(options, outputs);

  report.recording = record(options.input, running, report.ended_by);
  if (!options.against.empty())
    report.against = model_terms(options.against, report.recording.rate_hz, &options.input.source);
  running = true;
  report.samples = report.recording.samples();
  ProgressLine progress;
  for (auto& channel : report.recording.channels) {
    progress.show(static_cast<double>(report.axes.size()) / static_cast<double>(report.recording.channels.size()),
                  "the deviations");
    AllanReport::Axis axis{channel.number, {}, {}, channel.is_increment};
    axis.curve = allan_curve(kind, std::move(channel.values), report.recording.rate_hz, options.per_decade,
                             options.confidence);
    require_fit_range(axis.curve, options);
    axis.fit = fit_allan_terms(axis.curve, options.fit_from_s, options.fit_to_s);
    report.axes.push_back(std::move(axis));
  }
  progress.clear();

  if (!is_standard_output(options.json_path) && !is_standard_output(options.data_path))
    fmt::print("{}", report.text());
  if (!options.json_path.empty()) write_file(options.json_path, report.json());
  if (!options.data_path.empty()) write_file(options.data_path, report.csv());
  if (!options.preset_path.empty()) write_file(options.preset_path, preset_text(report));
  if (!options.plot_path.empty()) run_gnuplot(plot_commands(report, options.data_path, options.plot_path));
  return report.keeps_all_limits() && report.agrees_with_model() ? 0 : limit_broken;
}

int execute(int argc, char** argv, bool& running) {
  CLI::App app(
      "Computes the Allan deviation of a sensor at rest, from any protocol and port or from a NumPy file, and the\n"
      "noise terms N, B, K, Q, R (IEEE Std 952) that explain it.",
      "imu-allan");
  app.set_version_flag("--version", "imu-allan " IMUD_VERSION);
  Options options;
  add_recorded_input(app, options.input);
  add(app, "--deviation", options.kind, "NAME",
      "allan, overlapping (default), modified, hadamard, overlapping-hadamard or total");
  add(app, "--per-decade", options.per_decade, "N", "averaging times per decade; default: octaves")
      ->check(number_check(1, 1000));
  add(app, "--confidence", options.confidence, "P", "probability of the bounds; default: 0.68")
      ->check(number_check(0.01, 0.9999));
  add(app, "--fit-from", options.fit_from_s, "SECONDS",
      "shortest averaging time of the fit, beyond the sensor's filter")
      ->check(number_check(0, 1e9));
  add(app, "--fit-to", options.fit_to_s, "SECONDS", "longest averaging time of the fit")->check(number_check(0, 1e9));
  add(app, "--require", options.limits, "LIMIT",
      "exits with 3 if a term breaks this limit, such as gyro.N<4.5e-5 (SI) or\n"
      "gyro_x.angle_random_walk_deg_per_rt_hr<0.15; several with commas; may be repeated")
      ->allow_extra_args(false);
  add(app, "--against", options.against, "PRESET|FILE.toml",
      "compares each term with that of a preset of imud, or of a TOML file like one; exits with 3 if one\n"
      "differs; the plot has its curve");
  add(app, "--tolerance", options.tolerance_percent, "PERCENT",
      "difference of a term that --against allows, beside its confidence interval; default: 10")
      ->check(number_check(0, 99))
      ->needs("--against");
  OutputOptions outputs(app);
  outputs
      .add("--to-config", options.preset_path,
           "writes the terms as a model for imud, which reads it with model = \"FILE.toml\"")
      ->type_name("FILE.toml");
  outputs.add("--json", options.json_path, "writes the result as JSON; - is standard output");
  outputs.add("--data", options.data_path, "writes the deviations as CSV; - is standard output");
  outputs
      .add("--plot", options.plot_path,
           "draws them by gnuplot; the data stand beside the picture, as FILE.plot.csv, or at --data")
      ->type_name("FILE.svg|FILE.png");
  app.footer(
      fmt::format("\n{}\n{}\nExit codes: 0 done, 1 failed while running or the recording is no good, 2 the command "
                  "line is wrong or "
                  "the port cannot be opened, 3 a limit of --require is broken or --against differs.\n"
                  "Example: imu-allan stim300 serial:/dev/ttyUSB0 --for 3600 --against stim300 --plot stim300.svg",
                  known_protocols(), known_ports()));
  if (const auto exit_code = parse(app, argc, argv)) return *exit_code;

  return run_on(options.input, running, [&] { return analyse(options, outputs, running); });
}

}  // namespace
}  // namespace imud

int main(int argc, char** argv) { return imud::run_tool("imu-allan", imud::execute, argc, argv); }
