// ip(7), ipv6(7), unix(7), getaddrinfo(3).
#include "transports/socket/socket_address.hpp"

#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/un.h>

#include <cerrno>
#include <cstring>

#include "transports/socket/host_address.hpp"

namespace imud {
namespace {

const sockaddr_in& v4(const SocketAddress& address) noexcept {
  return reinterpret_cast<const sockaddr_in&>(address.storage);
}
const sockaddr_in6& v6(const SocketAddress& address) noexcept {
  return reinterpret_cast<const sockaddr_in6&>(address.storage);
}

}  // namespace

SocketAddress SocketAddress::ip(const PortSpec& spec) {
  const NumericAddress numeric = HostAddress::parse(spec.address).numeric();
  addrinfo hints{};
  hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV;
  hints.ai_socktype = SOCK_DGRAM;  // one result; the address is the same for TCP
  addrinfo* found = nullptr;
  const int error = ::getaddrinfo(numeric.address.c_str(), std::to_string(numeric.port).c_str(), &hints, &found);
  if (error != 0) throw spec.error(::gai_strerror(error));
  SocketAddress address;
  std::memcpy(&address.storage, found->ai_addr, found->ai_addrlen);
  address.size = found->ai_addrlen;
  ::freeaddrinfo(found);
  return address;
}

SocketAddress SocketAddress::unix_path(const PortSpec& spec) {
  sockaddr_un path{};
  path.sun_family = AF_UNIX;
  if (spec.address == "-") throw spec.error("is no path; right would be that of a socket, such as /run/imud/truth");
  if (spec.address.size() >= sizeof path.sun_path)
    throw spec.error(fmt::format("the path is too long for a socket; right would be at most {} characters",
                                 sizeof path.sun_path - 1));
  std::memcpy(path.sun_path, spec.address.data(), spec.address.size());
  SocketAddress address;
  std::memcpy(&address.storage, &path, sizeof path);
  address.size = sizeof path;
  return address;
}

SocketAddress SocketAddress::bound(int socket) noexcept {
  SocketAddress address;
  address.size = sizeof address.storage;
  ::getsockname(socket, address.room(), &address.size);
  return address;
}

Endpoint SocketAddress::endpoint() const noexcept {
  if (family() == AF_INET) return Endpoint::ipv4(&v4(*this).sin_addr, ntohs(v4(*this).sin_port));
  return Endpoint::ipv6(&v6(*this).sin6_addr, ntohs(v6(*this).sin6_port));
}

bool SocketAddress::is_multicast() const noexcept {
  if (family() == AF_INET) return IN_MULTICAST(ntohl(v4(*this).sin_addr.s_addr));
  return IN6_IS_ADDR_MULTICAST(&v6(*this).sin6_addr);
}

std::string chosen_port_of(const PortSpec& spec, int socket) {
  if (HostAddress::parse(spec.address).port != 0) return {};
  return fmt::format("{}:{}:{}", spec.scheme, spec.address.substr(0, spec.address.rfind(':')),
                     SocketAddress::bound(socket).endpoint().port);
}

PortError bind_error(const PortSpec& spec, int error) {
  return spec.error(fmt::format("cannot receive there: {}{}", std::strerror(error),
                                error == EADDRINUSE ? "; another process does"
                                : error == EADDRNOTAVAIL
                                    ? "; right would be an address of this machine, or 0.0.0.0 or [::] for all"
                                : error == EACCES ? "; ports below 1024 are root's"
                                                  : ""));
}

}  // namespace imud
