// UDP sockets; a frame is a datagram. udp(7), ip(7), ipv6(7).
#include <fmt/format.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <string>

#include "transports/file_descriptor.hpp"
#include "transports/host_clock.hpp"
#include "transports/port.hpp"
#include "transports/socket/host_address.hpp"
#include "transports/socket/socket_address.hpp"

namespace imud {
namespace {

constexpr std::size_t max_datagram = 65507;  // 65535 - IPv4 header - UDP header

// Returns the address to which a listener at `own` sends before it has received anything.
SocketAddress resolve_peer(const PortSpec& spec, const SocketAddress& own, const std::string& text) {
  PortSpec there = spec;
  there.address = text;
  const SocketAddress peer = SocketAddress::ip(there);
  if (HostAddress::parse(text).port == 0) throw spec.error("peer= needs a port from 1 to 65535");
  if (peer.family() != own.family())
    throw spec.error(fmt::format("peer={}: one address is IPv4 and one IPv6; give both alike", text));
  return peer;
}

// Returns the interface of a multicast group: from the option, or from the IPv6 address (%eth0); 0: the interface
// to which the routes lead.
int multicast_interface(const PortSpec& spec, const SocketAddress& group) {
  if (const auto name = spec.text("interface")) {
    const unsigned index = ::if_nametoindex(name->c_str());
    if (index == 0) throw spec.error(fmt::format("interface={}: there is no such network interface", *name));
    return static_cast<int>(index);
  }
  if (group.family() == AF_INET) return 0;
  return static_cast<int>(reinterpret_cast<const sockaddr_in6&>(group.storage).sin6_scope_id);
}

class UdpPort final : public Port {
 public:
  UdpPort(const PortSpec& spec, const PortSettings& settings)
      : connected_(settings.role == Role::device), admitted_(settings.from) {
    SocketAddress named = SocketAddress::ip(spec);
    socket_.reset(::socket(named.family(), SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    if (!socket_) throw spec.error(fmt::format("no socket: {}", std::strerror(errno)));

    // Room for a second of truth at 1 kHz while the receiver is held up; beyond rmem_max only for root.
    const int receive_buffer = 4 << 20;
    if (::setsockopt(socket_.get(), SOL_SOCKET, SO_RCVBUFFORCE, &receive_buffer, sizeof receive_buffer) != 0)
      ::setsockopt(socket_.get(), SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);

    if (named.is_multicast()) prepare_multicast(spec, named);
    if (connected_) {
      if (::connect(socket_.get(), named.get(), named.size) != 0)
        throw spec.error(fmt::format("cannot send there: {}; is the network up?", std::strerror(errno)));
    } else if (::bind(socket_.get(), named.get(), named.size) != 0) {
      throw bind_error(spec, errno);
    } else {
      chosen_port_ = chosen_port_of(spec, socket_.get());
    }
    if (!connected_ && named.is_multicast()) join(spec, named);
    if (const auto peer = spec.text("peer")) peer_ = resolve_peer(spec, named, *peer);
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
    constexpr int most = 256;  // foreign datagrams that are dropped in one call, so that the caller can do other work
    // The first attempt may only report that an earlier datagram failed: try again.
    for (int foreign = 0, failed = 0; foreign < most && failed < 2;) {
      if (next_ == taken_ && !take_datagrams()) {
        if (errno == EAGAIN) break;
        ++failed;
        continue;
      }
      const Datagram& datagram = datagrams_[next_++];
      const Endpoint sender = datagram.from.endpoint();
      if (admitted_ && !admitted_->admits(sender)) {
        ++counters_.foreign;
        counters_.foreign_from = sender;
        ++foreign;
        continue;
      }
      if (!connected_) peer_ = datagram.from;
      ++counters_.received;
      const bool is_last = next_ == taken_ && taken_ < most_taken;
      return Received{{{datagram.bytes.get(), datagram.size}}, arrival_, sender, false, is_last};
    }
    return std::nullopt;
  }

  int descriptor() const noexcept override { return socket_.get(); }
  std::string chosen_port() const override { return chosen_port_; }

 private:
  // Takes the datagrams that wait, at most two, so that one system call tells whether a datagram is the last. Returns
  // false, with errno, if it takes none.
  bool take_datagrams() noexcept {
    std::array<iovec, most_taken> rooms;
    std::array<mmsghdr, most_taken> messages{};
    for (std::size_t i = 0; i < most_taken; ++i) {
      rooms[i] = {datagrams_[i].bytes.get(), max_datagram + 1};
      messages[i].msg_hdr.msg_iov = &rooms[i];
      messages[i].msg_hdr.msg_iovlen = 1;
      messages[i].msg_hdr.msg_name = datagrams_[i].from.room();
      messages[i].msg_hdr.msg_namelen = sizeof datagrams_[i].from.storage;
    }
    next_ = taken_ = 0;
    const int count = ::recvmmsg(socket_.get(), messages.data(), most_taken, MSG_DONTWAIT, nullptr);
    if (count < 0) return false;
    arrival_ = host_now();
    taken_ = static_cast<std::size_t>(count);
    for (std::size_t i = 0; i < taken_; ++i) {
      datagrams_[i].size = messages[i].msg_len;
      datagrams_[i].from.size = messages[i].msg_hdr.msg_namelen;
    }
    return true;
  }

  template <class Value>
  bool set_option(int level, int name, const Value& value) noexcept {
    return ::setsockopt(socket_.get(), level, name, &value, sizeof value) == 0;
  }

  // Sets the interface for sending, and lets several processes receive the group.
  void prepare_multicast(const PortSpec& spec, SocketAddress& group) {
    const int interface = multicast_interface(spec, group);
    const bool v4 = group.family() == AF_INET;
    if (!v4) reinterpret_cast<sockaddr_in6&>(group.storage).sin6_scope_id = static_cast<unsigned>(interface);
    ip_mreqn request{};
    request.imr_ifindex = interface;
    if (interface != 0 && !(v4 ? set_option(IPPROTO_IP, IP_MULTICAST_IF, request)
                               : set_option(IPPROTO_IPV6, IPV6_MULTICAST_IF, interface)))
      throw spec.error(fmt::format("cannot send multicast to that interface: {}", std::strerror(errno)));
    if (!connected_) set_option(SOL_SOCKET, SO_REUSEADDR, 1);
  }

  void join(const PortSpec& spec, const SocketAddress& group) {
    const int interface = multicast_interface(spec, group);
    bool joined = false;
    if (group.family() == AF_INET) {
      ip_mreqn request{};
      request.imr_multiaddr = reinterpret_cast<const sockaddr_in&>(group.storage).sin_addr;
      request.imr_ifindex = interface;
      joined = set_option(IPPROTO_IP, IP_ADD_MEMBERSHIP, request);
      set_option(IPPROTO_IP, IP_MULTICAST_ALL, 0);  // no groups joined by other processes
    } else {
      ipv6_mreq request{};
      request.ipv6mr_multiaddr = reinterpret_cast<const sockaddr_in6&>(group.storage).sin6_addr;
      request.ipv6mr_interface = static_cast<unsigned>(interface);
      joined = set_option(IPPROTO_IPV6, IPV6_ADD_MEMBERSHIP, request);
      set_option(IPPROTO_IPV6, IPV6_MULTICAST_ALL, 0);
    }
    if (joined) return;
    throw spec.error(fmt::format("cannot join the multicast group: {}{}", std::strerror(errno),
                                 interface == 0 ? "; name the interface, for example ?interface=eth0" : ""));
  }

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
  const std::optional<Endpoint> admitted_;
  FileDescriptor socket_;
  std::string chosen_port_;
  SocketAddress peer_;  // of a listener: the last datagram's sender, or the one given
  struct Datagram {
    std::unique_ptr<std::byte[]> bytes = std::make_unique_for_overwrite<std::byte[]>(max_datagram + 1);
    std::size_t size = 0;
    SocketAddress from;
  };
  static constexpr std::size_t most_taken = 2;
  std::array<Datagram, most_taken> datagrams_;  // the first `taken_`; those before `next_` were returned
  std::size_t next_ = 0, taken_ = 0;
  HostTime arrival_;
};

void check(const PortSpec& spec, const PortSettings& settings) {
  const HostAddress udp = HostAddress::parse(spec.address);
  if (udp.port == 0 && settings.role == Role::device)
    throw spec.error("only a listener's port is chosen; right would be the receiver's, from 1 to 65535");
  const SocketAddress address = SocketAddress::ip(spec);
  if (spec.text("interface") && !address.is_multicast())
    throw spec.error(fmt::format("interface= is for multicast, and {} is no multicast address", udp.host));
  if (const auto peer = spec.text("peer")) {
    if (settings.role == Role::device) throw spec.error("peer= is for a listener; a device sends to its address");
    resolve_peer(spec, address, *peer);
  }
}

bool has_address(const SocketAddress& peer, Endpoint endpoint_there) {
  endpoint_there.port = 0;
  return endpoint_there.admits(peer.endpoint());
}

bool is_any(const SocketAddress& peer) {
  const std::uint32_t any_v4 = INADDR_ANY;
  return has_address(peer, Endpoint()) || has_address(peer, Endpoint::ipv4(&any_v4, 0));
}

bool is_loopback(const SocketAddress& peer) {
  if (peer.family() == AF_INET6)
    return IN6_IS_ADDR_LOOPBACK(&reinterpret_cast<const sockaddr_in6&>(peer.storage).sin6_addr);
  return ntohl(reinterpret_cast<const sockaddr_in&>(peer.storage).sin_addr.s_addr) >> 24U == IN_LOOPBACKNET;
}

// Returns true if the address belongs to this machine.
bool is_local(const SocketAddress& peer) {
  ifaddrs* all = nullptr;
  if (is_loopback(peer) || ::getifaddrs(&all) != 0) return is_loopback(peer);
  const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> owner(all, &::freeifaddrs);
  for (const ifaddrs* one = all; one != nullptr; one = one->ifa_next) {
    if (one->ifa_addr == nullptr) continue;
    SocketAddress address;
    address.size = one->ifa_addr->sa_family == AF_INET    ? sizeof(sockaddr_in)
                   : one->ifa_addr->sa_family == AF_INET6 ? sizeof(sockaddr_in6)
                                                          : 0;
    std::memcpy(&address.storage, one->ifa_addr, address.size);
    if (address.size != 0 && has_address(peer, address.endpoint())) return true;
  }
  return false;
}

// A listener at 0.0.0.0 receives datagrams to any IPv4 address of this machine, one at [::] to any address. Datagrams
// to 0.0.0.0 or [::] go to this machine.
bool reaches(const PortSpec& device, const PortSpec& listener) {
  if (HostAddress::parse(device.address).port != HostAddress::parse(listener.address).port) return false;
  const SocketAddress to = SocketAddress::ip(device), at = SocketAddress::ip(listener);
  if (at.family() == AF_INET && to.family() != AF_INET) return false;
  if (is_any(to)) return is_any(at) || is_loopback(at);
  return has_address(to, at.endpoint()) || (is_any(at) && is_local(to));
}

std::optional<std::uint16_t> udp_port(const PortSpec& spec) {
  const std::uint16_t port = HostAddress::parse(spec.address).port;
  return port == 0 ? std::nullopt : std::optional(port);
}

constexpr PortOption udp_options[] = {
    {.key = "interface",
     .help = "network interface of a multicast group; without it the one to which the routes lead"},
    {.key = "peer",
     .help =
         "ADDR:PORT to which a listener sends until it has received something; later it sends to the last sender"}};

}  // namespace

extern constexpr Transport udp_transport = {
    .name = "udp",
    .summary = "a datagram per frame; a listener binds the address, with port 0 a free one, a device sends to it",
    .syntax = "udp:ADDR:PORT?interface=eth0&peer=ADDR:PORT",
    .example = "udp:127.0.0.1:9820",
    .document = "RFC 768, ip(7), ipv6(7)",
    .options = udp_options,
    .keeps_datagrams = true,
    .brings_truth = true,
    .is_shared = true,
    .check = check,
    .open = open_as<UdpPort>,
    .udp_port = udp_port,
    .reaches = reaches,
};

}  // namespace imud
