#include "tools/measurement_files.hpp"

#include <chrono>
#include <exception>
#include <stdexcept>

#include "tools/hdf5_writer.hpp"
#include "tools/npy_writer.hpp"
#include "tools/resolved_config.hpp"
#include "transports/host_clock.hpp"
#include "transports/output_path.hpp"
#include "transports/port.hpp"

namespace imud {

void MeasurementFiles::add_options(CLI::App& app, Options& options) {
  app.add_option("--npy", options.npy, "also writes a structured array, for numpy.load(FILE, mmap_mode=\"r\")")
      ->type_name("FILE");
  app.add_option("--hdf5", options.hdf5, "also writes HDF5: a dataset for each quantity")->type_name("FILE");
  app.add_option("--config", options.config, "imud's configuration, which becomes an attribute of the HDF5 file")
      ->type_name("FILE");
  app.add_option(
         "--truth", options.truth,
         "adds the truth at each sample, without errors: what `imud replay CONFIG CAPTURE` sends is decoded,\n"
         "or what a run has sent, from its RECORD alone")
      ->expected(1, 2)
      ->type_name("RECORD | CONFIG CAPTURE");
  app.add_option("--imu", options.imu, "name of the imu in --truth; default: the first with the protocol")
      ->type_name("NAME");
}

namespace {

void check(const MeasurementFiles::Options& options, const std::string& port) {
  if (!options.config.empty() && options.hdf5.empty())
    throw std::invalid_argument("--config: is for the attributes of --hdf5, which is not given");
  if (!options.truth.empty() && options.npy.empty() && options.hdf5.empty())
    throw std::invalid_argument("--truth: is for --npy and --hdf5, of which none is given");
  if (!options.truth.empty() && !options.config.empty())
    throw std::invalid_argument("--config: that of --truth becomes the attribute; omit it");
  if (options.truth.empty() && !options.imu.empty())
    throw std::invalid_argument("--imu: is for --truth, which is not given");
  if (options.truth.size() == 1 && record_transport_of(options.truth.front()) == nullptr)
    throw std::invalid_argument(options.truth.front() +
                                ": is no record of imud; --truth needs one, or a configuration and its capture");
  std::vector<std::string> inputs = options.truth;
  for (std::string& input : inputs) input = input.substr(0, input.find('?'));
  const std::string address = port.substr(port.find(':') + 1);
  inputs.insert(inputs.end(), {address.substr(0, address.find('?')), options.config});
  for (const std::string& path : {options.npy, options.hdf5}) {
    if (path.empty()) continue;
    if (is_standard_output(path)) throw std::invalid_argument(path + ": an array cannot go to a stream; give a file");
    for (const std::string& input : inputs)
      if (is_same_file(input, path)) throw std::invalid_argument(path + ": is the input; give another file");
  }
  if (!options.npy.empty() && (options.npy == options.hdf5 || is_same_file(options.npy, options.hdf5)))
    throw std::invalid_argument(options.npy + ": is given twice; give two files");
}

Hdf5Writer::Attributes attributes_of(const MeasurementFiles::Options& options, const Protocol& protocol,
                                     const std::string& port, const TruthBeside* truth) {
  Hdf5Writer::Attributes all;
  all.texts = {{"imud_version", IMUD_VERSION}, {"protocol", std::string(protocol.name)}, {"port", port}};
  if (options.config.empty() && truth == nullptr) return all;
  const ResolvedConfig config = truth == nullptr ? resolve_config(options.config) : truth->config();
  all.texts.emplace_back("config", config.toml);
  all.seed = config.seed;
  return all;
}

}  // namespace

MeasurementFiles::MeasurementFiles(const Options& options, const Protocol& protocol, const std::string& port)
    : absent_rates_(protocol.absent_rates) {
  check(options, port);
  if (!options.truth.empty())
    truth_ = std::make_unique<TruthBeside>(
        TruthBeside::Options{options.truth.front(), options.truth.back(), options.imu}, protocol);
  const bool with_truth = truth_ != nullptr;
  if (!options.npy.empty()) files_.push_back(std::make_unique<NpyWriter>(options.npy, with_truth));
  if (!options.hdf5.empty())
    files_.push_back(
        std::make_unique<Hdf5Writer>(options.hdf5, with_truth, attributes_of(options, protocol, port, truth_.get())));
}

void MeasurementFiles::write(const Measurement& measurement) {
  if (files_.empty()) return;
  MeasurementRow row(measurement, absent_rates_);
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
