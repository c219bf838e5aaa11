#include "emulator/drive/hosts.hpp"

#include <algorithm>

namespace imud {

Hosts::Hosts(Engine& engine, Host* clock) : engine_(engine), clock_(clock) {
  constexpr std::size_t most_ports = 2;
  inputs_.reserve(most_ports * engine.channels().size() + 1);
}

std::span<pollfd> Hosts::inputs(bool truth) noexcept {
  inputs_.clear();
  inputs_.push_back({truth ? engine_.intake().descriptor() : -1, POLLIN, 0});
  for (const auto& channel : engine_.channels())
    for (const DeviceLine& line : channel->lines.all()) {
      const Port& port = *line.port;
      const int events = (port.can_receive() ? POLLIN : 0) | (port.wants_output() ? POLLOUT : 0);
      inputs_.push_back({events != 0 ? port.descriptor() : -1, static_cast<short>(events), 0});
    }
  return inputs_;
}

bool Hosts::serve_inputs(HostTime now) noexcept {
  engine_.sink().set_time(now);
  constexpr int failures = POLLERR | POLLHUP | POLLNVAL;
  bool may_poll = (inputs_[0].revents & failures) == 0;
  auto input = inputs_.begin() + 1;
  for (const auto& channel : engine_.channels()) {
    int seen = 0;
    for (std::size_t i = 0; i < channel->lines.all().size(); ++i) seen |= (input++)->revents;
    if ((seen & failures) != 0) may_poll = false;
    if (seen == 0) continue;
    if ((seen & POLLOUT) != 0) channel->flush();
    if (!serve(*channel, now) && (seen & POLLOUT) == 0) may_poll = false;
  }
  return may_poll;
}

bool Hosts::serve(Channel& channel, HostTime now) noexcept {
  const auto propose = [&](std::size_t uart, const Port::Received& received) {
    const std::uint64_t replies = channel.reply_count;
    engine_.apply(Step::receive(channel.number, uart, now, {.frame = received.frame, .arrival = received.time}));
    if (clock_ != nullptr && channel.reply_count != replies)
      channel.counters.reply.add(std::max(0.0, seconds(clock_->now() - received.time)));
  };
  bool has_received = false;
  const bool may_poll = channel.lines.serve(propose, has_received);
  if (has_received || channel.lines.has_new_state(channel.counters)) channel.publish();
  return may_poll;
}

void Hosts::serve_all(HostTime now) noexcept {
  engine_.sink().set_time(now);
  for (const auto& channel : engine_.channels()) serve(*channel, now);
  engine_.apply(Step::deadlines(now));
}

void Hosts::poll(HostTime now) noexcept {
  engine_.apply(Step::deadlines(now));
  flush();
}

void Hosts::flush() noexcept {
  for (const auto& channel : engine_.channels()) channel->flush();
}

std::optional<HostTime> Hosts::next_wake() const noexcept {
  std::optional<HostTime> first = engine_.intake().deadline();
  for (const auto& channel : engine_.channels())
    if (const auto wake = channel->next_wake(); wake && (!first || *wake < *first)) first = wake;
  return first;
}

}  // namespace imud
