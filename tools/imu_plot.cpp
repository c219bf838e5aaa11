// imu-plot: a run of imud in pictures: six channels over their truth, their errors, and the errors' spectra.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "core/units.hpp"
#include "emulator/ground/progress_line.hpp"
#include "emulator/plan/number_check.hpp"
#include "tools/gnuplot.hpp"
#include "tools/plot/emulated_run.hpp"
#include "tools/plot/run_errors.hpp"
#include "tools/plot/run_plot.hpp"
#include "tools/plot/solution_track.hpp"
#include "tools/program.hpp"
#include "tools/text_output.hpp"
#include "transports/file/files_in_use.hpp"

namespace imud {
namespace {

struct Options {
  EmulatedRun::Options run;
  std::string picture, solution_picture;
  std::uint64_t seeds = 16;
};

double root_mean_square(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

// Prints for each channel the rms of its error and of its sigma, and the share of the samples whose error is within
// one sigma of the mean error.
void print_table(const RunErrors& run) {
  for (const auto& channel : run.channels) {
    const double factor = channel.is_rate() ? 1 / units::degree : 1000 / units::standard_gravity;
    std::size_t within = 0;
    for (std::size_t i = 0; i < run.samples(); ++i)
      within += std::abs(channel.error[i] - channel.mean[i]) <= channel.sigma[i] ? 1U : 0U;
    fmt::print("{:<8} error rms {:.4g} {}, sigma {:.4g}, {:.0f} % of it within one sigma\n", channel.name(),
               factor * root_mean_square(channel.error), channel.is_rate() ? "deg/s" : "mg",
               factor * root_mean_square(channel.sigma),
               100 * static_cast<double>(within) / static_cast<double>(run.samples()));
  }
}

// Draws the solution of the unit's own filter in the run with the configured seed, and prints the sizes of its
// errors.
void plot_solution(const Options& options, EmulatedRun& run) {
  const SolutionTrack track = compare_solutions(run.solution(run.seed()), run.true_solution());
  const std::string data_path = data_path_beside(options.solution_picture);
  write_file(data_path, track_csv(track));
  run_gnuplot(track_plot_commands(track, data_path, options.solution_picture));
  for (const auto& channel : track.channels) {
    std::vector<double> errors;
    std::size_t within = 0;
    for (std::size_t i = 0; i < track.samples(); ++i) {
      if (std::isnan(channel.error[i])) continue;
      errors.push_back(channel.error[i]);
      within += std::abs(channel.error[i]) <= channel.sigma[i] ? 1U : 0U;
    }
    if (errors.empty()) continue;
    fmt::print("{:<14} error rms {:.4g} {}, {:.0f} % of it within the reported sigma\n", channel.error_name,
               root_mean_square(errors), channel.unit,
               100 * static_cast<double>(within) / static_cast<double>(errors.size()));
  }
}

void plot(const Options& options, bool& running) {
  check_plot(options.picture);
  if (!options.solution_picture.empty()) check_plot(options.solution_picture);
  const std::string samples_path = data_path_beside(options.picture);
  const std::string spectrum_path = samples_path.substr(0, samples_path.size() - 4) + "_spectrum.csv";
  FilesInUse files;
  for (const std::string& input : {options.run.config, options.run.capture}) files.add_input(input, "the input");
  std::vector<std::string> outputs = {options.picture, samples_path, spectrum_path};
  if (!options.solution_picture.empty()) {
    outputs.insert(outputs.end(), {options.solution_picture, data_path_beside(options.solution_picture)});
    check_data_path(outputs.back(), "time_s,");
  }
  for (const std::string& path : outputs)
    if (const std::string fault = files.claim(path, "the picture"); !fault.empty())
      throw std::invalid_argument(fault);
  check_data_path(samples_path, "time_s,");
  check_data_path(spectrum_path, "frequency_hz,");
  EmulatedRun run(options.run);
  if (!options.solution_picture.empty() && !run.has_solution())
    throw std::invalid_argument(
        "--solution: the imu has no solution of its own; give it one with [imu.navigation] solution = \"filter\"");
  running = true;
  ProgressLine progress;
  const std::uint64_t runs = options.seeds + 2;
  const StillRecording truth = run.truth();
  progress.show(1, runs, "runs");
  const StillRecording measured = run.sent(run.seed());
  const RunErrors errors = compare_runs(measured, truth, options.seeds, [&](std::uint64_t i) {
    progress.show(2 + i, runs, "runs");
    return run.sent(run.seed() + 1 + i);
  });
  progress.clear();
  write_file(samples_path, samples_csv(errors));
  write_file(spectrum_path, spectrum_csv(errors));
  run_gnuplot(run_plot_commands(errors, samples_path, spectrum_path, options.picture));
  fmt::print("{}: {} samples at {:.6g} Hz, and {} other seeds\n", run.name(), errors.samples(), errors.rate_hz,
             options.seeds);
  print_table(errors);
  if (!options.solution_picture.empty()) plot_solution(options, run);
}

int execute(int argc, char** argv, bool& running) {
  CLI::App app(
      "Runs imud on a captured truth, and draws what an imu sends: its channels over their truth, their errors with\n"
      "the envelope of the errors that other seeds have, and the errors' spectra.",
      "imu-plot");
  app.set_version_flag("--version", "imu-plot " IMUD_VERSION);
  Options options;
  add(app, "CONFIG", options.run.config, "", "configuration of imud, TOML")->required();
  add(app, "CAPTURE", options.run.capture, "", "truth, as for imud replay: X.pcap, X.pcap?port=N, or X.csv")
      ->required();
  add(app, "--plot", options.picture, "FILE.svg|FILE.png",
      "picture; the data stand beside it, as FILE.plot.csv and FILE.plot_spectrum.csv")
      ->required();
  add(app, "--solution", options.solution_picture, "FILE.svg|FILE.png",
      "another picture: the solution of the unit's own filter over the truth, its errors over the standard "
      "deviations\n"
      "that it reports, and the aids that it used and rejected; the data stand beside it");
  add(app, "--imu", options.run.imu, "NAME", "name of the imu; default: the first");
  add(app, "--set", options.run.overrides, "KEY=VALUE", "overrides a key of the configuration; may be repeated")
      ->allow_extra_args(false);
  add(app, "--seeds", options.seeds, "N", "further runs, with other seeds, for the envelope; default: 16")
      ->check(number_check(2, 1000));
  add(app, "--rate-hz", options.run.rate_hz, "HZ",
      "sample rate, in place of the rate by the samples' time or by the times of sending")
      ->check(number_check(1e-6, 1e9));
  app.add_flag("--filter-truth", options.run.is_truth_filtered,
               "the truth passes the sensor's own filters: the error is without their delay and attenuation");
  app.footer(
      "\nExit codes: 0 done, 1 failed while running, 2 the command line or the configuration is wrong.\n"
      "Example: imu-plot imu.toml flight.pcap --set 'imu.0.model=\"stim300\"' --plot flight.svg");
  if (const auto exit_code = parse(app, argc, argv)) return *exit_code;
  plot(options, running);
  return 0;
}

}  // namespace
}  // namespace imud

int main(int argc, char** argv) { return imud::run_tool("imu-plot", imud::execute, argc, argv); }
