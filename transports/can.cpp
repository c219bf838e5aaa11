// SocketCAN, raw. https://docs.kernel.org/networking/can.html, linux/can/raw.h, linux/can/error.h.
#include <fmt/format.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <net/if.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "transports/can_bits.hpp"
#include "transports/can_bus.hpp"
#include "transports/can_dlc.hpp"
#include "transports/can_queue.hpp"
#include "transports/can_socket.hpp"
#include "transports/host_clock.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

constexpr PortOption mtu_option = {
    .key = "mtu", .help = "16: classic frames only; 72: CAN FD is required", .choices = "any 16 72"};
constexpr PortOption frames_per_s_option = {
    .key = "frames_per_s",
    .help = "fast, lockstep: highest rate of frames to a virtual interface (5000, or that of `bitrate`)",
    .min = 1,
    .max = 1'000'000,
    .choices = "unlimited"};
constexpr PortOption max_age_option = {.key = "max_age_ms",
                                       .help = "realtime: age at which unsent frames are dropped, ms (100)",
                                       .min = 1,
                                       .max = 60'000};
constexpr PortOption confirm_option = {
    .key = "confirm", .help = "the interface confirms each frame that it has sent", .choices = "no yes"};
constexpr PortOption wait_option = {
    .key = "wait", .help = "waits for an interface that does not exist yet", .choices = "no yes"};
constexpr PortOption can_options[] = {bitrate_option, data_bitrate_option, mtu_option, frames_per_s_option,
                                      max_age_option, confirm_option,      wait_option};

// Returns the highest rate at which frames leave to a virtual interface if none may be lost, frames/s; nullopt:
// unlimited. The default without a bit rate is 5000: then a receiver's default buffer of 277 frames lasts for 55 ms.
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

class CanPort final : public Port {
 public:
  CanPort(const PortSpec& spec, Delivery delivery)
      : wanted_mtu_(spec.one_of(mtu_option)),
        bus_(spec),
        delivery_(delivery),
        virtual_frames_per_s_(delivery == Delivery::complete ? max_frames_per_s(spec) : std::nullopt),
        socket_(spec.address, spec.one_of(confirm_option) == "yes"),
        queue_(max_age(spec, delivery)) {
    if (spec.address.size() >= IFNAMSIZ)
      throw spec.error("the name is too long for an interface; right would be a name such as can0");
    if (::if_nametoindex(spec.address.c_str()) == 0) {
      if (spec.one_of(wait_option) == "yes") {
        lose(ENODEV);
        return;
      }
      throw spec.error("there is no such interface; 'ip link' lists the interfaces, and wait=yes waits for it");
    }
    if (const int error = bind(); error == EAFNOSUPPORT || error == EPROTONOSUPPORT)
      throw spec.error("this kernel has no CAN; sudo modprobe can_raw");
    else if (error != 0)
      throw spec.error(fmt::format("cannot be bound: {}; is it a CAN interface?", std::strerror(error)));
    if (wanted_mtu_ == "72" && !carries_fd_)
      throw spec.error(fmt::format("mtu=72: it carries no FD frames; ip link set {} mtu 72", spec.address));
  }

  void send(std::span<const Frame> frames) noexcept override {
    if (queue_.room() < frames.size()) flush();
    if (!is_connected() || queue_.room() < frames.size()) {
      counters_.dropped += frames.size();
      return;
    }
    CanQueue::Queued queued{};
    queued.first = true;
    queued.is_reply = is_reply_;
    // Where nothing is dropped or paced, a bus that takes frames needs no clock.
    const bool is_timed = delivery_ == Delivery::timely || max_frames_per_s_.has_value() || !queue_.is_empty();
    queued.since = is_timed ? host_now() : HostTime{};
    for (const Frame& frame : frames) {
      if (!pack(frame, queued)) {
        ++counters_.dropped;
        continue;
      }
      queue_.push(queued);
      queued.first = false;
    }
    // At this time, not later: then no sample is stale at its first attempt, however long this thread is held up.
    send_ready(queued.since);
  }

  void flush() noexcept override { send_ready(host_now()); }
  // A run that waits for the bus need not ask the socket before each sample.
  bool has_room() const noexcept override {
    return delivery_ == Delivery::complete && queue_.room() >= 2 * FrameBuffer::max_frames;
  }
  std::optional<HostTime> next_flush() const noexcept override { return output_full_ ? std::nullopt : queue_.next(); }
  bool wants_output() const noexcept override { return output_full_ && !queue_.is_empty(); }
  bool is_drained() noexcept override {
    flush();
    return queue_.is_empty();
  }
  void discard_pending() noexcept override { counters_.dropped += queue_.clear(); }

  std::optional<Received> receive() noexcept override {
    if (!socket_.is_bound() && !rebind()) return std::nullopt;
    // The first failure may only report that the interface went down.
    for (int failures = 0; failures < 2 && socket_.is_bound();) {
      CanSocket::Received received;
      const int count = socket_.receive(incoming_, received);
      if (count == 0) break;
      if (count < 0) {
        ++failures;
        bus_off_ = false;
        lose(errno);
      } else if (received.own) {
        confirm(received);
      } else {
        return unpack(received);
      }
    }
    return std::nullopt;
  }
  std::optional<Confirmation> next_confirmation() noexcept override {
    if (confirmation_count_ == 0) return std::nullopt;
    return confirmations_[(confirmations_end_ + max_confirmations - confirmation_count_--) % max_confirmations];
  }
  void set_filters(std::span<const CanFilter> filters) noexcept override { socket_.set_filters(filters); }

  int descriptor() const noexcept override { return socket_.descriptor(); }

 private:
  // Returns 0 or an errno.
  int bind() noexcept {
    if (const int error = socket_.bind(); error != 0) return error;
    bus_off_ = false;
    bus_state_ = PortState::ready;
    update_mtu();
    is_virtual_ = socket_.is_virtual();
    max_frames_per_s_ = is_virtual_ ? virtual_frames_per_s_ : std::nullopt;
    if (const int down = socket_.pending_error(); down != 0)
      lose(down);
    else
      state_ = PortState::ready;
    return 0;
  }
  bool rebind() noexcept { return back_off_.due() && bind() == 0; }

  // Returns false if frames would not reach the bus.
  bool is_connected() noexcept {
    if (!socket_.is_bound() && !rebind()) return false;
    // In bus-off the kernel takes frames and discards them. Bus-off ends by a restart, which receive() finds, or
    // when the interface is taken down and up, which the socket reports.
    if (bus_off_ && socket_.pending_error() == 0) return false;
    bus_off_ = false;
    if (state_ == PortState::lost) update_mtu();
    return true;
  }

  // Sends what may leave at `now`.
  void send_ready(HostTime now) noexcept {
    output_full_ = false;
    counters_.dropped += queue_.drop_stale(now);
    while (const std::size_t count = std::min(queue_.ready(now), batch_.size())) {
      for (std::size_t i = 0; i < count; ++i) batch_[i] = {&queue_[i].frame, queue_[i].fd};
      const std::span<const CanSocket::Message> batch(batch_.data(), count);
      int taken = socket_.send(batch);
      // The first call fails if the interface went down, perhaps long ago: try again.
      if (taken < 0 && errno == ENETDOWN) taken = socket_.send(batch);
      if (taken < 0) {
        if (handle_refusal(errno)) continue;
        return;
      }
      state_ = bus_state_;
      for (int i = 0; i < taken; ++i) counters_.count_sent(queue_[static_cast<std::size_t>(i)].is_reply);
      queue_.sent(static_cast<std::size_t>(taken), now);
    }
  }

  void update_mtu() noexcept { carries_fd_ = socket_.mtu() >= static_cast<int>(CANFD_MTU) && wanted_mtu_ != "16"; }

  // Discards the waiting frames: they would be old when the interface is back.
  void lose(int error) noexcept {
    if (state_ != PortState::lost) ++counters_.lost_count;
    state_ = PortState::lost;
    bus_state_ = PortState::ready;  // which a controller is when it starts again
    counters_.dropped += queue_.clear();
    if (error != ENODEV && error != ENXIO) return;  // the interface is down, and the socket still bound
    socket_.unbind();
    back_off_.start();
  }

  // The kernel has refused the oldest frame that is ready. Returns true if the next one may be tried.
  bool handle_refusal(int error) noexcept {
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

  // Returns false if the interface cannot carry the frame. Error frames are the controller's own; a virtual
  // interface, which has none, passes on those of others.
  bool pack(const Frame& frame, CanQueue::Queued& queued) const noexcept {
    const CanHeader& header = frame.can;
    const std::size_t limit = header.fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN;
    if (frame.bytes.size() > limit || (header.error && !is_virtual_) ||
        (header.fd && (header.remote || !carries_fd_)))
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
    queued.spacing =
        max_frames_per_s_
            ? nanoseconds(std::max(1.0 / *max_frames_per_s_, bus_.seconds(most_can_bits(header, out.len))))
            : Nanoseconds{0};
    return true;
  }

  CanHeader header_of(bool fd) const noexcept {
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

  // Takes the state of the controller from an error frame.
  void take_error(canid_t id) noexcept {
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
  void enter(PortState state, std::uint64_t& times) noexcept {
    if (std::exchange(bus_state_, state) != state) ++times;
  }

  void confirm(const CanSocket::Received& received) noexcept {
    ++counters_.confirmed;
    confirmations_[confirmations_end_] = {header_of(received.fd), received.time};
    confirmations_end_ = (confirmations_end_ + 1) % max_confirmations;
    confirmation_count_ = std::min(confirmation_count_ + 1, max_confirmations);
  }

  Received unpack(const CanSocket::Received& received) noexcept {
    const CanHeader header = header_of(received.fd);
    ++counters_.received;
    if (header.error)
      take_error(header.id);
    else
      bus_off_ = false;
    if (bus_off_)
      lose(ENETDOWN);
    else if (state_ != PortState::lost || socket_.is_up())
      state_ = bus_state_;
    const std::size_t size = std::min<std::size_t>(incoming_.len, CANFD_MAX_DLEN);
    return {{std::as_bytes(std::span(incoming_.data, size)), header}, received.time};
  }

  const std::string wanted_mtu_;
  const CanBus bus_;
  const Delivery delivery_;
  const std::optional<double> virtual_frames_per_s_;  // to an interface without bit timing
  std::optional<double> max_frames_per_s_;            // nullopt: not paced
  CanSocket socket_;
  CanQueue queue_;
  bool carries_fd_ = false;
  bool is_virtual_ = false;
  bool bus_off_ = false;
  PortState bus_state_ = PortState::ready;  // of the controller, unless it is off
  bool output_full_ = false;                // the socket's send buffer was full at the last attempt
  BackOff back_off_;
  canfd_frame incoming_{};
  std::array<CanSocket::Message, CanSocket::max_batch> batch_;
  std::array<Confirmation, max_confirmations> confirmations_;  // a ring
  std::size_t confirmations_end_ = 0, confirmation_count_ = 0;
};

void check(const PortSpec&, const PortSettings&) {}

std::unique_ptr<Port> open(const PortSpec& spec, const PortSettings& settings) {
  return std::make_unique<CanPort>(spec, settings.delivery);
}

}  // namespace

extern const Transport can_transport;
constexpr Transport can_transport = {
    .name = "can",
    .summary = "a CAN or CAN FD interface of SocketCAN",
    .syntax = "can:can0?bitrate=500000&data_bitrate=2000000&mtu=72",
    .example = "can:can0?bitrate=500000",
    .document = "https://docs.kernel.org/networking/can.html",
    .options = can_options,
    .carries_can = true,
    .keeps_datagrams = true,
    .is_shared = true,
    .check = check,
    .open = open,
    .wire_time = can_wire_time,
};

}  // namespace imud
