#include "emulator/imu/device_line.hpp"

#include <poll.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "transports/host_clock.hpp"

namespace imud {

bool DeviceLine::holds_back() const noexcept {
  const PortCounters& counters = port->counters();
  return counters.sent + counters.dropped != passed;
}

void DeviceLine::add_to_before() noexcept {
  const PortCounters& now = port->counters();
  before.sent += now.sent;
  before.replies += now.replies;
  before.dropped += now.dropped;
  before.failed += now.failed;
  before.connections_refused += now.connections_refused;
  before.bus_errors += now.bus_errors;
  before.error_warnings += now.error_warnings;
  before.error_passives += now.error_passives;
  before.bus_offs += now.bus_offs;
  before.bus_restarts += now.bus_restarts;
  before.refused += now.refused;
}

void DeviceLine::look_for_room() noexcept {
  if (!may_lack_room() || holds_back()) return;
  pollfd room{port->descriptor(), POLLOUT, 0};
  if (room.fd >= 0 && ::poll(&room, 1, 0) == 1 && (room.revents & POLLOUT) != 0) had_room_at = passed;
}

void DeviceLine::wait(bool for_room, const std::atomic<bool>& stop) noexcept {
  constexpr Nanoseconds timeout = std::chrono::seconds(2), step = std::chrono::milliseconds(10);
  if (is_file || (!for_room && !holds_back() && !is_stalled)) return;
  if (port->descriptor() < 0) return;  // a port that is lost
  HostTime progress = host_now();
  std::uint64_t sent = port->counters().sent;
  while (!stop.load(std::memory_order_relaxed)) {
    if (holds_back()) port->flush();
    const bool all_sent = !holds_back();
    pollfd room{port->descriptor(), POLLOUT, 0};
    if (room.fd < 0) return;
    const bool ready = (all_sent && !for_room) || ::poll(&room, 1, 0) != 0;
    if (ready && all_sent) {
      is_stalled = false;
      return;
    }
    const HostTime now = host_now();
    const bool has_sent = std::exchange(sent, port->counters().sent) != port->counters().sent;
    if (has_sent) progress = now;
    is_stalled = is_stalled || now - progress > timeout;
    if (is_stalled) return;
    if (ready && has_sent && !port->next_flush()) continue;  // the reader has made room meanwhile
    // A port that paces its frames is always ready for output.
    const Nanoseconds pause = std::min(step, port->next_flush() ? *port->next_flush() - now : step);
    if (ready)
      ::poll(nullptr, 0, std::max(1, static_cast<int>(pause.count() / 1'000'000)));
    else
      ::poll(&room, 1, static_cast<int>(step.count() / 1'000'000));
  }
}

}  // namespace imud
