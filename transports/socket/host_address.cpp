// getaddrinfo(3), gai.conf(5), RFC 1123.
#include "transports/socket/host_address.hpp"

#include <fmt/format.h>
#include <netdb.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <map>
#include <memory>

namespace imud {
namespace {

bool is_letter(char c) noexcept { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }

bool is_host_name(std::string_view text) noexcept {
  constexpr std::size_t longest = 253, longest_part = 63;
  if (text.empty() || text.size() > longest || !is_letter(text.front())) return false;
  std::string_view part;
  for (std::string_view rest = text; !rest.empty();) {
    const std::size_t dot = std::min(rest.find('.'), rest.size());
    part = rest.substr(0, dot);
    if (part.empty() || part.size() > longest_part || part.front() == '-' || part.back() == '-') return false;
    const bool has_letters = std::all_of(part.begin(), part.end(), [](char c) {
      return is_letter(c) || (c >= '0' && c <= '9') || c == '-' || c == '_';
    });
    if (!has_letters) return false;
    rest.remove_prefix(std::min(dot + 1, rest.size()));
  }
  return is_letter(part.front());
}

// Returns the numeric address of a name; empty, with the reason, if the name is not known.
std::string look_up(const std::string& name, std::string& reason) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_DGRAM;  // one result for each address
  addrinfo* found = nullptr;
  const int error = ::getaddrinfo(name.c_str(), nullptr, &hints, &found);
  if (error != 0) {
    reason = error == EAI_SYSTEM ? std::strerror(errno) : ::gai_strerror(error);
    return {};
  }
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> owner(found, &::freeaddrinfo);
  const addrinfo* chosen = found;
  for (const addrinfo* one = found; one != nullptr && chosen->ai_family != AF_INET; one = one->ai_next)
    if (one->ai_family == AF_INET) chosen = one;
  char text[NI_MAXHOST] = {};
  if (::getnameinfo(chosen->ai_addr, chosen->ai_addrlen, text, sizeof text, nullptr, 0, NI_NUMERICHOST) != 0)
    reason = "it has no address of IP";
  return text;
}

}  // namespace

HostAddress HostAddress::parse(std::string_view text) {
  const auto wrong = [text](std::string_view what) {
    return PortError(
        fmt::format("'{}': {}; right would be ADDR:PORT with a numeric address or a name, such as 127.0.0.1:9810, "
                    "[::1]:9810 or localhost:9810",
                    text, what));
  };
  const std::size_t colon = text.rfind(':');
  if (colon == text.npos) throw wrong("no port");
  HostAddress result;
  const auto numbers = [&](std::string_view address, std::string_view what) {
    const auto numeric = NumericAddress::try_parse(address);
    if (!numeric) throw wrong(what);
    return *numeric;
  };
  result.port = numbers(fmt::format("0.0.0.0{}", text.substr(colon)), "no port from 0 to 65535").port;
  result.host = text.substr(0, colon);
  result.is_name = is_host_name(result.host);
  if (!result.is_name)
    result.host =
        numbers(text, text.starts_with('[') ? "no IPv6 address" : "no IPv4 address, and no name of a host").address;
  return result;
}

NumericAddress HostAddress::numeric() const {
  if (!is_name) return {host, port};
  thread_local std::map<std::string, std::string> known;
  auto entry = known.find(host);
  if (entry == known.end()) {
    std::string reason;
    const std::string address = look_up(host, reason);
    if (address.empty())
      throw PortError(
          fmt::format("there is no host \"{}\" ({}); right would be its address, or a name that this machine "
                      "knows: getent hosts NAME",
                      host, reason));
    entry = known.emplace(host, address).first;
  }
  return {entry->second, port};
}

}  // namespace imud
