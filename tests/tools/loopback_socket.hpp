// LoopbackSocket: a UDP socket on 127.0.0.1, on a free port, that receives datagrams and answers them.
#pragma once

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>

#include <cstddef>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "transports/file_descriptor.hpp"

namespace imud {

class LoopbackSocket {
 public:
  LoopbackSocket() : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    // A thousand small datagrams fit, where the system allows it.
    const int buffer = 4 << 20;
    if (::setsockopt(socket_.get(), SOL_SOCKET, SO_RCVBUFFORCE, &buffer, sizeof buffer) != 0)
      ::setsockopt(socket_.get(), SOL_SOCKET, SO_RCVBUF, &buffer, sizeof buffer);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    if (::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address), size) != 0 ||
        ::getsockname(socket_.get(), reinterpret_cast<sockaddr*>(&address), &size) != 0)
      throw std::runtime_error("no UDP socket");
    port_ = ntohs(address.sin_port);
  }

  int port() const { return port_; }
  std::string spec() const { return "udp:127.0.0.1:" + std::to_string(port_); }

  // Returns the next datagram; nullopt if none arrives within `timeout_ms`.
  std::optional<std::vector<std::byte>> receive(int timeout_ms = 0) {
    pollfd ready{socket_.get(), POLLIN, 0};
    if (::poll(&ready, 1, timeout_ms) <= 0) return std::nullopt;
    std::vector<std::byte> bytes(65536);
    socklen_t size = sizeof peer_;
    const ssize_t length =
        ::recvfrom(socket_.get(), bytes.data(), bytes.size(), 0, reinterpret_cast<sockaddr*>(&peer_), &size);
    if (length < 0) return std::nullopt;
    bytes.resize(static_cast<std::size_t>(length));
    return bytes;
  }

  // Returns all datagrams received so far.
  std::vector<std::vector<std::byte>> receive_all() {
    std::vector<std::vector<std::byte>> all;
    while (auto datagram = receive()) all.push_back(std::move(*datagram));
    return all;
  }

  // Sends to the sender of the last datagram.
  void answer(std::span<const std::byte> bytes) {
    ::sendto(socket_.get(), bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&peer_), sizeof peer_);
  }

 private:
  FileDescriptor socket_;
  int port_ = 0;
  sockaddr_in peer_{};
};

}  // namespace imud
