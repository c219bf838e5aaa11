#include "transports/endpoint.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>

#include <charconv>
#include <string>

#include "transports/port_spec.hpp"

namespace imud {

Endpoint Endpoint::parse(std::string_view text) {
  std::string host(text);
  Endpoint endpoint;
  // A colon precedes the port, if it is the only one or follows a bracket.
  const std::size_t colon = text.rfind(':');
  const bool bracket = text.starts_with('[');
  if (colon != text.npos && (bracket ? colon > 0 && text[colon - 1] == ']' : text.find(':') == colon)) {
    const NumericAddress whole = NumericAddress::parse(text);
    if (whole.port == 0) throw PortError(fmt::format("'{}': a sender has no port 0; give its port, or none", text));
    host = whole.address;
    endpoint.port = whole.port;
  }
  in_addr v4{};
  if (::inet_pton(AF_INET, host.c_str(), &v4) == 1) return ipv4(&v4, endpoint.port);
  if (::inet_pton(AF_INET6, host.c_str(), endpoint.address.data()) == 1) return endpoint;
  throw PortError(
      fmt::format("'{}': no numeric address; right would be ADDR or ADDR:PORT, such as 192.168.0.5, "
                  "192.168.0.5:40000 or [::1]:40000",
                  text));
}

EndpointText::EndpointText(const Endpoint& endpoint) noexcept {
  in6_addr address;
  std::memcpy(&address, endpoint.address.data(), sizeof address);
  const bool is_v4 = IN6_IS_ADDR_V4MAPPED(&address);
  if (!is_v4) text_[begin_++] = '[';
  ::inet_ntop(is_v4 ? AF_INET : AF_INET6, address.s6_addr + (is_v4 ? 12 : 0), text_.data() + begin_,
              INET6_ADDRSTRLEN);
  end_ = size_ = std::strlen(text_.data());
  if (!is_v4) text_[size_++] = ']';
  text_[size_++] = ':';
  size_ =
      static_cast<std::size_t>(std::to_chars(text_.data() + size_, text_.end(), endpoint.port).ptr - text_.data());
}

}  // namespace imud
