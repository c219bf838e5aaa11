// imu-decode: decodes any protocol from any port, and reports the quality of the stream.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "emulator/config/load_config.hpp"
#include "emulator/ground/progress_line.hpp"
#include "emulator/plan/number_check.hpp"
#include "protocols/measurements/measurement_csv.hpp"
#include "protocols/protocol.hpp"
#include "tools/arrays/measurement_files.hpp"
#include "tools/field_csv.hpp"
#include "tools/find/find_check.hpp"
#include "tools/input/imu_choice.hpp"
#include "tools/input/measurement_input.hpp"
#include "tools/program.hpp"
#include "tools/setting_texts.hpp"
#include "tools/stop_signal.hpp"
#include "tools/stream_report.hpp"
#include "tools/stream_statistics.hpp"
#include "tools/text_output.hpp"
#include "transports/file/files_in_use.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

constexpr int limit_broken = 3;

struct Options {
  DecodeOptions input{.program = "imu-decode"};
  std::string like;  // a configuration; empty: none
  std::vector<std::string> limits;
  std::string json_path;
  MeasurementFiles::Options files;
  std::optional<int> ready_fd;
  bool quiet = false;
  bool fields = false;
  bool inclination = false;
};

// Writes and counts measurements, or frames where their fields are printed, up to the number wanted.
class Recorder final : public MeasurementReceiver, public FrameReceiver {
 public:
  // `fields`: nullptr if the measurements are printed.
  Recorder(const Protocol& protocol, const Options& options, TextOutput& csv, FieldCsv* fields,
           MeasurementFiles& files)
      : statistics_(protocol),
        csv_(csv),
        fields_(fields),
        files_(files),
        print_(!options.quiet && fields == nullptr),
        with_inclination_(options.inclination),
        wanted_(options.input.count) {
    if (print_) csv_.write(with_inclination_ ? measurement_csv_header_with_inclination : measurement_csv_header);
  }

  void on_frame(const DecodedFrame& frame) override {
    if (fields_ != nullptr && !is_full()) fields_->write(frame);
  }

  void on_measurement(const Measurement& measurement) override {
    if (is_full()) return;
    statistics_.add(measurement, arrival_);
    files_.write(measurement);
    if (!print_) return;
    std::array<char, measurement_csv_row_max> row;
    csv_.write({row.data(), write_measurement_csv(measurement, row, with_inclination_)});
  }

  void set_arrival(std::optional<HostTime> arrival) override { arrival_ = arrival; }
  bool is_full() const override { return decoded() >= wanted_; }
  bool is_open() const override { return csv_.is_open(); }
  void flush() override {
    csv_.flush();
    files_.flush();
  }
  void finish() {
    csv_.flush();
    statistics_.finish();
  }
  const StreamStatistics& statistics() const { return statistics_; }
  std::uint64_t decoded() const { return fields_ != nullptr ? fields_->rows() : statistics_.samples(); }

 private:
  StreamStatistics statistics_;
  TextOutput& csv_;
  FieldCsv* const fields_;
  MeasurementFiles& files_;
  const bool print_, with_inclination_;
  const std::uint64_t wanted_;
  std::optional<HostTime> arrival_;
};

// Returns the imu of --like, and enters the files that the configuration names in `in_use`. Throws ConfigError, and
// std::invalid_argument if there is no imu of the wanted name.
ImuConfig imu_like(const std::string& file, const std::string& name, FilesInUse& in_use) {
  const Config config = load_config(file, {}, "-");  // any capture: the truth is not read
  for (const std::string& warning : config.warnings) fmt::print(stderr, "imu-decode: {}\n", warning);
  in_use = config.files;
  return config.imus[imu_number(file, config.imus, name)];
}

// `like`: the settings of the imu of --like; nullopt: the initial ones. `in_use`: the files of its configuration.
int decode(const Options& options, const std::optional<Settings>& like, FilesInUse in_use, bool& running) {
  const Protocol& protocol = protocol_for(options.input);
  std::vector<Requirement> required;
  for (const std::string& limits : options.limits)
    for (Requirement& limit : parse_requirements(limits)) required.push_back(std::move(limit));
  for (const Requirement& limit : required)
    StreamReport{protocol, {}, StreamStatistics(protocol), {}, {}, {}, {}, {}}.seen(limit);
  const Settings settings =
      settings_from(like.value_or(Settings(protocol.settings)), protocol.settings, options.input.settings);
  const auto decoder = protocol.make_decoder(settings);
  auto* const field_decoder = dynamic_cast<FrameStreamDecoder*>(decoder.get());
  if (options.fields && field_decoder == nullptr)
    throw std::invalid_argument(fmt::format("--fields is for protocol frame: {} has no description", protocol.name));
  const auto port = open_port(options.input.port, Role::listener);
  if (options.ready_fd) {
    const FileDescriptor ready(*options.ready_fd);
    if (::write(ready.get(), "ready\n", 6) < 0)
      throw std::runtime_error(fmt::format("--ready-fd {}: {}", *options.ready_fd, std::strerror(errno)));
  }
  if (const std::string chosen = port->chosen_port(); !chosen.empty())
    fmt::print(stderr, "imu-decode: receives at {}\n", chosen);
  TextOutput csv("-");
  std::optional<FieldCsv> fields;
  if (options.fields) fields.emplace(*field_decoder, csv);
  add_input_files(options.input, in_use);
  if (const std::string fault = in_use.claim(options.json_path, "the file of --json"); !fault.empty())
    throw std::runtime_error(fault);
  MeasurementFiles files(options.files, protocol, options.input.port, in_use);
  std::optional<TextOutput> json;
  if (!options.json_path.empty()) json.emplace(options.json_path);

  running = true;
  Recorder recorder(protocol, options, csv, fields ? &*fields : nullptr, files);
  if (fields) field_decoder->pass_frames_to(&recorder);
  const std::string_view ended_by = receive_all(*port, *decoder, recorder, options.input);
  const DecodeErrors errors = decoder->errors();
  recorder.finish();

  const StreamReport report{protocol,
                            options.input.port,
                            recorder.statistics(),
                            errors,
                            port->counters(),
                            std::string(port->end_warning()),
                            std::string(ended_by),
                            std::move(required)};
  std::fputs(report.text().c_str(), stderr);
  if (fields) fmt::print(stderr, "frames     {}\n", fields->counts_text());
  if (json) {
    json->write(report.json());
    json->flush();
    if (!json->is_open()) throw std::runtime_error(options.json_path + ": " + std::strerror(json->error()));
  }
  if (const std::string missing = files.finish(); !missing.empty()) fmt::print(stderr, "truth      {}\n", missing);
  if (!csv.is_open() && csv.error() != EPIPE)
    throw std::runtime_error(std::string("standard output: ") + std::strerror(csv.error()));
  if (recorder.decoded() == 0) {
    fmt::print(stderr, "imu-decode: no {} was decoded; does {} use this protocol ({})?\n",
               fields ? "frame" : "sample", options.input.port, protocol.name);
    return failed;
  }
  return report.keeps_all_limits() ? 0 : limit_broken;
}

// Throws if an option is given that has no effect beside --find-check, which decodes nothing.
void require_only_find_options(const CLI::App& app) {
  const std::vector<std::string> find_options = {"--find-check", "--turned", "--for", "--rate-hz"};
  for (const CLI::Option* option : app.get_options())
    if (option->count() > 0 && std::ranges::find(find_options, option->get_name()) == find_options.end())
      throw CLI::ExcludesError("--find-check", option->get_name());
}

int execute(int argc, char** argv, bool& running) {
  CLI::App app(
      "Decodes any protocol from any port: prints measurement CSV, and at the end rate, jitter, gaps and\n"
      "checksum failures on standard error. The columns are in SI units, the temperature in deg C; what else a\n"
      "frame carries, such as attitude, magnetic field and position, is not printed.",
      "imu-decode");
  app.set_version_flag("--version", "imu-decode " IMUD_VERSION);
  Options options;
  FindOptions find;
  add(app, "PROTOCOL", options.input.protocol, "", "protocol of the device, see below");
  add_input_options(app, options.input);
  add_find_options(app, find);
  // CLI11 knows no choice between positional arguments and an option.
  app.get_option("PORT")->required(false);
  app.parse_complete_callback([&] {
    if (!find.capture.empty()) return require_only_find_options(app);
    if (options.fields && options.quiet) throw CLI::ExcludesError("--fields", "--quiet");
    if (options.inclination && options.quiet) throw CLI::ExcludesError("--inclination", "--quiet");
    if (options.inclination && options.fields) throw CLI::ExcludesError("--inclination", "--fields");
    if (!options.like.empty()) {
      if (!options.input.port.empty()) throw CLI::ExcludesError("--like", "PROTOCOL");
      std::swap(options.input.protocol, options.input.port);
    } else if (options.input.protocol.empty()) {
      throw CLI::RequiredError("PROTOCOL");
    }
    if (options.input.port.empty()) throw CLI::RequiredError("PORT");
    if (!options.quiet && ::isatty(STDOUT_FILENO) == 1) ProgressLine::hide_all();
  });
  add(app, "--like", options.like, "CONFIG",
      "in place of PROTOCOL: decodes what a unit sends that is set up like the imu of this configuration, the first\n"
      "one or --imu")
      ->excludes("--find-check");
  add(app, "--require", options.limits, "LIMIT",
      "exits with 3 if a figure of the report breaks this limit, such as gaps=0 or jitter_p99_us<500;\n"
      "several with commas; may be repeated")
      ->allow_extra_args(false);
  add(app, "--ready-fd", options.ready_fd, "N",
      "writes a line to this file descriptor, and closes it, when the port is open")
      ->check(number_check(1, 1023));
  app.add_flag("--quiet", options.quiet, "no CSV, only the report");
  app.add_flag("--inclination", options.inclination, "three more columns of the CSV: the inclination, m/s^2");
  app.add_flag(
      "--fields", options.fields,
      "protocol frame: in place of measurements, CSV of all that each frame carries, by the names and in the\n"
      "units of the description; --count is of frames then");
  add(app, "--json", options.json_path, "FILE", "also writes the report as JSON; - is standard output");
  MeasurementFiles::add_options(app, options.files);
  app.footer(fmt::format(
      "\n{}\n{}\nExit codes: 0 done, 1 failed while running or no sample decoded, 2 the command line is wrong or "
      "the port cannot be opened, 3 a limit of --require is broken.\n"
      "Example: imu-decode native pty:imu1 --for 60 > imu1.csv\n"
      "         imu-decode --like imu.toml recording.bin --quiet\n"
      "         imu-decode --find-check capture.bin --rate-hz 100 > mine.toml",
      known_protocols(), known_ports()));
  if (const auto exit_code = parse(app, argc, argv)) return *exit_code;

  catch_stop_signals();
  if (!find.capture.empty()) return find_check(find, options.input.for_s, options.files.rate_hz.value_or(0), running);
  if (!options.files.imu.empty() && options.files.truth.empty() && options.like.empty())
    throw std::invalid_argument("--imu: is for --truth and --like, of which none is given");
  std::optional<Settings> like;
  FilesInUse in_use;
  if (!options.like.empty()) {
    const ImuConfig imu = imu_like(options.like, options.files.imu, in_use);
    options.input.protocol = imu.protocol->name;
    like = imu.settings;
    fmt::print(stderr, "imu-decode: like {} of {}: {} at {:g} Hz\n", imu.name, options.like, imu.protocol->name,
               imu.model.rate_hz);
  }
  options.input.resolve_port();
  return decode(options, like, std::move(in_use), running);
}

}  // namespace
}  // namespace imud

int main(int argc, char** argv) { return imud::run_tool("imu-decode", imud::execute, argc, argv); }
