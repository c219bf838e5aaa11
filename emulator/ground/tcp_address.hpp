// TcpAddress: where a server of a run listens.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace imud {

struct TcpAddress {
  std::string address;     // numeric
  std::uint16_t port = 0;  // 0: the system chooses one
  bool is_loopback = false;

  // Parses "127.0.0.1:8080" or "[::1]:8080". Returns nullopt for anything else.
  static std::optional<TcpAddress> parse(std::string_view text);
};

}  // namespace imud
