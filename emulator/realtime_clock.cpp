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
// Truths taken in one go. After a hold-up all that wait, so that no sample is extrapolated while truth is there; but in
// a flood only so many between two samples.
constexpr int most = 4096;
constexpr int most_in_flood = 64;
// How far ahead of what is sampled, less the delay, no network nor clock brings a truth.
constexpr Nanoseconds leap = 250ms;
// Truths that come late for so long are not a hold-up.
constexpr Nanoseconds lasting = 200ms;

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
      // Early if no truth to come will change it, which saves a wake-up.
      if (due_ - now > preparation_ && clock_.truth(due_) > timeline_.newest())
        return wait(std::min(due_ - preparation_, now + patience));
      prepare();
    }
    if (due_ - now > options_.spin) return wait(std::min(due_ - options_.spin, now + patience));
    fire(now);
  }

 private:
  HostTime next_due() const noexcept { return start_ + session_.schedule().next().since_start; }

  // What is prepared need not wait for anything.
  bool is_due() const noexcept { return prepared_ && host_.now() >= due_ - options_.spin; }

  void take_truth() noexcept {
    more_ = has_room_ = true;
    int taken = 0;
    while (more_ && taken < budget_ && !is_due() && (has_room_ = session_.has_room_for_truth(sampled_))) {
      const TruthIntake::Outcome outcome = intake_.take(session_.settled());
      ++taken;
      more_ = outcome != TruthIntake::Outcome::nothing;
      if (outcome == TruthIntake::Outcome::new_run) begin_run();
      if (outcome == TruthIntake::Outcome::accepted) {
        newer_ = true;
        observe();
        session_.follow(sampled_);
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
    if (timeline_.newest() - clock_.truth(newest_arrival_) > leap + nanoseconds(clock_.delay_s())) return resume();
    clock_.observe(timeline_.newest(), newest_arrival_, newest_arrival_);
    quality_.jitter.add(clock_.lateness_s());
  }

  // After a look at all truths that had waited: do they go on coming too late?
  void look_for_pause() noexcept {
    const HostTime now = host_.now();
    if (timeline_.newest() - clock_.truth(now) >= -options_.extrapolate) {
      late_since_.reset();
      rate_ = clock_.used_rate();
    } else if (!late_since_) {
      late_since_ = now;
      late_from_ = timeline_.newest();
    } else if (now - *late_since_ >= lasting) {
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
    newest_arrival_ = intake_.arrival();
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

  // Until `time`, for truth, and for what the hosts send.
  void wait(HostTime time) noexcept {
    constexpr Nanoseconds pause = 1ms;
    session_.flush();
    const std::span<pollfd> inputs = session_.inputs();
    const bool flood = more_ && has_room_;
    if (more_) inputs[0].fd = -1;  // not to be woken by what there is no time or no place for
    if (flood) time = std::min(time, host_.now() + pause);
    waited_ = true;
    const bool come = host_.wait_for_input(inputs, time);
    truth_waits_ = more_ || (come && inputs[0].revents != 0);
    if (!come) {
      if (host_.now() - served_ > patience) {
        session_.serve_hosts();
        served_ = host_.now();
      }
    } else if (!session_.serve_inputs()) {
      host_.sleep_until(std::min(time, host_.now() + pause));
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
  HostTime start_;  // of the grids
  DeviceTime device_start_;
  HostTime due_;       // of the next samples
  bool prepared_ = false;
  TruthTime sampled_;  // last
  HostTime newest_arrival_;
  HostTime served_;
  std::optional<HostTime> late_since_;
  TruthTime late_from_;
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
