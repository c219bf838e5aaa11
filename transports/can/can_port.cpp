#include "transports/can/can_port.hpp"

#include <linux/can/error.h>
#include <sys/resource.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "transports/can/can_bits.hpp"
#include "transports/can/can_dlc.hpp"

namespace imud {
namespace {

// Returns the highest rate at which frames may leave to a virtual interface without loss, frames/s; nullopt:
// unlimited. The default without a bit rate is 5000: then a receiver's default buffer of 277 frames lasts for 55
// ms.
std::optional<double> max_frames_per_s(const PortSpec& spec) {
  if (spec.text(frames_per_s_option.key) == frames_per_s_option.choices) return std::nullopt;
  return static_cast<double>(
      spec.integer(frames_per_s_option)
          .value_or(spec.text(bitrate_option.key).has_value() ? frames_per_s_option.max : 5000));
}

Nanoseconds max_age(const PortSpec& spec, Delivery delivery) {
  const std::int64_t age_ms = spec.integer(max_age_option).value_or(100);
  return delivery == Delivery::complete ? Nanoseconds::max() : std::chrono::milliseconds(age_ms);
}

// Gives the thread the lowest priority, for as long as it lives: a receiver on the same processor then runs as soon
// as a frame has come, and not when its buffer is full. An error only leaves the priority as it is.
void yield_to_receivers() noexcept {
  constexpr int lowest = 19;
  ::setpriority(PRIO_PROCESS, 0, lowest);
}

}  // namespace

CanPort::CanPort(const PortSpec& spec, const PortSettings& settings, std::unique_ptr<CanLink> link, bool allows_fd)
    : allows_fd_(allows_fd),
      bus_(spec),
      delivery_(settings.delivery),
      yields_(settings.yields),
      may_collect_(settings.collects),
      virtual_frames_per_s_(delivery_ == Delivery::complete ? max_frames_per_s(spec) : std::nullopt),
      link_(std::move(link)),
      queue_(max_age(spec, delivery_)) {}

void CanPort::send(std::span<const Frame> frames) noexcept {
  if (queue_.room() < frames.size()) flush();
  if (!is_connected() || queue_.room() < frames.size()) {
    counters_.dropped += frames.size();
    return;
  }
  CanQueue::Queued queued{};
  queued.first = true;
  queued.is_reply = is_reply_;
  // If no frame is dropped or paced, the time is needed only while the interface is full.
  const bool is_timed = delivery_ == Delivery::timely || max_frames_per_s_.has_value() || queue_.is_interface_full();
  queued.since = is_timed ? host_now() : HostTime{};
  for (const Frame& frame : frames) {
    if (!pack(frame, queued)) {
      ++counters_.dropped;
      continue;
    }
    queue_.push(queued);
    queued.first = false;
  }
  if (is_collecting() && !is_reply_) return;
  // The time is the time of queuing, not a later one: then no sample is stale at its first attempt, however long
  // this thread is held up.
  send_ready(queued.since);
}

std::optional<Port::Received> CanPort::receive() noexcept {
  // Nothing is read before the collected frames have left: the host may answer them. They leave without a whole batch
  // if the device has become silent.
  if (is_collecting() && !queue_.is_empty()) {
    if (++looks_ < most_looks) return std::nullopt;
    flush();
  }
  looks_ = 0;
  if (!link_->is_bound() && !rebind()) return std::nullopt;
  // The first error may only report that the interface went down.
  constexpr int most_malformed = 256;  // in one call, so that the caller can do other work
  for (int failures = 0, malformed = 0; failures < 2 && malformed < most_malformed && link_->is_bound();) {
    CanLink::Received received;
    const int count = link_->receive(incoming_, received);
    if (count == 0) break;
    if (count < 0) {
      ++failures;
      bus_off_ = false;
      lose(errno);
    } else if (received.malformed) {
      ++malformed;
      ++counters_.not_ours;
    } else if (received.own) {
      confirm(received);
    } else {
      return unpack(received);
    }
  }
  return std::nullopt;
}

std::optional<Port::Confirmation> CanPort::next_confirmation() noexcept {
  if (confirmation_count_ == 0) return std::nullopt;
  return confirmations_[(confirmations_end_ + max_confirmations - confirmation_count_--) % max_confirmations];
}

int CanPort::bind() noexcept {
  if (const int error = link_->bind(); error != 0) return error;
  bus_off_ = false;
  bus_state_ = PortState::ready;
  update_mtu();
  is_virtual_ = link_->is_virtual();
  max_frames_per_s_ = is_virtual_ ? virtual_frames_per_s_ : std::nullopt;
  if (is_virtual_ && yields_) yield_to_receivers();
  collects_ = is_virtual_ && may_collect_ && !max_frames_per_s_;
  if (const int down = link_->pending_error(); down != 0)
    lose(down);
  else
    state_ = PortState::ready;
  return 0;
}

void CanPort::await() noexcept { lose(ENODEV); }

bool CanPort::is_connected() noexcept {
  if (!link_->is_bound() && !rebind()) return false;
  // In bus-off the kernel takes frames and discards them. Bus-off ends by a restart, which receive() finds, or
  // when the interface is taken down and up, which the socket reports.
  if (bus_off_ && link_->pending_error() == 0) return false;
  bus_off_ = false;
  if (state_ == PortState::lost) update_mtu();
  return true;
}

void CanPort::send_ready(HostTime now) noexcept {
  output_full_ = false;
  counters_.dropped += queue_.drop_stale(now);
  while (const std::size_t count = std::min(queue_.ready(now), batch_.size())) {
    for (std::size_t i = 0; i < count; ++i) batch_[i] = {&queue_[i].frame, queue_[i].fd};
    const std::span<const CanLink::Message> batch(batch_.data(), count);
    int taken = link_->send(batch);
    // The first call fails if the interface went down, perhaps long ago: try again.
    if (taken < 0 && errno == ENETDOWN) taken = link_->send(batch);
    if (taken < 0) {
      if (handle_refusal(errno)) continue;
      return;
    }
    state_ = bus_state_;
    for (int i = 0; i < taken; ++i) counters_.count_sent(queue_[static_cast<std::size_t>(i)].is_reply);
    queue_.sent(static_cast<std::size_t>(taken), now);
  }
}

void CanPort::lose(int error) noexcept {
  if (state_ != PortState::lost) ++counters_.lost_count;
  state_ = PortState::lost;
  bus_state_ = PortState::ready;  // the state of a controller that starts again
  counters_.dropped += queue_.clear();
  if (error != ENODEV && error != ENXIO) return;  // the interface is down, and the socket still bound
  link_->unbind();
  back_off_.start();
}

bool CanPort::handle_refusal(int error) noexcept {
  if (error == EINVAL || error == EMSGSIZE) {  // an FD frame, and the MTU was changed
    update_mtu();
    queue_.drop_first();
    ++counters_.dropped;
    return true;
  }
  if (error == ENOBUFS)  // the interface's queue is full, which poll() does not report
    queue_.interface_full(host_now());
  else if (error == EAGAIN)  // the socket's send buffer is full
    output_full_ = true;
  else
    lose(error);
  return false;
}

bool CanPort::pack(const Frame& frame, CanQueue::Queued& queued) const noexcept {
  const CanHeader& header = frame.can;
  const std::size_t limit = header.fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN;
  if (frame.bytes.size() > limit || (header.error && !is_virtual_) || (header.fd && (header.remote || !carries_fd_)))
    return false;
  const canid_t ids = header.error ? CAN_ERR_MASK : header.extended ? CAN_EFF_MASK : CAN_SFF_MASK;
  if (header.id > ids) return false;

  canfd_frame& out = queued.frame;
  out = {};
  out.can_id = header.id | (header.extended ? CAN_EFF_FLAG : 0) | (header.remote ? CAN_RTR_FLAG : 0) |
               (header.error ? CAN_ERR_FLAG : 0);
  out.len = static_cast<std::uint8_t>(header.fd ? fd_length(frame.bytes.size()) : frame.bytes.size());
  if (header.fd) out.flags = static_cast<std::uint8_t>(CANFD_FDF | (header.bit_rate_switch ? CANFD_BRS : 0));
  std::memcpy(out.data, frame.bytes.data(), frame.bytes.size());
  queued.fd = header.fd;
  queued.spacing = max_frames_per_s_
                       ? nanoseconds(std::max(1.0 / *max_frames_per_s_, bus_.seconds(most_can_bits(header, out.len))))
                       : Nanoseconds{0};
  return true;
}

CanHeader CanPort::header_of(bool fd) const noexcept {
  const canid_t id = incoming_.can_id;
  CanHeader header;
  header.error = (id & CAN_ERR_FLAG) != 0;
  header.extended = (id & CAN_EFF_FLAG) != 0 && !header.error;
  header.remote = (id & CAN_RTR_FLAG) != 0;
  header.id = id & (header.error ? CAN_ERR_MASK : header.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
  header.fd = fd;
  header.bit_rate_switch = fd && (incoming_.flags & CANFD_BRS) != 0;
  return header;
}

void CanPort::take_error(canid_t id) noexcept {
  ++counters_.bus_errors;
  if ((id & CAN_ERR_BUSOFF) != 0 && !std::exchange(bus_off_, true)) ++counters_.bus_offs;
  if ((id & CAN_ERR_RESTARTED) != 0) {
    ++counters_.bus_restarts;
    bus_off_ = false;
    bus_state_ = PortState::ready;
  }
  if ((id & CAN_ERR_CRTL) == 0) return;
  const unsigned status = incoming_.data[1];
  if ((status & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0)
    enter(PortState::error_passive, counters_.error_passives);
  else if ((status & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0)
    enter(PortState::error_warning, counters_.error_warnings);
  else if ((status & CAN_ERR_CRTL_ACTIVE) != 0)
    bus_state_ = PortState::ready;
}

void CanPort::enter(PortState state, std::uint64_t& times) noexcept {
  if (std::exchange(bus_state_, state) != state) ++times;
}

void CanPort::confirm(const CanLink::Received& received) noexcept {
  confirmations_[confirmations_end_] = {header_of(received.fd), received.time};
  confirmations_end_ = (confirmations_end_ + 1) % max_confirmations;
  confirmation_count_ = std::min(confirmation_count_ + 1, max_confirmations);
}

Port::Received CanPort::unpack(const CanLink::Received& received) noexcept {
  const CanHeader header = header_of(received.fd);
  ++counters_.received;
  if (header.error)
    take_error(header.id);
  else
    bus_off_ = false;
  if (bus_off_)
    lose(ENETDOWN);
  else if (state_ != PortState::lost || link_->is_up())
    state_ = bus_state_;
  const std::size_t size = std::min<std::size_t>(incoming_.len, CANFD_MAX_DLEN);
  return {{std::as_bytes(std::span(incoming_.data, size)), header}, received.time};
}

}  // namespace imud
