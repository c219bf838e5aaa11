// StreamSocket: a port at one end of a connection, by TCP or by a Unix socket.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "transports/byte_writer.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/host_clock.hpp"
#include "transports/port.hpp"
#include "transports/socket/socket_address.hpp"

namespace imud {

// A stream of bytes to and from one peer. Until the first peer connects, the state is `no_reader`. A disconnection
// is counted as a loss: bytes that the peer has sent before are received first, and the rest of a frame that was
// sent in part is discarded. If the peer's machine vanishes without closing the connection, the port notices this
// within some 15 s.
class StreamSocket : public Port {
 public:
  void send(std::span<const Frame> frames) noexcept override;
  std::optional<Received> receive() noexcept override;
  void flush() noexcept override { send({}); }
  void discard_pending() noexcept override { writer_.discard(counters_); }
  bool wants_output() const noexcept override { return !writer_.is_idle(); }
  bool is_drained() noexcept override;
  int descriptor() const noexcept override { return peer_ ? peer_.get() : waiting_descriptor(); }

 protected:
  explicit StreamSocket(Role role);

 private:
  // Returns the connection to a peer, non-blocking, as soon as there is one.
  virtual FileDescriptor next_peer() noexcept = 0;
  // Returns the descriptor that is readable when next_peer() will return a connection; -1: there is none.
  virtual int waiting_descriptor() const noexcept = 0;
  // Refuses further connections while there is a peer.
  virtual void refuse_others() noexcept = 0;
  // Called when the peer has disconnected. Returns the state until another peer connects.
  virtual PortState after_loss() noexcept = 0;

  bool has_peer() noexcept;
  void look_after_peer() noexcept;
  bool has_vanished() const noexcept;
  void lose() noexcept;

  FileDescriptor peer_;
  std::optional<HostTime> output_failed_;  // when the peer, which is still connected, stopped receiving
  HostTime looked_;                        // when look_after_peer() last did something
  ByteWriter writer_{true};
  std::vector<std::byte> buffer_;
};

// Connects to a peer, and again after each loss. An attempt that has failed is repeated, see BackOff.
class ConnectingSocket final : public StreamSocket {
 public:
  ConnectingSocket(const SocketAddress& address, Role role) : StreamSocket(role), address_(address) {}

 private:
  FileDescriptor next_peer() noexcept override;
  int waiting_descriptor() const noexcept override { return -1; }
  void refuse_others() noexcept override {}
  PortState after_loss() noexcept override;

  const SocketAddress address_;
  FileDescriptor pending_;  // an attempt that has neither succeeded nor failed
  BackOff back_off_;
};

// Accepts one peer at a time. A further connection is closed at once and counted as refused.
class ListeningSocket : public StreamSocket {
 public:
  // Requires a non-blocking `socket` that listens. `chosen_port`: see Port.
  ListeningSocket(FileDescriptor socket, Role role, std::string chosen_port = {});
  std::string chosen_port() const override { return chosen_port_; }

 private:
  FileDescriptor next_peer() noexcept override;
  int waiting_descriptor() const noexcept override { return socket_.get(); }
  void refuse_others() noexcept override;
  PortState after_loss() noexcept override { return PortState::no_reader; }

  FileDescriptor socket_;
  const std::string chosen_port_;
};

}  // namespace imud
