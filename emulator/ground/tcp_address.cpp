#include "emulator/ground/tcp_address.hpp"

#include <boost/asio/ip/address.hpp>
#include <charconv>

namespace imud {

std::optional<TcpAddress> TcpAddress::parse(std::string_view text) {
  const std::size_t colon = text.rfind(':');
  if (colon == text.npos) return std::nullopt;
  std::string_view address = text.substr(0, colon), port = text.substr(colon + 1);
  const bool has_brackets = address.size() > 2 && address.front() == '[' && address.back() == ']';
  if (has_brackets) address = address.substr(1, address.size() - 2);
  TcpAddress parsed;
  parsed.address = address;
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), parsed.port);
  if (error != std::errc() || end != port.data() + port.size()) return std::nullopt;
  boost::system::error_code failure;
  const auto numeric = boost::asio::ip::make_address(parsed.address, failure);
  if (failure || numeric.is_v6() != has_brackets) return std::nullopt;
  parsed.is_loopback = numeric.is_loopback();
  return parsed;
}

}  // namespace imud
