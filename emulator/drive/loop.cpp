#include "emulator/drive/loop.hpp"

#include <algorithm>
#include <utility>

namespace imud {

namespace {

using namespace std::chrono_literals;

constexpr Nanoseconds longest_wait = 20ms;  // until `stop`, and ports that poll() does not report, are checked again
// The time for preparing an instant's samples, before the spinning. The samples' frames are made while spinning, or
// at the instant. So commands that arrive until then are executed first.
constexpr Nanoseconds preparation = 150us;
// A sample whose truth is known may be prepared this early. This saves a fast sensor a wake-up, and leaves reordered
// truths time to arrive for a slow one.
constexpr Nanoseconds early = 2ms;
// The truths taken at once. After a hold-up all waiting truths are taken, so that no sample is extrapolated although
// its truth has arrived. In a flood only some are taken between two samples.
constexpr int most_truths = 4096;
constexpr int most_in_flood = 64;
constexpr Nanoseconds pause = 1ms;  // if a wait would return at once again
// In a wait shorter than this the thread spins, because a wake-up from sleep takes as long.
constexpr Nanoseconds nap = 20us;
// The longest time between two looks at truth and hosts when the thread is behind and never waits.
constexpr Nanoseconds between_looks = 200us;

std::vector<Grid> grids(const Engine& engine) {
  std::vector<Grid> all;
  for (const auto& channel : engine.channels()) all.push_back(channel->sensor.grid());
  return all;
}

}  // namespace

Loop::Loop(Engine& engine, Host& host, Pacer& pacer, const LoopOptions& options, ClockCounters& clock,
           const std::atomic<bool>& stop)
    : engine_(engine),
      host_(host),
      pacer_(pacer),
      pace_(engine, host, pacer.is_paced() ? std::optional(options.pace) : std::nullopt, stop),
      hosts_(engine, host, pacer.is_paced()),
      stop_(stop),
      sink_(engine.sink()),
      intake_(engine.intake()),
      timeline_(engine.timeline()),
      paced_(pacer.is_paced()),
      waits_for_truth_(pacer.waits_for_truth()),
      spin_(paced_ ? Nanoseconds{0} : options.pace.spin),
      schedule_(grids(engine)),
      epoch_(host, options.epoch, engine.channels().size(), clock),
      limit_(options.limit),
      budget_(most_truths) {}

void Loop::run() noexcept {
  if (!waits_for_truth_) {
    const HostTime now = host_.now();
    sink_.set_time(now);
    origin_ = now + pause;
    if (std::ranges::any_of(engine_.channels(), [](const auto& channel) { return channel->rests_before_truth; }))
      origin_ = epoch_.start_from(origin_);
    for (std::size_t i = 0; i < engine_.channels().size(); ++i) {
      const bool rests = engine_.channels()[i]->rests_before_truth;
      engine_.apply(Step::power_on(i, rests ? start_grid(i, origin_).begin : now + pause));
      if (rests) engine_.apply(Step::start_samples(i));
    }
  }
  while (!ended_ && !stop_.load(std::memory_order_relaxed)) round();
  engine_.apply(Step::end());
  send_all();
}

// The functions that every sample needs are inline: each call would save and restore the same registers.
void Loop::round() noexcept {
  const HostTime now = paced_ ? host_.now() : HostTime{};
  if (paced_ && now - looked_ > between_looks) {
    hosts_.settle(now);
    look(now);
  }
  bool wants = wants_truth();
  if (wants && truth_waits_) {
    take_truth();
    if (ended_) return;
    wants = wants_truth();
  }
  if (wants && waits_for_truth_) {
    if (!truth_waits_) wait(host_.now() + longest_wait);
    return;
  }
  if (schedule_.empty()) return wait(now + longest_wait);
  if (unserved_) look(now);  // truth has come without a wait
  if (!is_prepared()) {
    due_ = next_due();
    const Nanoseconds ahead = due_ - now;
    if (paced_ && ahead > pace_.spin() + preparation) {
      const bool is_known = is_at_rest(due_) || pacer_.truth(due_) <= timeline_.newest();
      if (!is_known || ahead > pace_.spin() + early)
        return wait(std::min(due_ - pace_.spin() - preparation, now + longest_wait));
    }
    prepare();
  }
  if (paced_ && due_ - now > pace_.spin()) return wait(std::min(due_ - pace_.spin(), now + longest_wait));
  if (paced_ && pace_.is_too_late(due_, now)) return skip(now);
  transmit(now);
}

// Returns whether to take truth: live truth always; where samples wait for truth, only if the next sample needs
// more.
bool Loop::wants_truth() const noexcept {
  if (!waits_for_truth_) return true;
  return !is_prepared() && (!engine_.in_run() || pacer_.truth(next_due()) > latest_sample());
}

// Where samples wait for truth: returns the latest truth time that can be sampled now, and is within the limit.
TruthTime Loop::latest_sample() const noexcept {
  const TruthTime newest = timeline_.newest();
  return limit_ ? std::min(newest, timeline_.run_start() + *limit_) : newest;
}

// Returns the truth time before which no sample will be taken any more.
TruthTime Loop::earliest_sample() noexcept {
  if (!engine_.in_run()) return engine_.watermark();
  if (waits_for_truth_) return timeline_.newest();
  set_ahead_of_next();
  return std::max(engine_.watermark(), pacer_.use(std::min(host_.now(), next_due())));
}

void Loop::take_truth() noexcept {
  more_truth_ = has_room_ = true;
  int taken = 0;
  if (waits_for_truth_) apply_truth();
  // Where samples wait for truth there is always room, because apply_truth() advances the imus.
  for (bool wants = true; wants && more_truth_ && !ended_ && taken < budget_ && !is_due() &&
                          (has_room_ = waits_for_truth_ || make_room_for_truth());) {
    const TruthIntake::Outcome outcome = engine_.apply(Step::truth(engine_.watermark()));
    ++taken;
    more_truth_ = outcome != TruthIntake::Outcome::nothing;
    bool begins = outcome == TruthIntake::Outcome::new_run;
    if (begins || outcome == TruthIntake::Outcome::accepted) {
      newest_arrival_ = intake_.arrival();
      pacer_.set_ahead(epoch_.ahead());
      pacer_.take_stamp(intake_.truth(), newest_arrival_, begins);
    }
    if (outcome == TruthIntake::Outcome::accepted) {
      unreviewed_ = unapplied_ = true;
      const HostTime due = schedule_.empty() ? newest_arrival_ : next_due();
      if (!pacer_.observe(timeline_.newest(), newest_arrival_, due)) pass_over();
    }
    if (outcome == TruthIntake::Outcome::inserted) pacer_.observe_inserted(intake_.truth().time, intake_.arrival());
    if (begins && !engine_.in_run()) {
      settling_ = pacer_.begin_settling(timeline_.newest(), newest_arrival_);
      begins = !settling_;
    }
    if (begins) begin_run();
    wants = wants_truth();
    if (wants) apply_truth();
  }
  ended_ = ended_ || (!more_truth_ && intake_.at_end());
  truth_waits_ = more_truth_ || has_no_input();
  budget_ = more_truth_ ? std::max(most_in_flood, budget_ - taken) : most_truths;
  if (more_truth_) return;
  if (settling_) {
    if (!pacer_.is_settled(host_.now())) return;
    settling_ = false;
    return begin_run();
  }
  if (!std::exchange(unreviewed_, false)) return;
  pacer_.review(timeline_.newest(), host_.now());
}

// Returns false while the timeline has no room for another truth.
bool Loop::make_room_for_truth() noexcept {
  const TruthTime until = earliest_sample();
  if (engine_.has_room_for_truth(until)) return true;
  engine_.apply(Step::advance(until));
  return engine_.has_room_for_truth(until);
}

// Advances slow imus and answers the truth's sender. Called when all samples that the truth allows have left, or
// leave by the host's clock.
void Loop::apply_truth() noexcept {
  // The number of truths between two advances, so that the timeline does not overflow between the samples of slow
  // imus.
  constexpr std::size_t between_advances = Timeline::capacity / 2;
  if (std::exchange(unapplied_, false) && ++truths_since_advance_ == between_advances) {
    truths_since_advance_ = 0;
    engine_.apply(Step::advance(earliest_sample()));
  }
  if (waits_for_truth_ && engine_.in_run()) {
    engine_.raise_watermark(timeline_.newest());
    ended_ = latest_sample() < timeline_.newest();
  }
  if (!intake_.answer_due()) return;
  send_all();  // the samples leave before the answer
  // Where the host's clock paces, not all samples up to the newest truth have left; before the run no sample has
  // left.
  const TruthTime sampled = engine_.in_run() ? engine_.watermark() : timeline_.run_start();
  intake_.answer(waits_for_truth_ ? timeline_.newest() : sampled, engine_.samples_in_run());
}

// Sends the frames that ports hold back. Waits for readers where the host's clock does not pace.
void Loop::send_all() noexcept {
  hosts_.flush();
  if (paced_) return;
  for (const auto& channel : engine_.channels())
    if (channel->lines.flush()) channel->wait_until_sent(stop_);
}

void Loop::begin_run() noexcept {
  const bool is_first = !engine_.in_run();
  const TruthTime truth = timeline_.newest();
  if (limit_ && !is_first) *limit_ -= std::min(*limit_, engine_.watermark() - run_start_);
  run_start_ = timeline_.run_start();
  if (is_first) {
    epoch_.read_first();
    pacer_.set_ahead(epoch_.ahead());
  }
  const HostTime begin = pacer_.begin_run(truth, newest_arrival_, host_.now());
  engine_.apply(Step::run(false));
  hosts_.touch_all();
  truths_since_advance_ = 0;
  if (waits_for_truth_)
    origin_ = begin;
  else if (is_first)
    first_truth_ = begin;
  else
    return;
  const HostTime start = epoch_.start_from(begin);
  for (std::size_t i = 0; i < engine_.channels().size(); ++i) {
    if (!waits_for_truth_ && engine_.channels()[i]->rests_before_truth) continue;
    const HostTime origin = start_grid(i, start).begin;
    const DeviceTime zero = DeviceTime{truth.ns} + (origin - begin);
    engine_.apply(Step::set_clock(i, zero, paced_ ? std::optional(origin) : std::nullopt));
    engine_.apply(Step::start_samples(i));
  }
}

// Starts the schedule of the imu.
EpochGrid::Placement Loop::start_grid(std::size_t imu, HostTime start) noexcept {
  Channel& channel = *engine_.channels()[imu];
  const EpochGrid::Placement placed = epoch_.place(imu, channel.sensor.grid(), start);
  schedule_.start(imu, placed.origin - origin_, placed.first);
  if (placed.number > 0) channel.counters.first_k = static_cast<std::int64_t>(placed.number);
  return placed;
}

// Discards the truth before the newest, because the simulator's time has leapt: there is no motion between the two.
void Loop::pass_over() noexcept {
  engine_.apply(Step::forget_past());
  engine_.apply(Step::run(true));
  hosts_.touch_all();
  truths_since_advance_ = 0;
}

// Waits at most until `until`, for truth, for the hosts' bytes, for the devices' deadlines, and for paced lines.
void Loop::wait(HostTime until) noexcept {
  const HostTime now = host_.now();
  hosts_.settle(now);
  until = std::min({until, hosts_.next_wake().value_or(until), served_ + longest_wait});
  const bool flood = more_truth_ && has_room_ && !waits_for_truth_;
  if (flood) until = std::min(until, now + pause);
  if (paced_ && until - now < nap) host_.sleep_until(until, nap);
  look(until);
}

// Waits for input until `until` at most, and serves what is ready. With `until` in the past it does not wait.
void Loop::look(HostTime until) noexcept {
  unserved_ = false;
  truth_waits_ = hosts_.wait(until, !more_truth_ && wants_truth(), spin_) || more_truth_ || has_no_input();
  looked_ = host_.now();
  cycle_power_if_requested(looked_);
  if (!is_prepared() && has_commands()) execute_commands();
  if (!hosts_.serve_ready(looked_)) host_.sleep_until(std::min(until, looked_ + pause));
  if (looked_ - served_ < longest_wait) return;
  serve_all();
  truth_waits_ = true;  // a port that was lost may be back
}

void Loop::serve_all() noexcept {
  served_ = host_.now();
  hosts_.serve_all(served_);
}

// Gives the pacer the difference of clocks by which the grid has placed the next sample, so that it maps the sample's
// instant by the same difference. Where samples wait for truth, no clock maps their instants.
void Loop::set_ahead_of_next() noexcept {
  if (!waits_for_truth_ && !schedule_.empty()) pacer_.set_ahead(epoch_.ahead(schedule_.next().imu));
}

// Takes all samples of the instant `due_`.
[[gnu::always_inline]] inline void Loop::prepare() noexcept {
  if (has_commands()) execute_commands();
  const bool at_rest = prepared_at_rest_ = !waits_for_truth_ && is_at_rest(due_);
  set_ahead_of_next();
  const TruthTime time = at_rest ? TruthTime{} : pacer_.use(due_);
  do {
    const Schedule::Slot slot = schedule_.next();
    engine_.apply(at_rest ? Step::rest_sample(slot.imu, slot.index, slot.offset)
                          : Step::sample(slot.imu, slot.index, time));
    schedule_.advance(engine_.channels()[slot.imu]->sensor.clock().take_shift());
  } while (next_due() == due_);
}

[[gnu::always_inline]] inline void Loop::transmit(HostTime now) noexcept {
  if (sink_.keeps()) sink_.set_time(paced_ ? now : host_.now());
  cycle_power_if_requested(now);
  pace_.transmit(due_, due_);
  if (!paced_ && !(unserved_ = awaits_truth())) hosts_.serve_prepared(due_);
  complete(now);
  if (paced_ && !waits_for_truth_ && !prepared_at_rest_)
    engine_.quality().age.add(std::max(0.0, seconds(due_ - newest_arrival_)));
}

void Loop::skip(HostTime now) noexcept {
  sink_.set_time(now);
  cycle_power_if_requested(now);
  pace_.skip(due_);
  complete(now);
}

[[gnu::always_inline]] inline void Loop::complete(HostTime now) noexcept {
  epoch_.update(now);
  for (const Channel* channel : engine_.prepared()) {
    if (epoch_.moves(channel->number)) [[unlikely]]
      follow_epoch(*channel);
    hosts_.touch(*channel);
  }
  engine_.complete();
}

// After a change of the epoch's clock the imu's next sample is on the grid by the changed clock. The sample's
// stamp and number follow the last sample's, as in a sensor whose clock runs on.
void Loop::follow_epoch(const Channel& channel) noexcept {
  const std::size_t imu = channel.number;
  const Schedule::Slot& next = schedule_.next(imu);
  const DeviceClock& clock = channel.sensor.clock();
  const Nanoseconds phase = channel.sensor.grid().phase();
  const auto placed = epoch_.follow(imu, channel.sensor.grid(), next.index, origin_ + next.offset);
  if (!placed) return;
  schedule_.start(imu, placed->origin - origin_, placed->first);
  engine_.apply(Step::set_clock(imu, clock.next_sample().value_or(DeviceTime{}) - phase, placed->begin));
  engine_.apply(Step::start_samples(imu));
}

}  // namespace imud
