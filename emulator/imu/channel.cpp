#include "emulator/imu/channel.hpp"

#include <algorithm>
#include <utility>

#include "emulator/imu/wire_port.hpp"

namespace imud {

Channel::Channel(const ImuConfig& config, std::size_t channel_number, std::uint64_t seed, const Ports& ports,
                 StepSink& sink, std::unique_ptr<ChannelFaults> channel_faults)
    : name(config.name),
      number(static_cast<std::uint16_t>(channel_number)),
      rests_before_truth(config.before_first == BeforeFirst::rest),
      is_can(config.protocol->link == Link::can),
      faults(std::move(channel_faults)),
      sensor(config, seed, faults.get()),
      unit(config, faults.get()),
      lines(config, channel_number, ports, unit.device(), sink),
      awaited(config.model),
      counters(config.protocol->counters) {
  if (config.sync.is_connected()) sync.emplace(config.sync, ports, channel_number, name, sink);
  if (faults) enable_faults(config, seed);
  publish();
}

void Channel::enable_faults(const ImuConfig& config, std::uint64_t seed) {
  lines.enable_faults(config, seed, faults ? faults->configured() : std::span<const FaultConfig>(),
                      faults ? faults->most() : 0);
  unit.enable_faults(config, seed);
}

void Channel::power_on(HostTime origin) noexcept {
  sensor.clock().power_on(origin);
  unit.device().power_on(sensor.clock().now());
  follow_device();
}

void Channel::set_clock(DeviceTime zero, std::optional<HostTime> origin) noexcept {
  unit.step_clock(sensor.clock().set(zero, origin));
}

void Channel::begin_run(std::optional<TruthTime> begin) noexcept {
  if (begin) send_exchanged();  // of the run before
  begin ? sensor.begin_run(*begin) : sensor.pass_over();
  awaited.clear();
  if (sync) sync->begin_run();
}

void Channel::start_device(DeviceTime now) noexcept {
  unit.start(now);
  lines.set_uarts(unit.device());
  follow_device();
}

void Channel::cycle_power(HostTime now) noexcept {
  const bool was_on = unit.is_on();
  if (unit.cycle_power()) {
    sensor.restart();
    start_device(sensor.clock().now(now));
  } else if (was_on && !unit.is_on()) {
    sensor.imu().power_off();
  }
}

void Channel::set_power_faults(std::span<const ActiveFault> faults_of_power) noexcept {
  const Unit::PowerChange change = unit.set_power_faults(faults_of_power);
  if (change == Unit::PowerChange::starts) sensor.restart();
  if (change == Unit::PowerChange::goes_off) sensor.imu().power_off();
}

void Channel::prepare(const std::optional<TruthTime>& truth, bool silent) noexcept {
  if (const OwnSolution* solution = sensor.own_solution()) {
    const auto store = [](const Navigator::Counts& counts, Counter& used, Counter& rejected) {
      used.store(counts.used, std::memory_order_relaxed);
      rejected.store(counts.rejected, std::memory_order_relaxed);
    };
    store(solution->headings(), counters.headings_used, counters.headings_rejected);
    if (const Navigator* navigator = solution->navigator()) {
      store(navigator->fixes(), counters.fixes_used, counters.fixes_rejected);
      store(navigator->antenna_headings(), counters.antenna_headings_used, counters.antenna_headings_rejected);
      store(navigator->heights(), counters.heights_used, counters.heights_rejected);
      store(navigator->rests(), counters.rests_used, counters.rests_rejected);
    }
  }
  const SampleFeed* const feed = awaited.feed();
  Sample& sample = sensor.sample();
  // Each member is set by itself, because a temporary Prepared would be aligned on the stack as `prepared` is. The
  // optional time is set in two steps, because a processor cannot read two values together just after they were
  // written one by one.
  prepared.sample = &sample;
  prepared.truth.reset();
  if (truth) prepared.truth = *truth;
  prepared.is_silent = silent;
  prepared.is_shown = feed != nullptr && feed->wants(number, sample.counter);
  if (faults && !(faults->are_quiet() && unit.is_steady())) set_power_faults(faults->active(FaultSeam::power));
}

void Channel::encode(const Outgoing& outgoing, bool skipped) noexcept {
  outgoing_ = outgoing;
  Sample& sample = *outgoing.sample;
  const DeviceTime time = sample.time;
  is_discarded_ = outgoing.is_silent || skipped;
  if (faults) {
    if (!faults->expectations().empty()) faults->expectations().port_is(lines.all()[0].wire->state_of_port());
    if (!faults->are_quiet()) unit.apply_clock_fault();
  }
  poll_until(time, skipped);
  if (faults && !faults->are_quiet()) lines.set_faults(faults->active(FaultSeam::wire), time);
  if (unit.apply_power_faults()) {
    start_device(time);
    poll_until(time, skipped);
  }
  sensor.clock().take_sample(time);
  if (sync && outgoing.truth && unit.is_on())
    sync->deliver_edges(unit.device(), *outgoing.truth, time);
  else if (sync)
    sync->discard_edges();
  unit.take(sample, is_discarded_);
  if (skipped) counters.skipped.count();
}

void Channel::transmit() noexcept {
  if (sync && outgoing_.truth && unit.is_on()) sync->send_pulse(unit.device());
  send(unit.frames(), outgoing_.sample->time);
}

void Channel::send(std::span<const Frame> frames, DeviceTime time, bool is_reply) noexcept {
  if (paused_)
    counters.paused.count(frames.size());
  else
    lines.send(frames, time, is_reply);
}

void Channel::count_rare_sample() noexcept {
  const Sample& sample = *outgoing_.sample;
  if ((sample.status & status::truth_extrapolated) != 0) counters.extrapolated.count();
  if ((sample.status & status::truth_stale) != 0) counters.held.count();
  if ((sample.status & status::at_rest) != 0) counters.at_rest.count();
  if (outgoing_.is_silent) counters.silent.count();
  const bool is_extrapolated =
      (sample.status & (status::truth_extrapolated | status::truth_stale)) == status::truth_extrapolated;
  if (is_extrapolated || outgoing_.is_shown)
    awaited.add(sensor.imu(), sensor.ahead(), is_extrapolated,
                outgoing_.is_shown ? std::optional(feed_sample()) : std::nullopt);
}

void Channel::poll_due(DeviceTime now, bool too_late) noexcept {
  if (faults) release_until(now, too_late);
  for (auto deadline = unit.deadline(); deadline && *deadline <= now; deadline = unit.deadline()) {
    unit.poll(*deadline);
    follow_device();
    if (!too_late) send(unit.others(), *deadline);
    publish();
  }
}

// Sends the frames that a fault has withheld until now.
void Channel::release_until(DeviceTime now, bool too_late) noexcept {
  while (const auto due = faults->messages().next_release()) {
    const std::optional<Frame> frame = faults->messages().release(now);
    if (!frame) return;
    if (!too_late) send(std::span(&*frame, 1), *due);
  }
}

// Behind frames that are late, and do not leave any more, they would be late, too.
void Channel::send_exchanged() noexcept {
  if (!faults || faults->messages().holds_back()) return;
  send(faults->messages().exchanged(), sensor.sample().time);
  faults->messages().discard();
}

void Channel::receive(Frame frame, std::size_t uart, HostTime now) noexcept {
  const DeviceTime time = sensor.clock().now(now);
  poll_until(time, false);
  if (faults) faults->host_sent(frame.bytes);
  frame.uart = static_cast<std::uint8_t>(uart);
  unit.receive(frame, time);
  if (!unit.is_on()) return;
  follow_device();
  send(unit.others(), time, true);
  lines.set_uarts(unit.device());
  if (!unit.others().empty()) ++reply_count;
}

std::optional<HostTime> Channel::next_wake() const noexcept {
  std::optional<HostTime> first = lines.next_flush();
  const auto wake_at = [&](DeviceTime time) {
    if (const auto at = sensor.clock().host_time(time); at && (!first || *at < *first)) first = at;
  };
  if (const auto deadline = unit.deadline()) wake_at(*deadline);
  if (faults)
    if (const auto due = faults->messages().next_release()) wake_at(*due);
  return first;
}

void Channel::publish() noexcept {
  unpublished_ = 0;
  unit.publish(counters);
  if (sync) counters.edges_refused.store(sync->refused(), std::memory_order_relaxed);
  lines.publish(counters, faults ? faults->messages().lost() : 0);
}

}  // namespace imud
