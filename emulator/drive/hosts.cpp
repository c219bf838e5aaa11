#include "emulator/drive/hosts.hpp"

#include <algorithm>
#include <utility>

namespace imud {

Hosts::Hosts(Engine& engine, Host& host, bool is_paced)
    : engine_(engine),
      host_(host),
      is_paced_(is_paced),
      is_touched_(engine.channels().size(), true),
      wakes_(engine.channels().size()),
      seen_(engine.channels().size()) {
  host.reserve_inputs(1 + most_lines * engine.channels().size());
  touch_all();
}

void Hosts::touch_all() noexcept {
  std::ranges::fill(is_touched_, true);
  has_touched_ = true;
  // A reload exchanges ports, and touches all imus.
  are_there_ = std::ranges::any_of(engine_.channels(), [](const auto& channel) {
    return !channel->lines.copies().empty() || std::ranges::any_of(channel->lines.all(), &DeviceLine::listens);
  });
}

void Hosts::watch(const Channel& channel, bool again) noexcept {
  const std::span<const DeviceLine> lines = channel.lines.all();
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const Port& port = *lines[i].port;
    const int events = (lines[i].listens ? POLLIN : 0) | (port.wants_output() ? POLLOUT : 0);
    host_.watch(input_of(channel, i), port.descriptor(), static_cast<short>(events), again);
  }
}

void Hosts::settle(HostTime now) noexcept {
  const std::optional<HostTime> wake = next_wake();
  // Where truth paces the run, a deadline has no host time.
  const bool is_due = !is_paced_ || (wake && *wake <= now);
  if (is_due) {
    engine_.apply(Step::deadlines(now));
    touch_all();
  }
  if (!std::exchange(has_touched_, false)) return;
  for (const auto& channel : engine_.channels()) {
    if (!std::exchange(is_touched_[channel->number], false)) continue;
    channel->flush();
    if (!is_paced_)
      for (DeviceLine& line : channel->lines.all()) line.look_for_room();
    wakes_[channel->number] = channel->next_wake();
    watch(*channel, false);
  }
}

std::optional<HostTime> Hosts::next_wake() const noexcept {
  std::optional<HostTime> first = engine_.intake().deadline();
  for (const auto& wake : wakes_)
    if (wake && (!first || *wake < *first)) first = wake;
  return first;
}

bool Hosts::wait(HostTime until, bool truth, Nanoseconds spin) noexcept {
  // While no truth can be taken, its arrival must not end the wait.
  host_.watch(0, engine_.intake().descriptor(), truth ? POLLIN : 0, false);
  ready_ = host_.wait_for_input(until, spin);
  return std::ranges::any_of(ready_, [](const Host::Ready& one) { return one.input == 0; });
}

bool Hosts::serve_ready(HostTime now) noexcept {
  if (ready_.empty()) return true;
  engine_.sink().set_time(now);
  constexpr int failures = POLLERR | POLLHUP | POLLNVAL;
  bool may_wait = true;
  for (const auto& [input, events] : ready_) {
    if ((events & failures) != 0) may_wait = false;
    if (input > 0) seen_[(input - 1) / most_lines] |= events;
  }
  for (const Host::Ready& one : ready_) {
    if (one.input == 0) continue;
    const std::size_t imu = (one.input - 1) / most_lines;
    const short seen = std::exchange(seen_[imu], short{0});
    if (seen == 0) continue;  // by the imu's other line
    Channel& channel = *engine_.channels()[imu];
    if ((seen & POLLOUT) != 0) channel.flush();
    if (!serve(channel, now) && (seen & POLLOUT) == 0) may_wait = false;
  }
  return may_wait;
}

bool Hosts::serve(Channel& channel, HostTime now) noexcept {
  const auto propose = [&](std::size_t uart, const Port::Received& received) {
    const std::uint64_t replies = channel.reply_count;
    engine_.apply(Step::receive(channel.number, uart, now, {.frame = received.frame, .arrival = received.time}));
    if (is_paced_ && channel.reply_count != replies)
      channel.counters.reply.add(std::max(0.0, seconds(host_.now() - received.time)));
  };
  touch(channel);
  bool has_received = false;
  const bool may_wait = channel.lines.serve(propose, has_received);
  if (has_received || channel.lines.has_new_state(channel.counters)) channel.publish();
  return may_wait;
}

void Hosts::serve_all(HostTime now) noexcept {
  engine_.sink().set_time(now);
  for (const auto& channel : engine_.channels()) serve(*channel, now);
  engine_.apply(Step::deadlines(now));
  for (const auto& channel : engine_.channels()) watch(*channel, true);
  host_.watch(0, engine_.intake().descriptor(), POLLIN, true);
}

void Hosts::flush() noexcept {
  for (const auto& channel : engine_.channels()) channel->flush();
  touch_all();
}

}  // namespace imud
