#include "emulator/faults/fault_schedule.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

namespace imud {

namespace {
// The numbers that are drawn for an occurrence, after the parameters.
constexpr std::uint64_t draw_of_begin = FaultKind::max_parameters, draw_of_duration = draw_of_begin + 1,
                        draw_of_probability = draw_of_begin + 2, draws_per_occurrence = 8;
}  // namespace

FaultSchedule::FaultSchedule(std::span<const FaultConfig> faults, std::string_view imu, std::uint16_t imu_number,
                             double rate_hz, std::uint64_t seed, FaultLog& log)
    : imu_(imu_number), period_s_(1 / rate_hz), log_(log) {
  for (std::size_t seam = 0; seam < seams; ++seam)
    for (std::size_t i = 0; i < faults.size(); ++i)
      if (faults[i].acts_on(imu) && faults[i].kind->seam == static_cast<FaultSeam>(seam))
        states_.push_back({.fault = &faults[i],
                           .number = static_cast<std::uint32_t>(i),
                           .draws = Normals(seed, stream_id(fmt::format("{}/fault/{}", imu, i)))});
  active_.reserve(states_.size());
}

void FaultSchedule::begin_run() noexcept {
  for (State& state : states_) {
    if (state.is_active) end(state);
    state.occurrence = 0;
    state.is_above = false;
  }
  active_.clear();
  std::fill(std::begin(ranges_), std::end(ranges_), Range{});
  next_ = 0;
}

double FaultSchedule::draw(const State& state, const FaultNumber& number, std::uint64_t parameter) const noexcept {
  if (number.is_fixed()) return number.a;
  return number.draw(
      state.draws.uniform(Quantity::rate, Process::fault_draw, draws_per_occurrence * state.occurrence + parameter));
}

// Returns true if the next occurrence begins at this sample.
bool FaultSchedule::begins(State& state, const Sample& sample, double time_s) noexcept {
  const FaultConfig& fault = *state.fault;
  if (fault.times > 0 && state.occurrence >= fault.times) return false;
  if (fault.begin_sample && next_ < *fault.begin_sample) return false;
  // All occurrences of a repeated fault have the begin that is drawn for the first.
  const std::uint64_t occurrence = state.occurrence;
  State first = state;
  first.occurrence = 0;
  const double begin_s = draw(first, fault.begin_s, draw_of_begin) + static_cast<double>(occurrence) * fault.every_s;
  if (!fault.begin_sample && time_s < begin_s) return false;
  if (fault.condition.quantity != FaultCondition::Quantity::none) {
    const Vector3& value =
        fault.condition.quantity == FaultCondition::Quantity::rate ? sample.rate : sample.specific_force;
    const bool is_above = value.norm() > fault.condition.above;
    const bool rises = is_above && !state.is_above;
    state.is_above = is_above;
    if (!rises) return false;
  }
  state.begin_s = fault.begin_sample || fault.condition.quantity != FaultCondition::Quantity::none ? time_s : begin_s;
  return true;
}

void FaultSchedule::begin(State& state) noexcept {
  const FaultConfig& fault = *state.fault;
  if (fault.probability < 1 &&
      state.draws.uniform(Quantity::rate, Process::fault_draw,
                          draws_per_occurrence * state.occurrence + draw_of_probability) >= fault.probability) {
    ++state.occurrence;
    return;
  }
  state.is_active = true;
  state.first = next_;
  state.end_s = fault.has_duration ? state.begin_s + draw(state, fault.duration_s, draw_of_duration)
                                   : std::numeric_limits<double>::infinity();
  state.active = {.kind = fault.kind,
                  .number = state.number,
                  .target = fault.target,
                  .axes = fault.axes,
                  .occurrence = state.occurrence};
  for (std::size_t i = 0; i < fault.kind->parameters.size(); ++i)
    state.active.parameters[i] =
        std::clamp(draw(state, fault.parameters[i], i), fault.kind->parameters[i].min, fault.kind->parameters[i].max);
}

void FaultSchedule::end(State& state) noexcept {
  log(state, false);
  state.is_active = false;
  ++state.occurrence;
}

bool FaultSchedule::is_over(const State& state, std::uint64_t sample, double time_s) noexcept {
  const FaultConfig& fault = *state.fault;
  if (fault.kind->is_event) return sample > state.first;
  if (fault.samples) return sample >= state.first + *fault.samples;
  return time_s >= state.end_s;
}

// A begin is logged with the sample that is taken, an end with the one before it.
void FaultSchedule::log(const State& state, bool has_begun) noexcept {
  log_.add({.fault = state.number,
            .imu = imu_,
            .has_begun = has_begun,
            .occurrence = state.occurrence,
            .sample = has_begun ? next_ : next_ - 1,
            .counter = counter_,
            .time_s = time_s_,
            .device_time = device_time_,
            .parameters = state.active.parameters});
}

void FaultSchedule::take(const Sample& sample, Nanoseconds since_begin) noexcept {
  const double time_s = seconds(since_begin);
  for (State& state : states_)
    if (state.is_active && is_over(state, next_, time_s)) end(state);  // the log's figures are of the last sample
  counter_ = sample.counter;
  device_time_ = sample.time;
  time_s_ = time_s;
  active_.clear();
  std::fill(std::begin(ranges_), std::end(ranges_), Range{});
  for (State& state : states_) {
    // An occurrence whose end has passed already, between two samples, acts on none.
    while (!state.is_active && begins(state, sample, time_s)) {
      begin(state);
      if (!state.is_active) continue;
      if (!is_over(state, next_, time_s)) {
        log(state, true);
        break;
      }
      state.is_active = false;
      ++state.occurrence;
    }
    if (!state.is_active) continue;
    const FaultConfig& fault = *state.fault;
    ActiveFault& active = state.active;
    active.since = next_ - state.first;
    active.is_last = is_over(state, next_ + 1, time_s + period_s_);
    active.weight = 1;
    if (fault.ramp_in_s > 0) active.weight = std::min(1.0, (time_s - state.begin_s) / fault.ramp_in_s);
    if (fault.ramp_out_s > 0) active.weight = std::min(active.weight, (state.end_s - time_s) / fault.ramp_out_s);
    Range& range = ranges_[static_cast<std::size_t>(active.kind->seam)];
    if (range.size == 0) range.begin = active_.size();
    ++range.size;
    active_.push_back(active);
  }
  ++next_;
}

}  // namespace imud
