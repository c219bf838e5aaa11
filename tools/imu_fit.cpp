// imu-fit: bias, scale factor, misalignment and sensitivities of a unit, from a recording on a table or a fixture.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <string>

#include "emulator/plan/number_check.hpp"
#include "tools/allan/model_terms.hpp"
#include "tools/allan/recorded_input.hpp"
#include "tools/fit/dwell_means.hpp"
#include "tools/fit/fit_report.hpp"
#include "tools/output_options.hpp"
#include "tools/program.hpp"
#include "tools/text_output.hpp"
#include "transports/file/output_path.hpp"

namespace imud {
namespace {

struct Options {
  RecordedInput input{.source = {.program = "imu-fit"}, .recording = {}, .columns = {}};
  std::string plan, noise;
  double scale_ppm = 0, angle_mrad = 0;
  std::string json_path, preset_path;
};

std::vector<Dwell> dwells_of(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::invalid_argument(fmt::format("{}: cannot read it: {}", path, std::strerror(errno)));
  try {
    return read_dwells(file, path);
  } catch (const std::runtime_error& error) {
    throw std::invalid_argument(error.what());
  }
}

std::optional<FitReport::Sensor> fitted(const StillRecording& recording, const std::vector<Dwell>& dwells,
                                        const Options& options, const ModelTerms& noise, double reference_c,
                                        bool is_rate) {
  const std::vector<DwellMean> means = dwell_means(recording, dwells, is_rate, reference_c);
  if (means.empty()) return std::nullopt;
  std::array<AllanTerms, 3> terms;
  for (std::size_t axis = 0; axis < terms.size(); ++axis) terms[axis] = noise.of[axis + (is_rate ? 0 : 3)];
  const FixtureErrors fixture = {.scale = 1e-6 * options.scale_ppm, .angle_rad = 1e-3 * options.angle_mrad};
  return FitReport::Sensor{means.size(), fit_sensor(means, terms, fixture, is_rate)};
}

int fit(const Options& options, const OutputOptions& outputs, bool& running) {
  const std::vector<Dwell> dwells = dwells_of(options.plan);
  ModelTerms noise;
  if (!options.noise.empty()) noise = model_terms(options.noise, 0);
  if (!options.preset_path.empty() && !options.preset_path.ends_with(".toml"))
    throw std::invalid_argument(fmt::format("--to-config {}: right would be FILE.toml", options.preset_path));
  FilesInUse files;
  add_input_files(options.input.source, files);
  add_model_file(options.noise, "--noise", files);
  files.add_input(options.plan, "the plan");
  if (const std::string fault = outputs.claim(files); !fault.empty()) throw std::invalid_argument(fault);

  std::string ended_by;
  const StillRecording recording = record(options.input, running, ended_by);
  running = true;
  const double reference_c = reference_temperature(dwells);
  const FitReport report = {.protocol = options.input.source.protocol,
                            .port = options.input.source.port,
                            .plan = options.plan,
                            .samples = recording.samples(),
                            .dwells = dwells.size(),
                            .rate_hz = recording.rate_hz,
                            .reference_c = reference_c,
                            .gyro = fitted(recording, dwells, options, noise, reference_c, true),
                            .accelerometer = fitted(recording, dwells, options, noise, reference_c, false)};
  if (!report.gyro && !report.accelerometer)
    throw std::runtime_error(
        "nothing to fit: the recording has no three gyros or accelerometers of which a dwell states the input");
  if (!is_standard_output(options.json_path)) fmt::print("{}", report.text());
  if (!options.json_path.empty()) write_file(options.json_path, report.json());
  if (!options.preset_path.empty()) write_file(options.preset_path, report.preset());
  return 0;
}

int execute(int argc, char** argv, bool& running) {
  CLI::App app(
      "Fits bias, scale factor, misalignment, acceleration sensitivity and their change with temperature to a "
      "recording\n"
      "on a rate table, a centrifuge or in the positions of a tumble, whose dwells a table of comma-separated values "
      "lists.",
      "imu-fit");
  app.set_version_flag("--version", "imu-fit " IMUD_VERSION);
  Options options;
  add_recorded_input(app, options.input);
  add(app, "--dwells", options.plan, "FILE.csv",
      "begin_s, end_s, rate_x_deg_per_s, force_x_g, temperature_c, ...: what was true in each dwell, in the "
      "fixture's axes")
      ->required();
  add(app, "--noise", options.noise, "PRESET|FILE.toml",
      "the sensor's bias instability and random walk, for the standard errors; without it they have white noise "
      "alone");
  add(app, "--table-scale-ppm", options.scale_ppm, "PPM",
      "standard deviation of the inputs' common scale; default: 0")
      ->check(number_check(0, 1e6));
  add(app, "--table-angle-mrad", options.angle_mrad, "MRAD",
      "standard deviation of the attitude in each dwell; default: 0")
      ->check(number_check(0, 1e3));
  OutputOptions outputs(app);
  outputs
      .add("--to-config", options.preset_path,
           "writes the errors as a model for imud, which reads it with model = \"FILE.toml\"")
      ->type_name("FILE.toml");
  outputs.add("--json", options.json_path, "writes the result as JSON; - is standard output");
  app.footer(fmt::format(
      "\n{}\n{}\nExit codes: 0 done, 1 failed while running or the recording is no good, 2 the command line or the "
      "table of dwells is wrong or the port cannot be opened.\n"
      "Example: imu-fit stim300 file:turns.bin --dwells turns.csv --noise stim300 --to-config mine.toml",
      known_protocols(), known_ports()));
  if (const auto exit_code = parse(app, argc, argv)) return *exit_code;
  return run_on(options.input, running, [&] { return fit(options, outputs, running); });
}

}  // namespace
}  // namespace imud

int main(int argc, char** argv) { return imud::run_tool("imu-fit", imud::execute, argc, argv); }
