// CanSocket: a raw SocketCAN socket on one interface. https://docs.kernel.org/networking/can.html, linux/can/raw.h
#pragma once

#include <linux/can.h>
#include <net/if.h>
#include <sys/socket.h>

#include <array>
#include <cstddef>
#include <span>
#include <string>

#include "core/frame.hpp"
#include "core/time.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {

// Non-blocking; receives classic and FD frames and every error frame. Data and remote frames pass the filters.
// Failures are returned as errno. One thread.
class CanSocket {
 public:
  static constexpr std::size_t max_filters = 64;
  static constexpr std::size_t max_batch = 64;  // frames that one system call sends

  // Opens nothing yet. `interface` has less than IFNAMSIZ characters. With `confirm` it receives its own frames when
  // they are sent: a controller's driver returns a frame when it was on the bus (IFF_ECHO); for vcan, vxcan and
  // slcan the kernel does it when the interface takes the frame.
  CanSocket(std::string interface, bool confirm) : interface_(std::move(interface)), confirm_(confirm) {}

  // Opens a new socket, because one whose interface was removed has lost its filters, and binds it. Returns 0 or an
  // errno.
  int bind() noexcept;
  void unbind() noexcept { socket_.reset(); }
  bool is_bound() const noexcept { return static_cast<bool>(socket_); }
  int descriptor() const noexcept { return socket_.get(); }

  // From now on, also after another bind(), receives only frames that pass at least one of `filters`. Before the
  // first call, and with more than max_filters filters, every frame passes.
  void set_filters(std::span<const CanFilter> filters) noexcept;

  // Sends frames. Returns the number of frames sent, or -1 with errno. Each message is a canfd_frame, its first
  // CAN_MTU bytes for a classic one. frames.size() <= max_batch.
  struct Message {
    const canfd_frame* frame;
    bool fd;
  };
  int send(std::span<const Message> frames) noexcept;

  struct Received {
    bool fd;
    bool own;       // sent by this socket
    HostTime time;  // of arrival at this host, as the kernel stamped it
  };
  // Receives one frame. Returns 1, 0 if there is none, or -1 with errno.
  int receive(canfd_frame& frame, Received& received) noexcept;

  // Returns the error that the next use of the socket would report, and clears it.
  int pending_error() const noexcept;
  // Returns the interface's MTU: CAN_MTU, CANFD_MTU, or 0 if the interface is gone.
  int mtu() const noexcept;
  bool is_up() const noexcept;
  // Returns true if the interface has no bit timing: it is a vcan or vxcan, or its driver is unknown.
  bool is_virtual() const noexcept;

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
