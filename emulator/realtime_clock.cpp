#include <algorithm>

#include "emulator/clock.hpp"

namespace imud {

namespace {

using namespace std::chrono_literals;

constexpr Nanoseconds patience = 20ms;  // between looks at `stop`
// Before an instant and the spinning, for all that has to be done before it.
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
        lead_(options.spin + preparation) {}

  void round() noexcept {
    take_truth();
    const HostTime now = host_.now();
    if (!session_.in_run()) return wait(now + patience);
    const HostTime due = next_due();
    if (due - now > lead_) return wait(std::min(due - lead_, now + patience));
    emit(now, due);
  }

 private:
  HostTime next_due() const noexcept { return start_ + session_.schedule().next().since_start; }

  void take_truth() noexcept {
    more_ = has_room_ = true;
    bool newer = false;
    int taken = 0;
    while (more_ && taken < budget_ && (has_room_ = session_.has_room_for_truth(sampled_))) {
      const TruthIntake::Outcome outcome = intake_.take(session_.settled());
      ++taken;
      more_ = outcome != TruthIntake::Outcome::nothing;
      if (outcome == TruthIntake::Outcome::new_run) begin_run();
      if (outcome == TruthIntake::Outcome::accepted) {
        newer = true;
        newest_arrival_ = intake_.arrival();
        clock_.observe(timeline_.newest(), newest_arrival_, newest_arrival_);
        quality_.jitter.add(clock_.lateness_s());
        session_.follow(sampled_);
      }
      if (intake_.answer_due()) intake_.answer(timeline_.newest(), session_.samples_in_run());
    }
    budget_ = more_ ? std::max(most_in_flood, budget_ - taken) : most;
    if (newer && !more_) look_for_leap();
    if (newer) publish();
  }

  void begin_run() noexcept {
    newest_arrival_ = intake_.arrival();
    const HostTime begin = clock_.begin(timeline_.newest(), newest_arrival_);
    if (!session_.in_run()) {
      start_ = begin;
      device_start_ = DeviceTime{timeline_.newest().ns};
    }
    sampled_ = timeline_.newest();
    session_.begin_run();
    late_since_.reset();
    publish();
  }

  void look_for_leap() noexcept {
    const HostTime now = host_.now();
    const Nanoseconds ahead = timeline_.newest() - clock_.truth(now);
    const bool leapt = ahead > leap + nanoseconds(clock_.delay_s());
    const bool late = ahead < -options_.extrapolate;
    if (!late) late_since_.reset();
    if (late && !late_since_) late_since_ = now;
    if (!leapt && !(late && now - *late_since_ >= lasting)) return;
    quality_.resumed.fetch_add(1, std::memory_order_relaxed);
    timeline_.forget_past();
    begin_run();
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
    if (!host_.wait_for_input(inputs, time)) {
      if (host_.now() - served_ > patience) {
        session_.serve_hosts();
        served_ = host_.now();
      }
    } else if (!session_.serve_inputs()) {
      host_.sleep_until(std::min(time, host_.now() + pause));
    }
  }

  // All samples of one instant.
  void emit(HostTime now, HostTime due) noexcept {
    sampled_ = clock_.use(due);
    do {
      const Schedule::Instant next = session_.schedule().next();
      const Grid& grid = session_.schedule().grid(next.imu);
      session_.prepare(sampled_, device_start_ + grid.nominal_offset(next.index));
    } while (next_due() == due);
    if (now < due) host_.sleep_until(due, options_.spin);
    session_.fire(due, [this] { return host_.now(); });
    quality_.age.add(std::max(0.0, seconds(due - newest_arrival_)));
  }

  Session& session_;
  Host& host_;
  const RealtimeOptions options_;
  TruthIntake& intake_;
  Timeline& timeline_;
  TruthQuality& quality_;
  TruthClock clock_;
  const Nanoseconds lead_;
  HostTime start_;  // of the grids
  DeviceTime device_start_;
  TruthTime sampled_;  // last
  HostTime newest_arrival_;
  HostTime served_;
  std::optional<HostTime> late_since_;
  int budget_ = most;
  bool more_ = true;      // truth may wait
  bool has_room_ = true;  // for it
};

}  // namespace

void run_realtime(Session& session, Host& host, const RealtimeOptions& options, const std::atomic<bool>& stop) {
  RealtimeLoop loop(session, host, options);
  while (!stop.load(std::memory_order_relaxed)) loop.round();
  session.flush();
}

}  // namespace imud
