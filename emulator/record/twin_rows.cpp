#include "emulator/record/twin_rows.hpp"

#include <algorithm>
#include <array>
#include <deque>
#include <limits>
#include <utility>

#include "core/sample.hpp"
#include "emulator/plan/fault.hpp"

namespace imud {

namespace {

TrueRow row_of(const Sample& sample, const Increments& increments) {
  const auto values = [](const Vector3& v) { return std::array{v[0], v[1], v[2]}; };
  return {sample.time.ns,
          {values(sample.rate), values(sample.specific_force), values(increments.delta_angle),
           values(increments.delta_velocity)}};
}

// Takes the truth at each measurement of an imu, from its twin without errors.
class TruthRows {
 public:
  // A sample of the twin will come after the measurements that carry it, because its truth has not come.
  void await_truth() noexcept { ++taken_; }
  // The next sample of the twin. If it was not awaited, it comes before the imu's frames that carry it.
  void on_truth(const Measurement& truth) {
    taken_ = std::max(taken_, ++received_);
    Sample& sample = waiting_.emplace_back(truth.sample);
    // The truth of this sample has never come.
    if ((sample.status & status::truth_extrapolated) != 0)
      sample.rate = sample.specific_force = sample.delta_angle = sample.delta_velocity = unknown;
    if (keeps_samples) {
      Increments own;
      own.add(sample);
      samples.push_back(row_of(sample, own));
    }
    complete();
  }
  // The number of samples up to the one whose frames are sent now.
  std::int64_t taken() const noexcept { return taken_; }
  // A measurement whose first frame was sent when taken() was `number`.
  void on_measurement(const Measurement& measurement, std::int64_t number) {
    measured_.push_back({number, carries_increments(measurement.fields)});
    complete();
  }

  bool keeps_samples = false;
  std::vector<TrueRow> rows, samples;

 private:
  struct Measured {
    std::int64_t number;
    bool has_increments;
  };

  // Makes the rows of the measurements whose twin has come.
  void complete() {
    for (; !measured_.empty() && measured_.front().number <= received_; measured_.pop_front()) {
      for (; summed_ < measured_.front().number; ++summed_) {
        newest_ = waiting_.front();
        waiting_.pop_front();
        increments_.add(newest_);
      }
      add_row(measured_.front().has_increments);
    }
  }
  void add_row(bool carries) {
    const bool is_first = carries && !has_increments_;
    has_increments_ |= carries;
    // The product may begin its sums at any sample before the first that it sends.
    const bool is_begun = rows.empty() ? increments_.samples <= 1 : !is_first;
    if (is_first)
      for (TrueRow& row : rows) row = without_increments(row);
    rows.push_back(row_of(newest_, increments_));
    if (!is_begun || carries != has_increments_) rows.back() = without_increments(rows.back());
    if (carries || !has_increments_) increments_ = {};
  }
  static TrueRow without_increments(TrueRow row) noexcept {
    row.values.dtheta = row.values.dvel = TrueValues().dtheta;
    return row;
  }

  inline static const Vector3 unknown = Vector3::Constant(std::numeric_limits<double>::quiet_NaN());
  std::int64_t taken_ = 0, received_ = 0, summed_ = 0;  // samples of the twin
  std::deque<Sample> waiting_;                          // the received ones that are not summed
  std::deque<Measured> measured_;                       // measurements that wait
  Sample newest_;
  Increments increments_;
  bool has_increments_ = false;  // a measurement has carried increments
};

// Runs imus with their twins; calls on_truth(imu, measurement), on_measurement(imu, measurement, number), where
// `number` is taken(imu) at the first frame of the measurement, and, if it is given, awaits_truth(imu).
template <class OnTruth, class Taken, class OnMeasurement>
std::string run_with_twins(Config config, const TwinRun& run, const OnTruth& on_truth, const Taken& taken,
                           const OnMeasurement& on_measurement,
                           const std::function<void(std::size_t imu)>& awaits_truth = nullptr) {
  const std::vector<ImuConfig> imus = std::exchange(config.imus, {});
  for (std::size_t i = 0; i < imus.size(); ++i) {
    // The twin precedes its imu, so that its sample is sent before the imu's sample, but after the frames that the
    // imu's deadlines cause.
    config.imus.push_back(without_errors(imus[i]));
    config.imus.push_back(imus[i]);
    for (std::size_t k = 2 * i; k < config.imus.size(); ++k) config.imus[k].also.clear();
  }
  const auto ports = [&](const PortUse& use) -> std::unique_ptr<Port> {
    if (use.of != PortUse::Of::line || use.number > 0) return std::make_unique<NoPort>();
    const std::size_t i = use.imu / 2;
    if (use.imu % 2 == 0)
      return decoding_port(config.imus[use.imu], [&on_truth, i](const Measurement& truth) { on_truth(i, truth); });
    return decoding_port(
        config.imus[use.imu],
        [&on_measurement, i](const Measurement& one, std::int64_t number) { on_measurement(i, one, number); },
        [&taken, i]() -> std::int64_t { return taken(i); });
  };
  if (!awaits_truth) return run(config, ports, nullptr);
  return run(config, ports, [&](std::size_t number) { awaits_truth(number / 2); });
}

Config without_faults(Config config) {
  config.faults.clear();
  config.expectations.clear();
  config.control.faults = false;
  return config;
}

}  // namespace

bool changes_rows(const FaultConfig& fault) { return fault.kind->seam != FaultSeam::sensor; }

RunTruth truth_of_run(const Config& config, const TwinRun& run,
                      const std::function<bool(std::size_t imu)>& keeps_samples) {
  std::vector<TruthRows> rows(config.imus.size());
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i].keeps_samples = keeps_samples(i);
  RunTruth truth;
  truth.cause = run_with_twins(
      without_faults(config), run, [&](std::size_t i, const Measurement& one) { rows[i].on_truth(one); },
      [&](std::size_t i) { return rows[i].taken(); },
      [&](std::size_t i, const Measurement& one, std::int64_t number) { rows[i].on_measurement(one, number); },
      [&](std::size_t i) { rows[i].await_truth(); });
  for (TruthRows& of_imu : rows) truth.imus.push_back({std::move(of_imu.rows), std::move(of_imu.samples)});
  return truth;
}

std::vector<std::uint64_t> count_measurements(const Config& config, const TwinRun& run) {
  std::vector<std::uint64_t> counts(config.imus.size());
  run_with_twins(
      config, run, [](std::size_t, const Measurement&) {}, [](std::size_t) { return 0; },
      [&](std::size_t i, const Measurement&, std::int64_t) { ++counts[i]; });
  return counts;
}

std::vector<std::vector<MadeRow>> made_rows(const Config& config, const TwinRun& run) {
  Config only_made = config;
  only_made.expectations.clear();
  only_made.control.frame_faults = false;
  for (FaultConfig& fault : only_made.faults)
    if (fault.kind->acts_on_frames)
      fault.imus.clear();  // the fault stays, so that the other faults keep their numbers
  std::vector<std::vector<MadeRow>> rows(config.imus.size());
  std::vector<std::int64_t> samples(config.imus.size());
  run_with_twins(
      only_made, run, [&](std::size_t i, const Measurement&) { ++samples[i]; },
      [&](std::size_t i) { return samples[i]; },
      [&](std::size_t i, const Measurement& measurement, std::int64_t number) {
        rows[i].emplace_back(MeasurementRow(measurement),
                             static_cast<std::uint64_t>(std::max<std::int64_t>(number, 1) - 1));
      });
  return rows;
}

}  // namespace imud
