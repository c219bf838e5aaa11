// CanSocket: a raw SocketCAN socket on one interface. https://docs.kernel.org/networking/can.html, linux/can/raw.h
#pragma once

#include <linux/can.h>
#include <net/if.h>
#include <sys/socket.h>

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <utility>

#include "core/frame.hpp"
#include "transports/can/can_link.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {

// Receives every error frame, and the data and remote frames, classic or FD, that pass the filters. The times of
// arrival are the kernel's time stamps.
class CanSocket final : public CanLink {
 public:
  static constexpr std::size_t max_filters = 64;

  // Opens no socket yet. `interface` must have fewer than IFNAMSIZ characters. With `confirm` the socket receives
  // its own frames when they are sent: a controller's driver returns a frame when it was on the bus (IFF_ECHO);
  // for vcan, vxcan and slcan the kernel returns a frame when the interface takes it.
  CanSocket(std::string interface, bool confirm) : interface_(std::move(interface)), confirm_(confirm) {}

  int bind() noexcept override;
  void unbind() noexcept override { socket_.reset(); }
  bool is_bound() const noexcept override { return static_cast<bool>(socket_); }
  int descriptor() const noexcept override { return socket_.get(); }
  void set_filters(std::span<const CanFilter> filters) noexcept override;
  int send(std::span<const Message> frames) noexcept override;
  int receive(canfd_frame& frame, Received& received) noexcept override;
  int pending_error() const noexcept override;
  int mtu() const noexcept override;
  bool is_up() const noexcept override;
  // Returns true if the interface is a vcan or vxcan, or if its driver is unknown.
  bool is_virtual() const noexcept override;

 private:
  int apply_filters(int descriptor) const noexcept;
  bool query(unsigned long request, ifreq& answer) const noexcept;

  const std::string interface_;
  const bool confirm_;
  int index_ = 0;  // of the interface that the socket is bound to, which may be renamed meanwhile
  FileDescriptor socket_;
  std::array<can_filter, max_filters> filters_{};
  std::size_t filter_count_ = 0;
  bool filtered_ = false;
  std::array<iovec, max_batch> pieces_;
  std::array<mmsghdr, max_batch> messages_;
};

}  // namespace imud
