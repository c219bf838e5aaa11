// CanPort: a port of a CAN bus, with its queue, its pacing and the state of its controller, over any CanLink.
#pragma once

#include <linux/can.h>

#include <array>
#include <memory>
#include <optional>

#include "transports/can/can_bus.hpp"
#include "transports/can/can_link.hpp"
#include "transports/can/can_queue.hpp"
#include "transports/host_clock.hpp"
#include "transports/port.hpp"

namespace imud {

inline constexpr PortOption frames_per_s_option = {
    .key = "frames_per_s",
    .help = "fast, lockstep: highest rate of frames to a virtual interface (5000, or that of `bitrate`)",
    .min = 1,
    .max = 1'000'000,
    .choices = "unlimited"};
inline constexpr PortOption max_age_option = {.key = "max_age_ms",
                                              .help = "realtime: age at which unsent frames are dropped, ms (100)",
                                              .min = 1,
                                              .max = 60'000};

class CanPort final : public Port {
 public:
  // Does not bind `link` yet. If `allows_fd` is false, the port sends no FD frame. Uses the spec's options above
  // and in can_bus.hpp.
  CanPort(const PortSpec& spec, const PortSettings& settings, std::unique_ptr<CanLink> link, bool allows_fd);

  // Binds the link. Returns 0 or an errno.
  int bind() noexcept;
  // Call this in place of bind() if the interface does not exist yet: the port is `lost`, and binds the link
  // later.
  void await() noexcept;
  bool carries_fd() const noexcept { return carries_fd_; }

  void send(std::span<const Frame> frames) noexcept override;
  void flush() noexcept override { send_ready(host_now()); }
  // A run that waits for the bus need not ask the socket before each sample.
  bool has_room() const noexcept override {
    return delivery_ == Delivery::complete && queue_.room() >= 2 * FrameBuffer::max_frames;
  }
  std::optional<HostTime> next_flush() const noexcept override {
    return output_full_ || is_collecting() ? std::nullopt : queue_.next();
  }
  bool wants_output() const noexcept override { return output_full_ && !queue_.is_empty(); }
  bool is_drained() noexcept override {
    flush();
    return queue_.is_empty();
  }
  void discard_pending() noexcept override { counters_.dropped += queue_.clear(); }
  std::optional<Received> receive() noexcept override;
  std::optional<Confirmation> next_confirmation() noexcept override;
  void set_filters(std::span<const CanFilter> filters) noexcept override { link_->set_filters(filters); }
  int descriptor() const noexcept override { return link_->descriptor(); }

 private:
  bool rebind() noexcept { return back_off_.due() && bind() == 0; }
  bool is_collecting() const noexcept {
    return collects_ && !queue_.is_interface_full() && queue_.size() < CanLink::max_batch;
  }
  // Returns false if frames would not reach the bus.
  bool is_connected() noexcept;
  // Sends what may leave at `now`.
  void send_ready(HostTime now) noexcept;
  void update_mtu() noexcept { carries_fd_ = link_->mtu() >= static_cast<int>(CANFD_MTU) && allows_fd_; }
  // Discards the waiting frames: they would be old when the interface is back.
  void lose(int error) noexcept;
  // The kernel has refused the oldest frame that is ready. Returns true if the next one may be tried.
  bool handle_refusal(int error) noexcept;
  // Returns false if the interface cannot carry the frame. Only a virtual interface carries the error frames of
  // other nodes: a controller makes its own error frames, and a virtual interface has no controller.
  bool pack(const Frame& frame, CanQueue::Queued& queued) const noexcept;
  CanHeader header_of(bool fd) const noexcept;
  // Takes the state of the controller from an error frame.
  void take_error(canid_t id) noexcept;
  void enter(PortState state, std::uint64_t& times) noexcept;
  void confirm(const CanLink::Received& received) noexcept;
  Received unpack(const CanLink::Received& received) noexcept;

  const bool allows_fd_;
  const CanBus bus_;
  const Delivery delivery_;
  const bool yields_, may_collect_;
  const std::optional<double> virtual_frames_per_s_;  // to an interface without bit timing
  std::optional<double> max_frames_per_s_;            // nullopt: not paced
  const std::unique_ptr<CanLink> link_;
  CanQueue queue_;
  bool carries_fd_ = false;
  bool is_virtual_ = false;
  // In `fast` without pacing no receiver waits for one sample: frames collect until one system call sends a batch,
  // the caller flushes, or an answer leaves.
  bool collects_ = false;
  static constexpr int most_looks = 128;  // receive() without reading, until the collected frames leave
  int looks_ = 0;
  bool bus_off_ = false;
  PortState bus_state_ = PortState::ready;  // of the controller, unless it is off
  bool output_full_ = false;                // the socket's send buffer was full at the last attempt
  BackOff back_off_;
  canfd_frame incoming_{};
  std::array<CanLink::Message, CanLink::max_batch> batch_;
  std::array<Confirmation, max_confirmations> confirmations_;  // a ring
  std::size_t confirmations_end_ = 0, confirmation_count_ = 0;
};

}  // namespace imud
