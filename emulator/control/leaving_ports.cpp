#include "emulator/control/leaving_ports.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <thread>
#include <utility>

#include "emulator/config/load_config.hpp"
#include "emulator/imu/channel.hpp"

namespace imud {

void LeavingPorts::add(Reload& reload, std::span<const std::unique_ptr<Channel>> channels) {
  for (Reload::Line& line : reload.lines) {
    if (line.port == nullptr) continue;
    const PortCounters before = line.port->counters();
    Channel* channel = channels[line.channel].get();
    all_.push_back({std::move(line), channel, before, host_now() + longest});
  }
  reload.lines.clear();
  update();
}

void LeavingPorts::update() {
  const HostTime now = host_now();
  std::erase_if(all_, [&](Leaving& leaving) {
    if (!has_left(leaving) && now < leaving.last) return false;
    close(leaving);
    return true;
  });
}

void LeavingPorts::finish() {
  using namespace std::chrono_literals;
  for (Leaving& leaving : all_) leaving.last = std::min(leaving.last, host_now() + 50ms);
  for (update(); !all_.empty(); update()) std::this_thread::sleep_for(1ms);
}

bool LeavingPorts::has(const std::string& port) const {
  const std::string address = exclusive_address(port);
  return !address.empty() && std::any_of(all_.begin(), all_.end(), [&](const Leaving& leaving) {
    return exclusive_address(leaving.line.before) == address;
  });
}

bool LeavingPorts::has_left(Leaving& leaving) noexcept {
  Port& port = *leaving.line.port;
  const bool is_drained = port.is_drained();
  port.flush();
  const PortCounters &now = port.counters(), &before = leaving.before;
  return is_drained && now.sent + now.dropped - before.sent - before.dropped >= leaving.line.held;
}

// Frames of other senders count as sent or dropped first (WirePort).
void LeavingPorts::close(Leaving& leaving) {
  Port& port = *leaving.line.port;
  port.discard_pending();
  try {
    port.commit();
  } catch (const std::exception& error) {
    spdlog::error("{}: {}", leaving.channel->name, error.what());
  }
  const PortCounters &now = port.counters(), &before = leaving.before;
  std::uint64_t others = leaving.line.held_of_others;
  const auto own = [&others](std::uint64_t frames) {
    const std::uint64_t skipped = std::min(frames, others);
    others -= skipped;
    return frames - skipped;
  };
  const std::uint64_t sent = own(now.sent - before.sent), dropped = own(now.dropped - before.dropped);
  Lines::Replaced& replaced = leaving.channel->lines.replaced();
  replaced.sent.fetch_add(sent, std::memory_order_relaxed);
  replaced.replies.fetch_add(std::min(now.replies - before.replies, sent), std::memory_order_relaxed);
  replaced.dropped.fetch_add(dropped, std::memory_order_relaxed);
  replaced.failed.fetch_add(std::min(now.failed - before.failed, dropped), std::memory_order_relaxed);
  leaving.line.port.reset();
}

}  // namespace imud
