#include "emulator/channel.hpp"

#include <poll.h>

#include <algorithm>
#include <utility>

#include "transports/host_clock.hpp"

namespace imud {

Channel::Channel(const ImuConfig& config, std::uint64_t seed, const Sync::OpenPort& open)
    : name_(config.name),
      grid_(config.grid),
      rests_before_truth_(config.before_first == BeforeFirst::rest),
      is_can_(config.protocol->link == Link::can),
      imu_(config.model, seed, stream_id(config.name)),
      device_(config.protocol->make(config.settings)),
      port_(open(config.port, config.port_settings)),
      clock_(config.grid),
      uart_(device_->uart()) {
  if (config.sync.is_connected()) sync_.emplace(config.sync, open);
  if (is_can_) {
    // The device's own identifiers pass too, so that the port can confirm its frames and the device detects other
    // users.
    std::vector<CanFilter> filters = config.protocol->can_filters(config.settings);
    for (const CanMessage& message : config.protocol->can_messages(config.settings, config.rate_hz))
      filters.push_back({.id = message.can.id, .extended = message.can.extended});
    port_->set_filters(filters);
  }
  publish();
}

void Channel::power_on(HostTime origin) noexcept {
  clock_.power_on(origin);
  device_->power_on(clock_.now());
}

void Channel::set_clock(DeviceTime zero, std::optional<HostTime> origin) noexcept {
  device_->step_clock(clock_.set(zero, origin));
}

void Channel::begin_run() noexcept {
  if (!is_resting_) imu_.begin_run();  // otherwise the first sample of the truth begins the run
  has_sampled_ = false;
  if (sync_) sync_->begin_run();
}

void Channel::cycle_power(HostTime now) noexcept {
  device_->power_on(clock_.now(now));
  apply_uart();
}

Sample Channel::sense(const Timeline& timeline, TruthTime time, std::uint64_t k) noexcept {
  has_sampled_ = true;
  is_resting_ = false;
  return imu_.sample(timeline, time, clock_.stamp(k));
}

Sample Channel::sense_at_rest(Nanoseconds since_power_on, std::uint64_t k) noexcept {
  is_resting_ = true;
  return imu_.sample_at_rest(since_power_on, clock_.stamp(k));
}

void Channel::prepare(const Sample& sample, std::optional<TruthTime> truth, bool silent) noexcept {
  sample_ = sample;
  truth_ = truth;
  silent_ = silent;
}

void Channel::encode() noexcept {
  poll_until(sample_.time);
  clock_.take_sample(sample_.time);
  frames_.clear();
  others_.clear();
  if (sync_ && truth_)
    sync_->deliver_edges(*device_, *truth_, sample_.time);
  else if (sync_)
    sync_->discard_edges();
  device_->sample(sample_, silent_ ? others_ : frames_);
}

void Channel::transmit() noexcept {
  if (sync_ && truth_) sync_->send_pulse(*device_);
  send(frames_);
}

void Channel::send(const FrameBuffer& frames) noexcept {
  if (frames.frames().empty()) return;
  port_->send(frames.frames());
  passed_ += frames.frames().size();
}

void Channel::record_times(Nanoseconds lateness, Nanoseconds write) noexcept {
  counters_.lateness.add(seconds(lateness));
  counters_.write.add(seconds(write));
  if (lateness >= grid_.period()) counters_.missed.count();
}

void Channel::count_sample() noexcept {
  counters_.samples.count();
  if ((sample_.status & status::truth_extrapolated) != 0) counters_.extrapolated.count();
  if ((sample_.status & status::truth_stale) != 0) counters_.held.count();
  if ((sample_.status & status::at_rest) != 0) counters_.at_rest.count();
  if (silent_) counters_.silent.count();
  publish();
}

void Channel::poll_until(DeviceTime now) noexcept {
  for (auto deadline = device_->deadline(); deadline && *deadline <= now; deadline = device_->deadline()) {
    others_.clear();
    device_->poll(*deadline, others_);
    send(others_);
    publish();
  }
}

bool Channel::serve(HostTime now) noexcept {
  // The limit of one call, so that a flood from the host does not delay samples. Between two calls no line carries
  // as much.
  constexpr std::size_t most = 256, per_frame = 16;
  std::size_t received = 0;
  bool may_wait = false;
  while (received < most) {
    const auto chunk = port_->receive();
    if (!chunk) {
      may_wait = received > 0;
      break;
    }
    received += per_frame + chunk->frame.bytes.size();
    const DeviceTime time = clock_.now(now);
    poll_until(time);
    others_.clear();
    device_->receive(chunk->frame, time, others_);
    if (const auto replies = others_.frames(); !replies.empty()) {
      port_->reply(replies);
      passed_ += replies.size();
      counters_.replies.count(replies.size());
    }
    apply_uart();
  }
  if (received > 0 || port_->state() != counters_.port_state.load(std::memory_order_relaxed)) publish();
  return may_wait;
}

// A device answers with its old settings; the new ones apply to all that is sent afterwards.
void Channel::apply_uart() noexcept {
  const UartSettings uart = device_->uart();
  if (uart == uart_) return;
  uart_ = uart;
  port_->set_line(uart);
}

void Channel::publish() noexcept {
  const PortCounters& port = port_->counters();
  counters_.frames.store(port.sent, std::memory_order_relaxed);
  counters_.dropped.store(port.dropped, std::memory_order_relaxed);
  counters_.failed.store(port.failed, std::memory_order_relaxed);
  counters_.port_error.store(port_->error(), std::memory_order_relaxed);
  if (sync_) counters_.edges_refused.store(sync_->refused(), std::memory_order_relaxed);
  counters_.speeds.store(port_->speeds(), std::memory_order_relaxed);
  counters_.port_state.store(port_->state(), std::memory_order_release);
}

bool Channel::holds_back() const noexcept {
  const PortCounters& port = port_->counters();
  return port.sent + port.dropped != passed_;
}

void Channel::wait_until_sent(const std::atomic<bool>& stop) noexcept {
  constexpr Nanoseconds timeout = std::chrono::seconds(2), step = std::chrono::milliseconds(10);
  if (port_->descriptor() < 0) return;  // a file, which accepts everything, or a port that is lost
  HostTime progress = host_now();
  std::uint64_t sent = port_->counters().sent;
  while (!stop.load(std::memory_order_relaxed)) {
    if (holds_back()) port_->flush();
    pollfd room{port_->descriptor(), POLLOUT, 0};
    if (room.fd < 0) return;
    const bool ready = ::poll(&room, 1, 0) != 0;
    if (ready && !holds_back()) {
      is_stalled_ = false;
      return;
    }
    const HostTime now = host_now();
    if (std::exchange(sent, port_->counters().sent) != port_->counters().sent) progress = now;
    is_stalled_ = is_stalled_ || now - progress > timeout;
    if (is_stalled_) return;
    // A port that paces its frames is always ready for output.
    const Nanoseconds pause = std::min(step, port_->next_flush() ? *port_->next_flush() - now : step);
    if (ready)
      ::poll(nullptr, 0, std::max(1, static_cast<int>(pause.count() / 1'000'000)));
    else
      ::poll(&room, 1, static_cast<int>(step.count() / 1'000'000));
  }
}

void Channel::flush() noexcept {
  if (!holds_back()) return;
  port_->flush();
  publish();
}

std::optional<HostTime> Channel::next_wake() const noexcept {
  std::optional<HostTime> first = port_->next_flush();
  if (const auto deadline = device_->deadline())
    if (const auto at = clock_.host_time(*deadline); at && (!first || *at < *first)) first = at;
  return first;
}

void Channel::discard_pending() noexcept {
  port_->discard_pending();
  publish();
}

std::optional<TruthTime> Channel::used_until() const noexcept {
  return has_sampled_ ? std::optional(imu_.advanced_to()) : std::nullopt;
}

}  // namespace imud
