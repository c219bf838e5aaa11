// A transport that exists for one test: a frame is a datagram of a Unix socket. unix(7).
#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "transports/file_descriptor.hpp"
#include "transports/host_clock.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

class ThrowawayPort final : public Port {
 public:
  ThrowawayPort(const PortSpec& spec, Role role)
      : socket_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{.sun_family = AF_UNIX, .sun_path = {}};
    spec.address.copy(address.sun_path, sizeof address.sun_path - 1);
    const auto* named = reinterpret_cast<const sockaddr*>(&address);
    // A sender gets an address of its own from the kernel, so that it can be answered.
    const int result = role == Role::listener ? ::bind(socket_.get(), named, sizeof address)
                       : ::bind(socket_.get(), named, sizeof(sa_family_t)) == 0
                           ? ::connect(socket_.get(), named, sizeof address)
                           : -1;
    if (result != 0) throw spec.error(std::strerror(errno));
    connected_ = role == Role::device;
  }

  void send(std::span<const Frame> frames) noexcept override {
    for (const Frame& frame : frames) {
      const auto* to = connected_ ? nullptr : reinterpret_cast<const sockaddr*>(&peer_);
      const bool sent = ::sendto(socket_.get(), frame.bytes.data(), frame.bytes.size(), MSG_NOSIGNAL, to,
                                 connected_ ? 0 : peer_size_) >= 0;
      if (sent)
        counters_.count_sent(is_reply_);
      else
        ++counters_.dropped;
    }
  }

  std::optional<Received> receive() noexcept override {
    socklen_t peer_size = sizeof peer_;
    const ssize_t size =
        ::recvfrom(socket_.get(), buffer_.data(), buffer_.size(), 0, reinterpret_cast<sockaddr*>(&peer_), &peer_size);
    if (size < 0) return std::nullopt;
    peer_size_ = peer_size;
    ++counters_.received;
    return Received{{{buffer_.data(), static_cast<std::size_t>(size)}}, host_now()};
  }

  int descriptor() const noexcept override { return socket_.get(); }

 private:
  FileDescriptor socket_;
  bool connected_ = false;
  sockaddr_un peer_{};
  socklen_t peer_size_ = 0;
  std::array<std::byte, 4096> buffer_;
};

std::unique_ptr<Port> open(const PortSpec& spec, const PortSettings& settings) {
  return std::make_unique<ThrowawayPort>(spec, settings.role);
}

}  // namespace

extern constexpr Transport throwaway_transport = {
    .name = "throwaway",
    .summary = "a datagram of a Unix socket per frame",
    .syntax = "throwaway:PATH",
    .example = "throwaway:imu1",
    .document = "unix(7)",
    .keeps_datagrams = true,
    .brings_truth = true,
    .is_shared = true,
    .open = open,
};

}  // namespace imud
