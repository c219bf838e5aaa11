#include "tools/plot/emulated_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <span>
#include <stdexcept>
#include <utility>

namespace imud {
namespace {

// Decodes the frames that a device sends. They arrive at the device's time of sending.
class DecodedPort final : public NoPort {
 public:
  DecodedPort(const ImuConfig& imu, StillRecorder& recorder)
      : decoder_(imu.protocol->make_decoder(imu.settings)), recorder_(recorder) {}

  void send(std::span<const Frame> frames) noexcept override {
    NoPort::send(frames);
    recorder_.set_arrival(HostTime{time_.ns});
    for (const Frame& frame : frames) decoder_->feed(frame, recorder_);
  }
  void commit() override { decoder_->finish(recorder_); }

 private:
  const std::unique_ptr<Decoder> decoder_;
  StillRecorder& recorder_;
};

}  // namespace

EmulatedRun::EmulatedRun(Options options)
    : options_(std::move(options)),
      replay_(options_.config, options_.overrides, options_.capture),
      config_(replay_.config()) {
  std::string names;
  for (const ImuConfig& imu : config_.imus) names += fmt::format("{}{}", names.empty() ? "" : ", ", imu.name);
  if (!options_.imu.empty()) std::erase_if(config_.imus, [&](const auto& imu) { return imu.name != options_.imu; });
  if (config_.imus.empty())
    throw std::invalid_argument(fmt::format("--imu {}: right would be one of {}", options_.imu, names));
  config_.imus.resize(1);
  ImuConfig& imu = config_.imus.front();
  imu.second_port.clear();
  imu.also.clear();
  imu.sync = {};
  config_.expectations.clear();
}

StillRecording EmulatedRun::sent(std::uint64_t seed) {
  Config config = config_;
  config.seed = seed;
  return record(config);
}

StillRecording EmulatedRun::truth() {
  Config config = config_;
  config.faults.clear();
  ImuConfig& imu = config.imus.front();
  imu = ideal(imu);
  if (options_.is_truth_filtered) {
    const ImuConfig& sensor = config_.imus.front();
    imu.device_filters = sensor.device_filters;
    imu.model.internal_samples = sensor.model.internal_samples;
    imu.model.gyro.filter = sensor.model.gyro.filter;
    imu.model.accelerometer.filter = sensor.model.accelerometer.filter;
    imu.model.magnetometer.filter = sensor.model.magnetometer.filter;
    if (imu.model.inclinometer) imu.model.inclinometer->filter = sensor.model.inclinometer->filter;
  }
  return record(config);
}

std::vector<SolutionRow> EmulatedRun::solution(std::uint64_t seed) {
  Config config = config_;
  config.seed = seed;
  return solutions(config);
}

std::vector<SolutionRow> EmulatedRun::true_solution() {
  Config config = config_;
  config.faults.clear();
  config.imus.front() = ideal(config.imus.front());
  return solutions(config);
}

std::vector<SolutionRow> EmulatedRun::solutions(const Config& config) {
  Config with_rows = config;
  with_rows.imus.front() = with_solution_rows(config.imus.front());
  // The rows are not bytes of the unit; therefore faults of the unit's bytes do not act on the rows.
  std::erase_if(with_rows.faults, [](const FaultConfig& fault) {
    return fault.kind->seam != FaultSeam::truth && fault.kind->seam != FaultSeam::sensor;
  });
  std::vector<SolutionRow> rows;
  replay_.run(with_rows,
              [&](const PortUse&) { return solution_port([&](const SolutionRow& row) { rows.push_back(row); }); });
  return rows;
}

StillRecording EmulatedRun::record(const Config& config) {
  const ImuConfig& imu = config.imus.front();
  RecordingOptions options;
  options.rate_hz = options_.rate_hz;
  options.largest_missing = 100;
  StillRecorder recorder(*imu.protocol, options, DecodeOptions{}.count);
  const std::vector<std::string> remarks =
      replay_.run(config, [&](const PortUse&) { return std::make_unique<DecodedPort>(imu, recorder); });
  if (!std::exchange(has_run_, true)) {
    for (const std::string& warning : config.warnings) fmt::print(stderr, "imu-plot: {}\n", warning);
    for (const std::string& remark : remarks) fmt::print(stderr, "imu-plot: {}\n", remark);
  }
  return recorder.finish();
}

}  // namespace imud
