#include "emulator/faults/fault_schedule.hpp"

#include <cmath>
#include <limits>
#include <utility>

namespace imud {
namespace {
// The numbers that are drawn for an occurrence, after the parameters.
constexpr std::uint64_t draw_of_begin = FaultKind::max_parameters, draw_of_duration = draw_of_begin + 1,
                        draw_of_probability = draw_of_begin + 2, draws_per_occurrence = 8;

// Compares numbers of samples modulo 2^64, because numbers of samples before the run are negative.
bool is_before(std::uint64_t a, std::uint64_t b) noexcept { return static_cast<std::int64_t>(a - b) < 0; }

// Returns the time `s` after `from`, rounded to the nearest ns. A fault without end ends 126 years later.
Nanoseconds time_after(Nanoseconds from, double s) noexcept {
  constexpr double longest_time_s = 4e9;
  return from + nanoseconds(std::clamp(s, -longest_time_s, longest_time_s));
}
}  // namespace

FaultSchedule::FaultSchedule(std::span<const FaultConfig> faults, std::span<const Normals> normals,
                             std::string_view imu, std::uint16_t imu_number, double rate_hz, FaultLog& log)
    : normals_(normals), imu_(imu_number), rate_hz_(rate_hz), period_s_(1 / rate_hz), log_(log) {
  states_.reserve(normals.size());
  active_.reserve(normals.size());
  for (std::size_t i = 0; i < faults.size(); ++i)
    if (faults[i].acts_on(imu)) insert(state_of(faults[i], static_cast<std::uint32_t>(i)));
}

// Returns the state of a fault at the begin of a run.
FaultSchedule::State FaultSchedule::state_of(const FaultConfig& fault, std::uint32_t number) noexcept {
  State state{.fault = &fault, .number = number, .waits = fault.waits()};
  if (!state.waits) state.zero = 0;
  return state;
}

// Inserts a state so that the order by seam and number is kept.
void FaultSchedule::insert(const State& state) noexcept {
  const auto seam = [](const State& s) { return s.fault->kind->seam; };
  states_.insert(std::ranges::find_if(states_, [&](const State& s) { return seam(s) > seam(state); }), state);
}

// The times of a fault before the first truth go on in the run, whose first sample is a period later.
void FaultSchedule::go_on_after_rest(State& state) const noexcept {
  const Nanoseconds shift = time_after(time_, period_s_);
  state.first -= next_;  // modulo 2^64, as it is compared
  if (state.zero) *state.zero -= next_;
  state.zero_time -= shift;
  state.from -= shift;
  state.end -= shift;
  if (state.effect) state.effect->until_s -= seconds(shift);
}

void FaultSchedule::finish() noexcept {
  end_all();
  begin_run();
}

void FaultSchedule::set_rate(double rate_hz) noexcept {
  for (State& state : states_) {
    if (!state.is_active) continue;
    state.earlier = state.active.since;
    state.earlier_s = state.active.since_s;
  }
  rate_hz_ = rate_hz;
  period_s_ = 1 / rate_hz;
}

void FaultSchedule::begin_run() noexcept {
  for (State& state : states_) {
    if (state.is_added && !has_taken_) continue;
    if (state.is_active) end(state);
    log_effect(state);
    state.occurrence = 0;
    state.is_above = state.is_ended = false;
    if (!has_taken_ || !state.fault->waits()) continue;  // bytes from the host before the first run count
    state.waits = true;
    state.zero.reset();
    state.search = {};
  }
  if (has_taken_) std::erase_if(states_, [](const State& state) { return state.is_added; });
  active_.clear();
  std::fill(std::begin(ranges_), std::end(ranges_), Range{});
  if (!is_resting_) next_ = 0;
  if (has_taken_) ++run_;
}

void FaultSchedule::add(const FaultConfig& fault, std::uint32_t number) noexcept {
  if (states_.size() == states_.capacity()) return;
  insert({.fault = &fault, .number = number, .is_added = true, .waits = fault.waits()});
}

void FaultSchedule::end(std::uint32_t number) noexcept {
  for (State& state : states_) {
    if (state.number != number) continue;
    if (state.is_active) end(state);
    state.is_ended = true;
  }
}

void FaultSchedule::end_all() noexcept {
  for (State& state : states_) {
    if (state.is_active) end(state);
    state.is_ended = true;
  }
}

double FaultSchedule::draw(const State& state, const FaultNumber& number, std::uint64_t parameter) const noexcept {
  if (number.is_fixed()) return number.a;
  return number.draw(normals_[state.number].uniform(Quantity::rate, Process::fault_draw,
                                                    draws_per_occurrence * state.occurrence + parameter));
}

// Returns true if the next occurrence begins at this sample.
bool FaultSchedule::begins(State& state, const Sample& sample, Nanoseconds time) noexcept {
  const FaultConfig& fault = *state.fault;
  if (!state.zero || state.is_ended || (fault.times > 0 && state.occurrence >= fault.times)) return false;
  if (fault.begin_sample && is_before(next_, *state.zero + *fault.begin_sample)) return false;
  // The begin of a repeated fault is drawn once, for its first occurrence. The others follow every `every_s` seconds.
  const std::uint64_t occurrence = state.occurrence;
  State first = state;
  first.occurrence = 0;
  const double begin_s = draw(first, fault.begin_s, draw_of_begin) + static_cast<double>(occurrence) * fault.every_s;
  if (!fault.begin_sample && time < time_after(state.zero_time, begin_s)) return false;
  if (fault.condition.quantity != FaultCondition::Quantity::none) {
    const Vector3& value =
        fault.condition.quantity == FaultCondition::Quantity::rate ? sample.rate : sample.specific_force;
    const bool is_above = value.norm() > fault.condition.above;
    const bool rises = is_above && !state.is_above;
    state.is_above = is_above;
    if (!rises) return false;
  }
  const bool is_by_time = !fault.begin_sample && fault.condition.quantity == FaultCondition::Quantity::none;
  state.from = is_by_time ? state.zero_time : time;
  state.begin_s = is_by_time ? begin_s : 0;
  return true;
}

void FaultSchedule::begin(State& state) noexcept {
  const FaultConfig& fault = *state.fault;
  if (fault.probability < 1 && normals_[state.number].uniform(Quantity::rate, Process::fault_draw,
                                                              draws_per_occurrence * state.occurrence +
                                                                  draw_of_probability) >= fault.probability) {
    ++state.occurrence;
    return;
  }
  state.is_active = true;
  state.first = next_;
  state.earlier = 0;
  state.earlier_s = 0;
  state.end_s = fault.has_duration ? state.begin_s + draw(state, fault.duration_s, draw_of_duration)
                                   : std::numeric_limits<double>::infinity();
  state.end = time_after(state.from, state.end_s);
  state.active = {.kind = fault.kind,
                  .number = state.number,
                  .target = fault.target,
                  .axes = fault.axes,
                  .occurrence = state.occurrence};
  for (std::size_t i = 0; i < fault.kind->parameters.size(); ++i) {
    const FaultParameter& parameter = fault.kind->parameters[i];
    const double drawn = std::clamp(draw(state, fault.parameters[i], i), parameter.min, parameter.max);
    state.active.parameters[i] = parameter.is_whole ? std::round(drawn) : drawn;
  }
}

void FaultSchedule::end(State& state) noexcept {
  if (state.is_logged) log(state, FaultEvent::Kind::ended);
  state.is_active = false;
  ++state.occurrence;
}

bool FaultSchedule::is_over(const State& state, std::uint64_t sample, Nanoseconds time) noexcept {
  const FaultConfig& fault = *state.fault;
  if (fault.kind->is_event) return is_before(state.first, sample);
  if (fault.samples) return !is_before(sample, state.first + *fault.samples);
  return time >= state.end;
}

// A begin is logged with the sample that is taken, an end with the one before it, an effect with the last one.
// Returns false if the event is lost.
bool FaultSchedule::log(const State& state, FaultEvent::Kind kind) noexcept {
  using Kind = FaultEvent::Kind;
  const bool has_begun = kind == Kind::begun || kind == Kind::passed_over, is_effect = kind == Kind::effect;
  const bool is_of_rest = is_resting_ || (next_ == 0 && !has_begun);
  return log_.add({.fault = state.number,
                   .imu = imu_,
                   .kind = kind,
                   .run = is_of_rest ? -1 : run_,
                   .occurrence = is_effect ? state.effect->occurrence : state.occurrence,
                   .sample = has_begun ? next_ : (next_ == 0 ? at_rest_ : next_) - 1,
                   .counter = counter_,
                   .time_s = seconds(time_),
                   .device_time = device_time_,
                   .parameters = state.active.parameters,
                   .effect = is_effect ? state.effect->largest : SolutionErrors{}});
}

void FaultSchedule::log_effect(State& state) noexcept {
  if (!state.effect) return;
  if (state.effect->is_logged) log(state, FaultEvent::Kind::effect);
  state.effect.reset();
}

void FaultSchedule::judge(const SolutionErrors& errors) noexcept {
  for (State& state : states_) {
    if (state.is_active) {
      if (state.effect && state.effect->occurrence != state.occurrence) log_effect(state);
      if (!state.effect) state.effect = {.occurrence = state.occurrence, .is_logged = state.is_logged, .until_s = 0};
      state.effect->until_s = seconds(time_) + FaultEvent::effect_s;
    } else if (state.effect && seconds(time_) > state.effect->until_s + 0.5 * period_s_) {
      log_effect(state);
    }
    if (state.effect) state.effect->largest.raise_to(errors);
  }
}

void FaultSchedule::host_sent(std::span<const std::byte> bytes) noexcept {
  for (State& state : states_)
    if (state.waits && state.fault->after_host && state.search.take(*state.fault->after_host, bytes))
      state.waits = false;
}

void FaultSchedule::take(const Sample& sample, Nanoseconds since_begin, std::optional<std::int64_t> utc_ns) noexcept {
  has_taken_ = true;
  if (std::exchange(is_resting_, false)) {
    for (State& state : states_)
      if (state.is_added) go_on_after_rest(state);
    at_rest_ = std::exchange(next_, 0);
  }
  take_at(since_begin, sample, utc_ns);
}

void FaultSchedule::take_at_rest(const Sample& sample, Nanoseconds since,
                                 std::optional<std::int64_t> utc_ns) noexcept {
  is_resting_ = true;
  take_at(since, sample, utc_ns);
}

void FaultSchedule::take_at(Nanoseconds time, const Sample& sample, std::optional<std::int64_t> utc_ns) noexcept {
  if (states_.empty() && active_.empty()) {
    counter_ = sample.counter;
    device_time_ = sample.time;
    time_ = time;
    ++next_;
    return;
  }
  for (State& state : states_)
    if (state.is_active && is_over(state, next_, time)) end(state);  // the log's figures are of the last sample
  std::erase_if(states_, [](const State& state) {
    const FaultConfig& fault = *state.fault;
    const bool is_over = state.is_ended || (fault.times > 0 && state.occurrence >= fault.times);
    return state.is_added && !state.is_active && !state.effect && is_over;
  });
  counter_ = sample.counter;
  device_time_ = sample.time;
  const double step_s = seconds(time - std::exchange(time_, time));
  const bool has_leapt = next_ > 0 && step_s > 1.5 * period_s_;
  active_.clear();
  std::fill(std::begin(ranges_), std::end(ranges_), Range{});
  for (State& state : states_) {
    if (is_resting_ && !state.is_added) continue;
    if (state.waits && state.fault->after_utc_ns && utc_ns && *utc_ns >= *state.fault->after_utc_ns)
      state.waits = false;
    if (!state.zero && !state.waits) {
      state.zero = next_;
      state.zero_time = time;
    }
    // An occurrence that has ended between two samples acts on no sample. If several occurrences lie within a leap,
    // only the first is logged.
    bool is_logged = !has_leapt;
    while (!state.is_active && begins(state, sample, time)) {
      begin(state);
      if (!state.is_active) continue;
      if (!is_over(state, next_, time)) {
        state.is_logged = log(state, FaultEvent::Kind::begun);
        break;
      }
      if (!std::exchange(is_logged, true)) log(state, FaultEvent::Kind::passed_over);
      state.is_active = false;
      ++state.occurrence;
    }
    if (!state.is_active) continue;
    const FaultConfig& fault = *state.fault;
    ActiveFault& active = state.active;
    active.since = next_ - state.first;
    active.since_s = state.earlier_s + static_cast<double>(active.since - state.earlier) / rate_hz_;
    // The next sample may be later by the rounding of its time and by the error of the sensor's clock.
    active.is_last = is_over(state, next_ + 1, time_after(time, 1.001 * period_s_));
    active.weight = 1;
    const double at_s = seconds(time - state.from);
    if (fault.ramp_in_s > 0) active.weight = std::clamp((at_s - state.begin_s) / fault.ramp_in_s, 0.0, 1.0);
    if (fault.ramp_out_s > 0) active.weight = std::clamp((state.end_s - at_s) / fault.ramp_out_s, 0.0, active.weight);
    Range& range = ranges_[static_cast<std::size_t>(active.kind->seam)];
    if (range.size == 0) range.begin = active_.size();
    ++range.size;
    active_.push_back(active);
  }
  ++next_;
}

}  // namespace imud
