// Endpoint: the address and the port of a UDP socket.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <string_view>

namespace imud {

struct Endpoint {
  std::array<std::uint64_t, 2> address{};  // the bytes of an IPv6 address; an IPv4 address is mapped (::ffff:a.b.c.d,
                                           // RFC 4291)
  std::uint16_t port = 0;                  // 0: not known, or any

  // Parses "ADDR" or "ADDR:PORT" with a numeric address; an IPv6 address with a port stands in brackets. Throws
  // PortError.
  static Endpoint parse(std::string_view text);
  // Return an endpoint from the 4 or 16 bytes of an address in network byte order, as in a packet.
  static Endpoint ipv4(const void* bytes, std::uint16_t port) noexcept {
    std::uint8_t mapped[8] = {0, 0, 0xFF, 0xFF};
    std::memcpy(mapped + 4, bytes, 4);
    Endpoint endpoint;
    std::memcpy(&endpoint.address[1], mapped, sizeof mapped);
    endpoint.port = port;
    return endpoint;
  }
  static Endpoint ipv6(const void* bytes, std::uint16_t port) noexcept {
    Endpoint endpoint;
    std::memcpy(endpoint.address.data(), bytes, sizeof endpoint.address);
    endpoint.port = port;
    return endpoint;
  }

  // Returns whether `other` has this address and, unless this port is 0, this port.
  bool admits(const Endpoint& other) const noexcept {
    return has_address_of(other) && (port == 0 || port == other.port);
  }
  bool operator==(const Endpoint& other) const noexcept { return has_address_of(other) && port == other.port; }

 private:
  bool has_address_of(const Endpoint& other) const noexcept {
    return address[0] == other.address[0] && address[1] == other.address[1];
  }
};

// The text of an Endpoint, "127.0.0.1:9810" or "[::1]:9810". Allocates nothing.
class EndpointText {
 public:
  explicit EndpointText(const Endpoint& endpoint) noexcept;
  std::string_view whole() const noexcept { return {text_.data(), size_}; }
  // Returns the address without the port and the brackets.
  std::string_view address() const noexcept { return {text_.data() + begin_, end_ - begin_}; }

 private:
  std::array<char, 64> text_;
  std::size_t size_ = 0, begin_ = 0, end_ = 0;
};

}  // namespace imud
