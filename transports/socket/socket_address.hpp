// SocketAddress: an address of UDP, TCP or a Unix socket, as the kernel's calls take it.
#pragma once

#include <sys/socket.h>

#include <string>

#include "transports/endpoint.hpp"
#include "transports/port_spec.hpp"

namespace imud {

struct SocketAddress {
  sockaddr_storage storage{};
  socklen_t size = 0;  // bytes; 0: none

  // Return the address of a spec: "ADDR:PORT" for UDP and TCP (host_address.hpp), or the path of a Unix socket. Throw
  // PortError on any other form.
  static SocketAddress ip(const PortSpec& spec);
  static SocketAddress unix_path(const PortSpec& spec);
  // Returns the address that a bound socket has.
  static SocketAddress bound(int socket) noexcept;

  const sockaddr* get() const noexcept { return reinterpret_cast<const sockaddr*>(&storage); }
  sockaddr* room() noexcept { return reinterpret_cast<sockaddr*>(&storage); }
  int family() const noexcept { return storage.ss_family; }
  // Requires an IPv4 or IPv6 address.
  Endpoint endpoint() const noexcept;
  bool is_multicast() const noexcept;
};

// Returns "scheme:ADDR:PORT" with the port that the system has chosen for `socket`, if the port of `spec`
// is 0; else an empty text.
std::string chosen_port_of(const PortSpec& spec, int socket);

// Returns the error to throw if bind() at an address of UDP or TCP has failed with `error`, an errno.
PortError bind_error(const PortSpec& spec, int error);

}  // namespace imud
