#include "tools/arrays/measurement_files.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <chrono>
#include <exception>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "emulator/config/load_config.hpp"
#include "emulator/plan/number_check.hpp"
#include "tools/program.hpp"
#include "transports/file/output_path.hpp"
#include "transports/host_clock.hpp"
#include "transports/port.hpp"
#include "transports/port_spec.hpp"

namespace imud {

namespace {

std::string option_of(const RowFormat& format) { return fmt::format("--{}", format.name); }

bool is_any(const RowFormat&) { return true; }
bool keeps_attributes(const RowFormat& format) { return format.keeps_attributes; }
bool needs_time(const RowFormat& format) { return format.needs_time; }

// Returns the options of these formats: "--npy, --hdf5 and --mat".
std::string list_options(bool (*is_one)(const RowFormat&)) {
  std::vector<std::string> names;
  for (const RowFormat* format : row_formats())
    if (is_one(*format)) names.push_back(option_of(*format));
  const std::string last = names.back();
  names.pop_back();
  return names.empty() ? last : fmt::format("{} and {}", fmt::join(names, ", "), last);
}

bool is_any_given(const std::vector<std::string>& paths, bool (*is_one)(const RowFormat&)) {
  for (std::size_t i = 0; i < paths.size(); ++i)
    if (!paths[i].empty() && is_one(*row_formats()[i])) return true;
  return false;
}

}  // namespace

void MeasurementFiles::add_options(CLI::App& app, Options& options) {
  options.paths.resize(row_formats().size());
  for (std::size_t i = 0; i < options.paths.size(); ++i)
    add(app, option_of(*row_formats()[i]), options.paths[i], "FILE", std::string(row_formats()[i]->help));
  add(app, "--config", options.config, "FILE",
      fmt::format("imud's configuration, which becomes an attribute of {}", list_options(keeps_attributes)));
  add(app, "--rate-hz", options.rate_hz, "HZ",
      fmt::format("sample rate of measurements without time, for {} and --find-check", list_options(needs_time)))
      ->check(number_check(1e-6, 1e9));
  add(app, "--truth", options.truth, "RECORD | CONFIG CAPTURE",
      "adds the truth at each sample, without errors: what `imud replay CONFIG CAPTURE` sends is decoded,\n"
      "or what a run has sent, from its RECORD alone")
      ->expected(1, 2);
  add(app, "--imu", options.imu, "NAME",
      "name of the imu in --truth or --like; default: the first with the protocol");
}

namespace {

void check(const MeasurementFiles::Options& options, FilesInUse& in_use) {
  if (!options.config.empty() && !is_any_given(options.paths, keeps_attributes))
    throw std::invalid_argument(
        fmt::format("--config: is for the attributes of {}, of which none is given", list_options(keeps_attributes)));
  if (options.rate_hz && !is_any_given(options.paths, needs_time))
    throw std::invalid_argument(
        fmt::format("--rate-hz: is for {}, of which none is given", list_options(needs_time)));
  if (!options.truth.empty() && !is_any_given(options.paths, is_any))
    throw std::invalid_argument(fmt::format("--truth: is for {}, of which none is given", list_options(is_any)));
  if (!options.truth.empty() && !options.config.empty())
    throw std::invalid_argument("--config: that of --truth becomes the attribute; omit it");
  if (options.truth.size() == 1 && record_transport_of(options.truth.front()) == nullptr)
    throw std::invalid_argument(options.truth.front() +
                                ": is no record of imud; --truth needs one, or a configuration and its capture");
  for (const std::string& input : options.truth) in_use.add_input(input, "the input");
  in_use.add(options.config, "the input");
  for (std::size_t i = 0; i < options.paths.size(); ++i) {
    const std::string& path = options.paths[i];
    if (is_standard_output(path)) throw std::invalid_argument(path + ": an array cannot go to a stream; give a file");
    const std::string fault = in_use.claim(path, fmt::format("the file of {}", option_of(*row_formats()[i])));
    if (!fault.empty()) throw std::invalid_argument(fault);
  }
}

// Returns the name of the imu as far as the command line states it, otherwise "imu".
std::string imu_name(const MeasurementFiles::Options& options, const std::string& port) {
  if (!options.imu.empty()) return options.imu;
  return PortSpec::parse(port).text("interface").value_or("imu");
}

// Returns the text with U+FFFD in place of bytes that are no valid UTF-8, which a path may contain.
std::string valid_utf8(const std::string& text) {
  using nlohmann::json;
  return json::parse(json(text).dump(-1, ' ', false, json::error_handler_t::replace)).get<std::string>();
}

RowAttributes attributes_of(const MeasurementFiles::Options& options, const Protocol& protocol,
                            const std::string& port, const TruthBeside* truth) {
  RowAttributes all;
  all.texts = {{"imud_version", IMUD_VERSION}, {"protocol", std::string(protocol.name)}, {"port", valid_utf8(port)}};
  all.imu = valid_utf8(imu_name(options, port));
  if (options.config.empty() && truth == nullptr) return all;
  const Config config = truth == nullptr ? load_config(options.config) : truth->config();
  all.texts.emplace_back("config", valid_utf8(config.resolved()));
  all.seed = config.seed;
  return all;
}

}  // namespace

MeasurementFiles::MeasurementFiles(const Options& options, const Protocol& protocol, const std::string& port,
                                   FilesInUse& in_use) {
  check(options, in_use);
  if (!options.truth.empty())
    truth_ = std::make_unique<TruthBeside>(
        TruthBeside::Options{options.truth.front(), options.truth.back(), options.imu}, protocol);
  const bool with_truth = truth_ != nullptr;
  RowAttributes attributes;
  if (is_any_given(options.paths, keeps_attributes))
    attributes = attributes_of(options, protocol, port, truth_.get());
  attributes.rate_hz = options.rate_hz;
  for (std::size_t i = 0; i < options.paths.size(); ++i)
    if (!options.paths[i].empty()) files_.push_back(row_formats()[i]->make(options.paths[i], with_truth, attributes));
}

void MeasurementFiles::write(const Measurement& measurement) {
  if (files_.empty()) return;
  MeasurementRow row(measurement);
  if (truth_) row.truth = truth_->at(row);
  for (const auto& file : files_) file->write(row);
}

void MeasurementFiles::flush() {
  if (files_.empty() || host_now() - flushed_ < std::chrono::seconds(1)) return;
  flushed_ = host_now();
  for (const auto& file : files_) file->flush();
}

std::string MeasurementFiles::finish() {
  std::exception_ptr failure;
  for (const auto& file : files_) try {
      file->finish();
    } catch (...) {
      if (!failure) failure = std::current_exception();
    }
  if (failure) std::rethrow_exception(failure);
  return truth_ ? truth_->finish() : std::string();
}

}  // namespace imud
