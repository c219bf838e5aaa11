#include "emulator/drive/pace.hpp"

namespace imud {

void Pace::transmit(HostTime instant, HostTime due) noexcept {
  if (is_paced_ || engine_.encodes_apart())
    transmit_at(instant, due);
  else
    transmit_at_once(instant);
}

// Out of line, so that transmit() saves none of the registers that this function needs.
[[gnu::noinline]] void Pace::transmit_at(HostTime instant, HostTime due) noexcept {
  engine_.apply(Step::transmit(instant, false));
  if (engine_.encodes_apart()) return;
  if (host_.now() < due) host_.sleep_until(due, options_.spin);
  for (Channel* channel : engine_.prepared()) {
    const HostTime begin = host_.now();
    engine_.sink().set_time(begin);
    channel->transmit();
    channel->counters.lateness.add(seconds(begin - due));
    channel->counters.write.add(seconds(host_.now() - begin));
    if (begin - due >= channel->sensor.grid().period()) channel->counters.missed.count();
  }
}

// Waits for the readers of the ports.
void Pace::transmit_at_once(HostTime instant) noexcept {
  const auto channels = engine_.prepared();
  for (Channel* channel : channels) channel->lines.wait_for_room(stop_);  // frames of deadlines leave first
  engine_.apply(Step::transmit(instant, false));
  for (Channel* channel : channels) {
    channel->lines.wait_for_room(stop_);
    channel->transmit();
  }
  // No reader of a bus catches up later. A log of a bus, which receives nothing, is a file or a pipe.
  for (Channel* channel : channels) {
    const DeviceLine& line = channel->lines.all()[0];
    if (channel->is_can && line.listens && (line.port->wants_output() || channel->lines.next_flush()))
      channel->wait_until_sent(stop_);
  }
}

void Pace::skip(HostTime instant) noexcept { engine_.apply(Step::transmit(instant, true)); }

}  // namespace imud
