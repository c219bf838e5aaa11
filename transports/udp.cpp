// UDP sockets; a frame is a datagram. udp(7), ip(7), ipv6(7).
#include <fmt/format.h>
#include <ifaddrs.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "transports/file_descriptor.hpp"
#include "transports/host_clock.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

constexpr std::size_t max_datagram = 65507;  // 65535 - IPv4 header - UDP header

struct Peer {
  sockaddr_storage address{};
  socklen_t size = 0;
  const sockaddr* get() const noexcept { return reinterpret_cast<const sockaddr*>(&address); }
};

Peer resolve(const PortSpec& spec) {
  const UdpAddress udp = UdpAddress::parse(spec.address);
  addrinfo hints{};
  hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV;
  hints.ai_socktype = SOCK_DGRAM;
  addrinfo* found = nullptr;
  const int error = ::getaddrinfo(udp.address.c_str(), std::to_string(udp.port).c_str(), &hints, &found);
  if (error != 0) throw spec.error(::gai_strerror(error));
  Peer peer;
  std::memcpy(&peer.address, found->ai_addr, found->ai_addrlen);
  peer.size = found->ai_addrlen;
  ::freeaddrinfo(found);
  return peer;
}

// Returns the bytes of an IPv4 or IPv6 address.
std::string_view bytes_of(const sockaddr& address) {
  const auto view = [](const auto& bytes) {
    return std::string_view(reinterpret_cast<const char*>(&bytes), sizeof bytes);
  };
  if (address.sa_family == AF_INET) return view(reinterpret_cast<const sockaddr_in&>(address).sin_addr);
  if (address.sa_family == AF_INET6) return view(reinterpret_cast<const sockaddr_in6&>(address).sin6_addr);
  return {};
}

bool has_address(const Peer& peer, const sockaddr& address) {
  return peer.get()->sa_family == address.sa_family && bytes_of(*peer.get()) == bytes_of(address);
}

bool is_any(const Peer& peer) { return bytes_of(*peer.get()).find_first_not_of('\0') == std::string_view::npos; }

class UdpPort final : public Port {
 public:
  UdpPort(const PortSpec& spec, const PortSettings& settings)
      : connected_(settings.role == Role::device), buffer_(max_datagram + 1) {
    const Peer named = resolve(spec);
    socket_.reset(::socket(named.address.ss_family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    if (!socket_) throw spec.error(fmt::format("no socket: {}", std::strerror(errno)));

    // Room for a second of truth at 1 kHz while the receiver is held up; beyond rmem_max only for root.
    const int receive_buffer = 4 << 20;
    if (::setsockopt(socket_.get(), SOL_SOCKET, SO_RCVBUFFORCE, &receive_buffer, sizeof receive_buffer) != 0)
      ::setsockopt(socket_.get(), SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);

    if (connected_) {
      if (::connect(socket_.get(), named.get(), named.size) != 0)
        throw spec.error(fmt::format("cannot send there: {}; is the network up?", std::strerror(errno)));
    } else if (::bind(socket_.get(), named.get(), named.size) != 0) {
      const int error = errno;
      throw spec.error(fmt::format("cannot receive there: {}{}", std::strerror(error),
                                   error == EADDRINUSE ? "; another process does"
                                   : error == EADDRNOTAVAIL
                                       ? "; right would be an address of this machine, or 0.0.0.0 or [::] for all"
                                   : error == EACCES ? "; ports below 1024 are root's"
                                                     : ""));
    } else if (UdpAddress::parse(spec.address).port == 0) {
      Peer bound;
      bound.size = sizeof bound.address;
      ::getsockname(socket_.get(), reinterpret_cast<sockaddr*>(&bound.address), &bound.size);
      std::array<char, NI_MAXSERV> port{};
      ::getnameinfo(bound.get(), bound.size, nullptr, 0, port.data(), port.size(), NI_NUMERICSERV | NI_DGRAM);
      chosen_port_ =
          fmt::format("{}:{}:{}", spec.scheme, spec.address.substr(0, spec.address.rfind(':')), port.data());
    }
  }

  void send(std::span<const Frame> frames) noexcept override {
    for (const Frame& frame : frames) {
      if (try_send(frame)) {
        counters_.count_sent(is_reply_);
        state_ = PortState::ready;
      } else {
        ++counters_.dropped;
      }
    }
  }

  std::optional<Received> receive() noexcept override {
    // The first attempt may only report that an earlier datagram failed: try again.
    for (int attempt = 0; attempt < 2; ++attempt) {
      Peer from;
      from.size = sizeof from.address;
      const ssize_t size = ::recvfrom(socket_.get(), buffer_.data(), buffer_.size(), MSG_DONTWAIT,
                                      reinterpret_cast<sockaddr*>(&from.address), &from.size);
      if (size >= 0) {
        if (!connected_) peer_ = from;
        ++counters_.received;
        return Received{{{buffer_.data(), static_cast<std::size_t>(size)}}, host_now()};
      }
      if (errno == EAGAIN) break;
    }
    return std::nullopt;
  }

  int descriptor() const noexcept override { return socket_.get(); }
  std::string chosen_port() const override { return chosen_port_; }

 private:
  bool try_send(const Frame& frame) noexcept {
    if (!connected_ && peer_.size == 0) return false;
    // The first attempt may only report that an earlier datagram failed (ECONNREFUSED, EHOSTUNREACH): try again.
    for (int attempt = 0; attempt < 2; ++attempt) {
      const ssize_t size =
          ::sendto(socket_.get(), frame.bytes.data(), frame.bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                   connected_ ? nullptr : peer_.get(), connected_ ? 0 : peer_.size);
      if (size >= 0) return true;
      if (errno == EAGAIN || errno == ENOBUFS || errno == EMSGSIZE) return false;
    }
    if (state_ != PortState::lost) ++counters_.lost_count;
    state_ = PortState::lost;
    return false;
  }

  const bool connected_;  // the socket is connected to the address given; otherwise bound to it
  FileDescriptor socket_;
  std::string chosen_port_;
  Peer peer_;  // a listener's: the sender of the last datagram
  std::vector<std::byte> buffer_;
};

void check(const PortSpec& spec, const PortSettings& settings) {
  if (UdpAddress::parse(spec.address).port == 0 && settings.role == Role::device)
    throw spec.error("only a listener's port is chosen; right would be the receiver's, from 1 to 65535");
}

std::unique_ptr<Port> open(const PortSpec& spec, const PortSettings& settings) {
  return std::make_unique<UdpPort>(spec, settings);
}

// Returns true if the address is one of this machine.
bool is_local(const Peer& peer) {
  ifaddrs* all = nullptr;
  if (::getifaddrs(&all) != 0) return false;
  const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> owner(all, &::freeifaddrs);
  for (const ifaddrs* one = all; one != nullptr; one = one->ifa_next)
    if (one->ifa_addr != nullptr && has_address(peer, *one->ifa_addr)) return true;
  return false;
}

// A listener at 0.0.0.0 or [::] receives what is sent to any address of this machine.
bool reaches(const PortSpec& device, const PortSpec& listener) {
  if (UdpAddress::parse(device.address).port != UdpAddress::parse(listener.address).port) return false;
  const Peer to = resolve(device), at = resolve(listener);
  return has_address(to, *at.get()) || (is_any(at) && is_local(to));
}

std::optional<std::uint16_t> udp_port(const PortSpec& spec) {
  const std::uint16_t port = UdpAddress::parse(spec.address).port;
  return port == 0 ? std::nullopt : std::optional(port);
}

}  // namespace

extern const Transport udp_transport;
constexpr Transport udp_transport = {
    .name = "udp",
    .summary = "a datagram per frame; a listener binds the address, with port 0 a free one, a device sends to it",
    .syntax = "udp:ADDR:PORT",
    .example = "udp:127.0.0.1:9820",
    .document = "RFC 768",
    .keeps_datagrams = true,
    .brings_truth = true,
    .is_shared = true,
    .check = check,
    .open = open,
    .udp_port = udp_port,
    .reaches = reaches,
};

}  // namespace imud
