#include "emulator/clock.hpp"

#include <poll.h>
#include <sys/prctl.h>
#include <time.h>

#include <algorithm>

#include "transports/host_clock.hpp"

namespace imud {

namespace {

constexpr Nanoseconds patience = std::chrono::milliseconds(20);  // between looks at `stop`

timespec to_timespec(std::int64_t ns) { return {ns / 1'000'000'000, ns % 1'000'000'000}; }

void sleep_until(HostTime time) {
  const timespec at = to_timespec(time.ns);
  ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr);
}

// Until `time`, or input on `descriptor`.
void wait_for_input(int descriptor, HostTime time) {
  const Nanoseconds left = std::max(time - host_now(), Nanoseconds{0});
  pollfd input{descriptor, POLLIN, 0};
  const timespec at_most = to_timespec(left.count());
  ::ppoll(&input, 1, &at_most, nullptr);
}

// The kernel otherwise may add 50 us to every wait of an ordinary thread.
void ask_for_exact_timers() { ::prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL); }

// Where the truth's time lies on the host's.
class HostMap {
 public:
  void anchor(TruthTime truth, HostTime host) {
    truth_ = truth;
    host_ = host;
  }
  HostTime host(TruthTime t) const { return host_ + (t - truth_); }
  TruthTime truth(HostTime t) const { return truth_ + (t - host_); }

 private:
  TruthTime truth_;
  HostTime host_;
};

class SleepingPace final : public Pace {
 public:
  SleepingPace(const HostMap& map, Session& session, const std::atomic<bool>& stop)
      : map_(map), session_(session), stop_(stop) {}

  bool wait(TruthTime due, Nanoseconds& lateness) noexcept override {
    const HostTime at = map_.host(due);
    HostTime now = host_now();
    if (now < at) session_.flush();
    while (now < at) {
      if (stop_.load(std::memory_order_relaxed)) return false;
      if (at - now > patience) session_.serve_hosts();
      sleep_until(std::min(at, now + patience));
      now = host_now();
    }
    lateness = now - at;
    return !stop_.load(std::memory_order_relaxed);
  }

 private:
  const HostMap& map_;
  Session& session_;
  const std::atomic<bool>& stop_;
};

class MeasuringPace final : public Pace {
 public:
  explicit MeasuringPace(const HostMap& map) : map_(map) {}
  bool wait(TruthTime due, Nanoseconds& lateness) noexcept override {
    lateness = host_now() - map_.host(due);
    return true;
  }

 private:
  const HostMap& map_;
};

}  // namespace

void run_capture(Session& session, bool paced, std::optional<Nanoseconds> limit, const std::atomic<bool>& stop) {
  ask_for_exact_timers();
  HostMap map;
  SleepingPace pace(map, session, stop);
  TruthIntake& intake = session.intake();
  while (!stop.load(std::memory_order_relaxed)) {
    const TruthIntake::Outcome outcome = intake.take();
    if (outcome == TruthIntake::Outcome::nothing) {
      if (intake.at_end()) break;
      if (intake.descriptor() >= 0) wait_for_input(intake.descriptor(), host_now() + patience);  // a fifo
      continue;
    }
    if (outcome == TruthIntake::Outcome::ignored) continue;
    const Timeline& timeline = session.timeline();
    if (outcome == TruthIntake::Outcome::new_run) {
      session.begin_run(timeline.run_start());
      map.anchor(timeline.run_start(), host_now());
    }
    TruthTime until = timeline.newest();
    if (limit) until = std::min(until, timeline.run_start() + *limit);
    if (!session.advance(until, paced ? &pace : nullptr)) break;
    if (until < timeline.newest()) break;
    session.follow();
  }
  session.flush();
}

void run_lockstep(Session& session, const std::atomic<bool>& stop) {
  TruthIntake& intake = session.intake();
  while (!stop.load(std::memory_order_relaxed)) {
    const TruthIntake::Outcome outcome = intake.take();
    if (outcome == TruthIntake::Outcome::nothing) {
      session.flush();
      session.serve_hosts();
      wait_for_input(intake.descriptor(), host_now() + patience);
      continue;
    }
    if (outcome == TruthIntake::Outcome::new_run) session.begin_run(session.timeline().run_start());
    if (outcome != TruthIntake::Outcome::ignored) {
      if (!session.advance(session.timeline().newest(), nullptr)) break;
      session.follow();
    }
    if (intake.answer_due()) intake.answer(session.timeline().newest(), session.samples_in_run());
  }
  session.flush();
}

void run_realtime(Session& session, Nanoseconds delay, Nanoseconds extrapolate, const std::atomic<bool>& stop) {
  ask_for_exact_timers();
  constexpr int most = 64;  // truths between two looks at the clock, so that a flood delays no sample for long
  constexpr Nanoseconds jump = std::chrono::seconds(1);
  HostMap map;
  MeasuringPace pace(map);
  TruthIntake& intake = session.intake();
  const Timeline& timeline = session.timeline();
  while (!stop.load(std::memory_order_relaxed)) {
    bool more = true;  // truth waits
    bool room = true;
    bool accepted = false;
    for (int i = 0; i < most && more && (room = session.has_room_for_truth()); ++i) {
      const TruthIntake::Outcome outcome = intake.take();
      more = outcome != TruthIntake::Outcome::nothing;
      if (outcome == TruthIntake::Outcome::new_run) {
        session.begin_run(timeline.run_start());
        map.anchor(timeline.run_start(), intake.arrival() + delay);
      }
      if (outcome == TruthIntake::Outcome::accepted) {
        accepted = true;
        session.follow();
      }
      if (intake.answer_due()) intake.answer(timeline.newest(), session.samples_in_run());
    }
    if (accepted && !more) {
      // A simulator that paused, runs slow, or jumped: its motion would be held, or stretched, from here on.
      const HostTime now = host_now();
      const Nanoseconds ahead = timeline.newest() - map.truth(now + delay);
      if (ahead < -(delay + extrapolate) || ahead > jump) {
        intake.count_resumed();
        session.begin_run(timeline.newest());
        map.anchor(timeline.newest(), now + delay);
      }
    }
    if (!session.in_run()) {
      session.serve_hosts();
      wait_for_input(intake.descriptor(), host_now() + patience);
      continue;
    }
    // While truth waits, no sample is extrapolated: after a hold-up it is all there.
    const TruthTime now = map.truth(host_now());
    if (!session.advance(more ? std::min(now, timeline.newest()) : now, &pace)) break;
    session.flush();
    const HostTime wake = std::min(host_now() + patience, map.host(session.next_due()));
    if (!room)
      sleep_until(wake);
    else if (!more)
      wait_for_input(intake.descriptor(), wake);
  }
  session.flush();
}

}  // namespace imud
