#include "emulator/clock.hpp"

#include <algorithm>

namespace imud {

namespace {

constexpr Nanoseconds patience = std::chrono::milliseconds(20);  // between looks at `stop`

void begin_run(Session& session) noexcept {
  session.schedule().restart();
  session.begin_run();
}

// Emits every sample due up to `limit`, all those of an instant by one call of fire(instant). False if it is time to
// stop.
template <class Fire>
bool emit(Session& session, TruthTime limit, const std::atomic<bool>& stop, Fire&& fire) noexcept {
  while (!stop.load(std::memory_order_relaxed)) {
    const auto due = [&] { return session.timeline().run_start() + session.schedule().next().since_start; };
    const TruthTime instant = due();
    if (instant > limit) return true;
    do session.prepare(instant, DeviceTime{instant.ns});
    while (due() == instant);
    fire(instant);
  }
  return false;
}

}  // namespace

void run_capture(Session& session, Host& host, bool paced, Nanoseconds spin, std::optional<Nanoseconds> limit,
                 const std::atomic<bool>& stop) {
  TruthIntake& intake = session.intake();
  const Timeline& timeline = session.timeline();
  HostTime start;  // of the run
  const auto fire = [&](TruthTime instant) {
    if (!paced) {
      session.wait_for_readers();
      return session.fire();
    }
    const HostTime due = start + (instant - timeline.run_start());
    HostTime now = host.now();
    for (; now < due && !stop.load(std::memory_order_relaxed); now = host.now()) {
      session.flush();
      if (due - now > patience) session.serve_hosts();
      if (const auto line_due = session.due(); line_due && *line_due < std::min(due - spin, now + patience))
        host.sleep_until(*line_due);
      else if (due - now > patience + spin)
        host.sleep_until(now + patience);
      else
        host.sleep_until(due, spin);
    }
    if (now < due) return;
    session.fire(due, [&] { return host.now(); });
    session.serve_hosts();
  };
  while (!stop.load(std::memory_order_relaxed)) {
    const TruthIntake::Outcome outcome = intake.take();
    if (outcome == TruthIntake::Outcome::nothing) {
      if (intake.at_end()) break;
      if (intake.descriptor() >= 0) host.wait_for_input(session.inputs().first(1), host.now() + patience);  // a fifo
      continue;
    }
    if (outcome == TruthIntake::Outcome::ignored) continue;
    if (outcome == TruthIntake::Outcome::new_run) {
      begin_run(session);
      start = host.now();
    }
    TruthTime until = timeline.newest();
    if (limit) until = std::min(until, timeline.run_start() + *limit);
    if (!emit(session, until, stop, fire)) break;
    if (until < timeline.newest()) break;
    session.follow(until);
  }
  session.flush();
}

void run_lockstep(Session& session, Host& host, const std::atomic<bool>& stop) {
  TruthIntake& intake = session.intake();
  const auto fire = [&](TruthTime) {
    session.wait_for_readers();
    session.fire();
  };
  while (!stop.load(std::memory_order_relaxed)) {
    const TruthIntake::Outcome outcome = intake.take();
    if (outcome == TruthIntake::Outcome::nothing) {
      session.flush();
      if (!host.wait_for_input(session.inputs(), host.now() + patience))
        session.serve_hosts();
      else if (!session.serve_inputs())
        host.sleep_until(host.now() + std::chrono::milliseconds(1));
      continue;
    }
    if (outcome == TruthIntake::Outcome::new_run) begin_run(session);
    const TruthTime newest = session.timeline().newest();
    if (outcome != TruthIntake::Outcome::ignored) {
      if (!emit(session, newest, stop, fire)) break;
      session.follow(newest);
    }
    if (!intake.answer_due()) continue;
    session.flush();  // whoever has the answer has the samples
    intake.answer(newest, session.samples_in_run());
  }
  session.flush();
}

}  // namespace imud
