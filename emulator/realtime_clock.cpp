#include <algorithm>
#include <cmath>
#include <utility>

#include "emulator/clock.hpp"

namespace imud {

namespace {

using namespace std::chrono_literals;

constexpr Nanoseconds patience = 20ms;  // between looks at `stop`
// Time for all that has to be done before an instant and the spinning.
constexpr Nanoseconds preparation = 150us;
// So early a sample may be prepared if its truth is known: a wake-up less for a fast sensor, and time enough for
// truths that were overtaken for a slow one.
constexpr Nanoseconds early = 2ms;
// Truths taken in one go. After a hold-up all that wait, so that no sample is extrapolated while truth is there; but
// in a flood only so many between two samples.
constexpr int most = 4096;
constexpr int most_in_flood = 64;
// How far ahead of what is sampled, less the delay, no network nor clock brings a truth.
constexpr Nanoseconds leap = 250ms;
// Truths that come late for so long are not a hold-up; so late at least, and so many.
constexpr Nanoseconds lasting = 200ms;
constexpr Nanoseconds late_at_least = 50ms;
constexpr int late_truths = 3;
// Two leaps within so long are a simulator that runs fast.
constexpr Nanoseconds fast_leaps = 1s;

class RealtimeLoop {
 public:
  RealtimeLoop(Session& session, Host& host, const RealtimeOptions& options)
      : session_(session),
        host_(host),
        options_(options),
        intake_(session.intake()),
        timeline_(session.timeline()),
        quality_(session.quality()),
        clock_(options.truth),
        preparation_(options.spin + preparation) {}

  void round() noexcept {
    if (truth_waits_) take_truth();
    const HostTime now = host_.now();
    if (!session_.in_run()) return wait(now + patience);
    if (!prepared_) {
      due_ = next_due();
      if (due_ - now > preparation_ &&
          (clock_.truth(due_) > timeline_.newest() || due_ - now > options_.spin + early))
        return wait(std::min(due_ - preparation_, now + patience));
      prepare();
    }
    if (due_ - now > options_.spin) return wait(std::min(due_ - options_.spin, now + patience));
    fire(now);
  }

 private:
  HostTime next_due() const noexcept { return start_ + session_.schedule().next().since_start; }

  // What no sample will ask for any more: before that truth can be taken in.
  TruthTime passed() noexcept {
    return session_.in_run() ? std::max(sampled_, clock_.use(std::min(host_.now(), next_due()))) : sampled_;
  }

  // What is prepared need not wait for anything.
  bool is_due() const noexcept { return prepared_ && host_.now() >= due_ - options_.spin; }

  void take_truth() noexcept {
    more_ = has_room_ = true;
    int taken = 0;
    while (more_ && taken < budget_ && !is_due() && (has_room_ = session_.has_room_for_truth(passed()))) {
      const TruthIntake::Outcome outcome = intake_.take(session_.settled());
      ++taken;
      more_ = outcome != TruthIntake::Outcome::nothing;
      if (outcome == TruthIntake::Outcome::new_run) {
        newest_arrival_ = intake_.arrival();
        begin_run();
      }
      if (outcome == TruthIntake::Outcome::accepted) {
        newer_ = true;
        observe();
        session_.follow(passed());
      }
      if (intake_.answer_due()) intake_.answer(timeline_.newest(), session_.samples_in_run());
    }
    budget_ = more_ ? std::max(most_in_flood, budget_ - taken) : most;
    if (more_ || !newer_) return;
    newer_ = false;
    look_for_pause();
    publish();
  }

  void observe() noexcept {
    newest_arrival_ = intake_.arrival();
    step_ = timeline_.newest() - std::exchange(newest_, timeline_.newest());
    if (timeline_.newest() - clock_.truth(newest_arrival_) > leap + nanoseconds(clock_.delay_s())) {
      const Nanoseconds since = newest_arrival_ - begun_;
      if (std::exchange(leapt_, true) && since < fast_leaps && since.count() > 0)
        rate_ = std::clamp(seconds(newest_ - begun_with_) / seconds(since), 0.1, 10.0);
      return resume();
    }
    // After a hold-up samples are due that are older than the arrival.
    clock_.observe(timeline_.newest(), newest_arrival_, std::min(newest_arrival_, next_due()));
    quality_.jitter.add(clock_.lateness_s());
    if (newest_arrival_ - begun_ > fast_leaps) leapt_ = false;
  }

  // After a look at all truths that had waited: do they go on coming too late?
  void look_for_pause() noexcept {
    const HostTime now = host_.now();
    // A simulator that sends seldom is late by much now and then.
    const Nanoseconds late = std::max({options_.extrapolate, late_at_least, 2 * step_});
    if (timeline_.newest() - clock_.truth(now) >= -late) {
      late_since_.reset();
      rate_ = clock_.used_rate();
    } else if (!late_since_) {
      late_since_ = now;
      late_from_ = timeline_.newest();
      late_count_ = 1;
    } else if (++late_count_ >= late_truths && now - *late_since_ >= lasting) {
      const double seen = seconds(timeline_.newest() - late_from_) / seconds(now - *late_since_);
      if (std::abs(seen - rate_) > 0.1 * rate_) rate_ = std::clamp(seen, 0.1, 10.0);  // no pause: a slow simulator
      resume();
    }
  }

  void resume() noexcept {
    quality_.resumed.fetch_add(1, std::memory_order_relaxed);
    timeline_.forget_past();
    begin_run();
  }

  void begin_run() noexcept {
    begun_ = newest_arrival_;
    begun_with_ = newest_ = timeline_.newest();
    const HostTime begin = clock_.begin(timeline_.newest(), newest_arrival_, rate_);
    if (!session_.in_run()) {
      start_ = begin;
      device_start_ = DeviceTime{timeline_.newest().ns};
    }
    sampled_ = timeline_.newest();
    session_.begin_run();
    late_since_.reset();
    publish();
  }

  void publish() noexcept {
    quality_.rate.store(clock_.rate(), std::memory_order_relaxed);
    quality_.offset_s.store(clock_.offset_s(), std::memory_order_relaxed);
    quality_.delay_s.store(clock_.delay_s(), std::memory_order_relaxed);
    quality_.known.store(true, std::memory_order_relaxed);
  }

  // Until `time`, for truth, for what the hosts send, and for the pace of the lines.
  void wait(HostTime time) noexcept {
    constexpr Nanoseconds pause = 1ms;
    session_.flush();
    time = std::min(time, session_.due().value_or(time));
    const std::span<pollfd> inputs = session_.inputs();
    const bool flood = more_ && has_room_;
    if (more_) inputs[0].fd = -1;  // not to be woken by what there is no time or no place for
    if (flood) time = std::min(time, host_.now() + pause);
    waited_ = true;
    const bool come = host_.wait_for_input(inputs, time);
    truth_waits_ = more_ || (come && inputs[0].revents != 0);
    if (come && !session_.serve_inputs()) host_.sleep_until(std::min(time, host_.now() + pause));
    if (const HostTime now = host_.now(); now - served_ > patience) {  // also those that poll() says nothing of
      session_.serve_hosts();
      served_ = now;
    }
  }

  // All samples of one instant.
  void prepare() noexcept {
    sampled_ = clock_.use(due_);
    do {
      const Schedule::Instant next = session_.schedule().next();
      const Grid& grid = session_.schedule().grid(next.imu);
      session_.prepare(sampled_, device_start_ + grid.nominal_offset(next.index));
    } while (next_due() == due_);
    prepared_ = true;
  }

  void fire(HostTime now) noexcept {
    if (now < due_) host_.sleep_until(due_, options_.spin);
    session_.fire(due_, [this] { return host_.now(); });
    quality_.age.add(std::max(0.0, seconds(due_ - newest_arrival_)));
    prepared_ = false;
    if (std::exchange(waited_, false)) return;
    truth_waits_ = true;  // there was no time for it to say so
    session_.serve_hosts();
  }

  Session& session_;
  Host& host_;
  const RealtimeOptions options_;
  TruthIntake& intake_;
  Timeline& timeline_;
  TruthQuality& quality_;
  TruthClock clock_;
  const Nanoseconds preparation_;  // before an instant
  HostTime start_;                 // of the grids
  DeviceTime device_start_;
  HostTime due_;  // of the next samples
  bool prepared_ = false;
  TruthTime sampled_;  // last
  HostTime newest_arrival_;
  HostTime served_;
  TruthTime newest_;     // truth
  Nanoseconds step_{0};  // from the one before
  HostTime begun_;       // the run, when this truth came:
  TruthTime begun_with_;
  bool leapt_ = false;  // not long ago
  std::optional<HostTime> late_since_;
  TruthTime late_from_;
  int late_count_ = 0;
  double rate_ = 1;  // of the simulator, when truth was last in time
  int budget_ = most;
  bool waited_ = false;      // since the last samples left
  bool truth_waits_ = true;  // perhaps
  bool more_ = false;        // and there was more than could be taken
  bool newer_ = false;       // truths were taken, and not looked at together
  bool has_room_ = true;     // for it
};

}  // namespace

void run_realtime(Session& session, Host& host, const RealtimeOptions& options, const std::atomic<bool>& stop) {
  RealtimeLoop loop(session, host, options);
  while (!stop.load(std::memory_order_relaxed)) loop.round();
  session.flush();
}

}  // namespace imud
