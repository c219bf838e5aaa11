// CanLink carries the frames of a CanPort to and from a bus: an interface of SocketCAN, or datagrams.
#pragma once

#include <linux/can.h>

#include <cstddef>
#include <span>

#include "core/frame.hpp"
#include "core/time.hpp"

namespace imud {

// Non-blocking. Failures are returned as errno; none of the functions throws or allocates. One thread.
class CanLink {
 public:
  static constexpr std::size_t max_batch = 64;  // frames that one call of send() takes

  virtual ~CanLink() = default;

  // Opens a new socket and binds it. A new socket is needed, because a socket whose interface was removed has lost
  // its filters. Returns 0 or an errno.
  virtual int bind() noexcept = 0;
  virtual void unbind() noexcept = 0;
  virtual bool is_bound() const noexcept = 0;
  virtual int descriptor() const noexcept = 0;

  // From now on, also after another bind(), receives only frames that pass at least one of `filters`. Before the
  // first call, and with more than 64 filters, every frame passes.
  virtual void set_filters(std::span<const CanFilter> filters) noexcept = 0;

  // Sends frames. Returns the number of frames sent, or -1 with errno. A message for an FD frame is a whole
  // canfd_frame; a message for a classic frame is the first CAN_MTU bytes of a canfd_frame. Requires frames.size()
  // <= max_batch.
  struct Message {
    const canfd_frame* frame;
    bool fd;
  };
  virtual int send(std::span<const Message> frames) noexcept = 0;

  struct Received {
    bool fd;
    bool own;                // sent by this link
    HostTime time;           // of arrival at this host
    bool malformed = false;  // the input is no frame
  };
  // Receives one frame. Returns 1, 0 if there is none, or -1 with errno.
  virtual int receive(canfd_frame& frame, Received& received) noexcept = 0;

  // Returns the error that the next use of the socket would report, and clears it.
  virtual int pending_error() const noexcept { return 0; }
  // Returns the interface's MTU: CAN_MTU, CANFD_MTU, or 0 if the interface is gone.
  virtual int mtu() const noexcept { return CANFD_MTU; }
  virtual bool is_up() const noexcept { return true; }
  // Returns true if the link has no bit timing.
  virtual bool is_virtual() const noexcept { return true; }
};

}  // namespace imud
