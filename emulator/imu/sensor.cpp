#include "emulator/imu/sensor.hpp"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <new>
#include <type_traits>
#include <utility>

#include "transports/host_clock.hpp"

namespace imud {

static_assert(std::is_trivially_destructible_v<Sample>);

Sensor::Sensor(const ImuConfig& config, std::uint64_t seed, ChannelFaults* faults)
    : grid_(config.grid),
      imu_(config.model, seed, stream_id(config.name)),
      clock_(config.grid),
      normals_(seed, stream_id(config.name)),
      oscillator_(config.model.oscillator, config.model.temperature, config.model.temperature_c, grid_),
      stamp_error_(config.model.stamp_error),
      has_clock_errors_(oscillator_.is_on() || stamp_error_.is_on()),
      acquisition_(config.model.navigation.gnss, config.model.rate_hz),
      sampling_delay_(config.model.sampling_delay),
      device_filters_(config.device_filters),
      filters_{config.model.gyro.filter, config.model.accelerometer.filter, config.model.magnetometer.filter,
               config.model.inclinometer ? config.model.inclinometer->filter : SensorFilter{}},
      faults_(faults) {
  if (device_filters_) imu_.reserve_filters(Device::longest_boxcar);
  if (config.navigator.is_on) {
    solution_.emplace(config.navigator, config.model);
    judge_.emplace(config.model);
  }
  if (faults_ == nullptr) return;
  const auto utc = std::chrono::system_clock::now().time_since_epoch();
  utc_offset_ns_ = std::chrono::duration_cast<Nanoseconds>(utc).count() - host_now().ns;
}

std::optional<std::int64_t> Sensor::utc_ns_of(DeviceTime time) const noexcept {
  const std::optional<HostTime> host = clock_.host_time(time);
  return host ? std::optional(host->ns + utc_offset_ns_) : std::nullopt;
}

void Sensor::begin_run(TruthTime begin) noexcept {
  pass_over();
  has_leapt_ = false;
  run_begin_ = begin;
  if (faults_ != nullptr) faults_->begin_run();
}

void Sensor::pass_over() noexcept {
  if (!is_resting_) imu_.begin_run();  // otherwise the first sample of the truth begins the run
  if (solution_) {
    solution_->restart();
    // A heading that the host has given before the first run is the heading at the begin of that run.
    if (!has_run_ && requests_.heading) solution_->give(*requests_.heading);
  }
  has_sampled_ = false;
  has_leapt_ = true;
  if (faults_ != nullptr) faults_->pass_over();
}

void Sensor::sense(const Timeline& timeline, TruthTime time, std::uint64_t k) noexcept {
  has_sampled_ = has_run_ = true;
  is_resting_ = false;
  ::new (&sample_) Sample(imu_.sample(timeline, time, clock_.stamp(k)));  // in place: a copy is slow
  ahead_ = Nanoseconds{0};
  if ((sample_.status & status::truth_extrapolated) != 0) [[unlikely]]
    ahead_ = imu_.advanced_to() - timeline.newest();
  if (has_clock_errors_ || has_leapt_ || faults_ != nullptr) [[unlikely]]
    take_errors(timeline, time);
  if (acquisition_.is_on()) [[unlikely]]
    acquisition_.take(sample_.navigation);
  if (solution_) [[unlikely]]
    navigate(timeline, time);
}

// The filter takes the measurements of the sensors, with their faults.
[[gnu::noinline]] void Sensor::navigate(const Timeline& timeline, TruthTime time) noexcept {
  const TruthTime measured = time - sampling_delay_;
  const PositionVelocity position = timeline.position(measured);
  const bool is_judged = faults_ != nullptr && faults_->may_act();
  if (judge_ && (is_judged || judge_->is_watched(sample_))) judge_->keep(sample_, position, imu_.true_rate());
  possible_fix_ = sample_.navigation;
  solution_->take(sample_, measured, position.earth_angle);
  if (judge_ && is_judged) faults_->schedule().judge(judge_->errors(sample_));
}

// Applies the errors of the clock, a leap of the truth, and faults to the sample.
[[gnu::noinline]] void Sensor::take_errors(const Timeline& timeline, TruthTime time) noexcept {
  if (has_clock_errors_) take_clock_errors(oscillator_.follows_truth() ? timeline.temperature_c(time) : std::nullopt);
  if (std::exchange(has_leapt_, false)) sample_.status |= status::truth_extrapolated;
  if (faults_ != nullptr)
    faults_->take(sample_, time - run_begin_, faults_->may_act() ? utc_ns_of(sample_.time) : std::nullopt);
}

void Sensor::sense_at_rest(Nanoseconds since_power_on, std::uint64_t k) noexcept {
  is_resting_ = true;
  ahead_ = Nanoseconds{0};
  sample_ = imu_.sample_at_rest(since_power_on, clock_.stamp(k));
  if (has_clock_errors_) take_clock_errors(std::nullopt);
  if (faults_ != nullptr)
    faults_->take_at_rest(sample_, since_power_on, faults_->may_act() ? utc_ns_of(sample_.time) : std::nullopt);
  if (acquisition_.is_on()) acquisition_.take(sample_.navigation);
  if (!solution_) return;
  possible_fix_ = sample_.navigation;
  solution_->take_at_rest(sample_);
}

// The instants of an imu and of its twin without errors follow from the same numbers: neither faults nor the other
// errors of the sensor enter.
[[gnu::noinline]] void Sensor::take_clock_errors(std::optional<double> truth_c) noexcept {
  if (oscillator_.is_on()) clock_.shift(oscillator_.next(normals_, sample_.counter, truth_c));
  if (!stamp_error_.is_on()) return;
  // A clock counts from 0 at power on. The error must not make its stamp negative.
  const std::int64_t least = sample_.time.ns < 0 ? INT32_MIN : std::max<std::int64_t>(INT32_MIN, -sample_.time.ns);
  sample_.stamp_error_ns = std::max(stamp_error_.at(normals_, sample_.counter), static_cast<std::int32_t>(least));
}

void Sensor::restart() noexcept {
  imu_.power_on(++power_ons_);
  acquisition_.power_on();
  if (solution_) solution_->restart();
  // The last sample is the first that the unit sends after its start: this sample has no solution yet.
  const bool has_solution = solution_ && sample_.solution;
  if (has_solution) sample_.navigation = possible_fix_;
  if (acquisition_.is_on()) acquisition_.take(sample_.navigation);
  if (!has_solution) return;
  solution_->take_at_rest(sample_);
}

void Sensor::set_seed(std::uint64_t seed) noexcept {
  imu_.set_seed(seed);
  normals_.set_seed(seed);
}

void Sensor::follow(const std::optional<SensorFilters>& filters, const NavigationRequests& requests) noexcept {
  if (requests != requests_) {
    if (solution_) {
      if (requests.restarts != requests_.restarts) solution_->restart();
      solution_->set_aids(requests.aids);
      if (requests.heading && requests.headings != requests_.headings) solution_->give(*requests.heading);
    }
    requests_ = requests;
  }
  if (!device_filters_ || !filters || *filters == filters_) return;
  filters_ = *filters;
  imu_.set_filters(filters_);
}

void Sensor::exchange(Reload::Sensor& next) noexcept {
  if (next.keeps_gyro_bias) next.imu.set_bias(Quantity::rate, imu_.bias(Quantity::rate));
  if (next.keeps_accelerometer_bias) next.imu.set_bias(Quantity::specific_force, imu_.bias(Quantity::specific_force));
  if (device_filters_) next.imu.set_filters(filters_);
  next.imu.continue_from(imu_);
  std::swap(imu_, next.imu);
  std::swap(solution_, next.solution);
  if (solution_) solution_->set_aids(requests_.aids);
  std::swap(judge_, next.judge);
  if (judge_ && next.judge) judge_->watch_as(*next.judge);
  if (next.grid) {
    grid_ = *next.grid;
    clock_.change(grid_);
  }
  const Navigation& possible = sample_.solution ? possible_fix_ : sample_.navigation;
  Acquisition acquisition(next.model.navigation.gnss, next.model.rate_hz);
  acquisition.continue_from(acquisition_, possible.is_known);
  acquisition_ = acquisition;
  next.oscillator.continue_from(oscillator_);
  std::swap(oscillator_, next.oscillator);
  stamp_error_ = StampError(next.model.stamp_error);
  has_clock_errors_ = oscillator_.is_on() || stamp_error_.is_on();
}

}  // namespace imud
