// HostAddress: "HOST:PORT" of UDP or TCP, where HOST may be a name.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "transports/port_spec.hpp"

namespace imud {

struct HostAddress {
  std::string host;  // a numeric IPv4 or IPv6 address without brackets, or a name
  std::uint16_t port = 0;
  bool is_name = false;

  // Looks up no name. Throws PortError on any other form; a name has letters, digits, - and _ between its dots, and
  // its first and last part begin with a letter (RFC 1123, section 2.1), so that a misspelt address is not looked up.
  static HostAddress parse(std::string_view text);
  // Returns the address in numbers. A name is looked up by getaddrinfo(3), IPv4 before IPv6, which may wait for a
  // name server. A thread looks a name up only once, so that all its ports, also a port that is opened again, have
  // the same address. Throws PortError if the name is not known.
  NumericAddress numeric() const;
};

}  // namespace imud
