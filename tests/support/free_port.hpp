// free_udp_port(): a UDP port for a program that binds it later.
#pragma once

#include <netinet/in.h>
#include <sys/socket.h>

#include <cstdint>
#include <fstream>
#include <random>
#include <stdexcept>

#include "transports/file_descriptor.hpp"

namespace imud {

// Returns a port that no socket has. The port is below the range from which Linux takes ports for sockets that ask
// for none (ip(7), ip_local_port_range). Therefore no such socket of another test gets this port before the program
// binds it.
inline int free_udp_port(int family = AF_INET) {
  constexpr int first = 10'000;
  int end = 0;
  if (!(std::ifstream("/proc/sys/net/ipv4/ip_local_port_range") >> end) || end <= first) end = 1 << 15;
  std::random_device random;
  std::uniform_int_distribution<int> port(first, end - 1);
  for (int i = 0; i < 1000; ++i) {
    const FileDescriptor probe(::socket(family, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    sockaddr_in6 address{};  // the begin of an IPv4 address is the same
    address.sin6_family = static_cast<sa_family_t>(family);
    const int number = port(random);
    address.sin6_port = htons(static_cast<std::uint16_t>(number));
    const socklen_t size = family == AF_INET ? sizeof(sockaddr_in) : sizeof(sockaddr_in6);
    if (::bind(probe.get(), reinterpret_cast<const sockaddr*>(&address), size) == 0) return number;
  }
  throw std::runtime_error("no free UDP port");
}

}  // namespace imud
