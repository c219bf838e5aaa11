#include "transports/port_spec.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <vector>

#include "core/numbers/number_text.hpp"

namespace imud {
namespace {

std::vector<std::string_view> words(std::string_view text, char separator) {
  std::vector<std::string_view> found;
  while (true) {
    const std::size_t end = text.find(separator);
    found.push_back(text.substr(0, end));
    if (end == std::string_view::npos) return found;
    text.remove_prefix(end + 1);
  }
}

bool contains(std::string_view list, std::string_view word) {
  const auto all = words(list, ' ');
  return std::find(all.begin(), all.end(), word) != all.end();
}

std::optional<in6_addr> ipv6_in(const std::string& text) {
  // A link-local address carries its interface: fe80::1%eth0.
  const std::string plain = text.substr(0, text.find('%'));
  in6_addr binary{};
  return ::inet_pton(AF_INET6, plain.c_str(), &binary) == 1 ? std::optional(binary) : std::nullopt;
}

}  // namespace

PortSpec PortSpec::parse(std::string_view text) {
  const auto wrong = [text](std::string_view what) {
    return PortError(
        fmt::format("'{}': {}; a port is scheme:address?key=value&key=value, such as "
                    "serial:/dev/ttyUSB0?baud=921600",
                    text, what));
  };
  const std::size_t colon = text.find(':');
  if (colon == std::string_view::npos || colon == 0) throw wrong("no scheme before a colon");
  PortSpec spec;
  spec.scheme = text.substr(0, colon);
  const std::string_view rest = text.substr(colon + 1);
  const std::size_t question_mark = rest.find('?');
  spec.address = rest.substr(0, question_mark);
  if (spec.address.empty()) throw wrong("no address after the colon");
  if (question_mark == std::string_view::npos) return spec;

  for (const std::string_view option : words(rest.substr(question_mark + 1), '&')) {
    const std::size_t equals = option.find('=');
    if (equals == std::string_view::npos || equals == 0 || equals + 1 == option.size())
      throw wrong(fmt::format("'{}' is not key=value", option));
    const auto [entry, is_new] = spec.options.emplace(option.substr(0, equals), option.substr(equals + 1));
    if (!is_new) throw wrong(fmt::format("'{}' is given twice", entry->first));
  }
  return spec;
}

std::optional<std::int64_t> PortSpec::integer(std::string_view key, std::int64_t min, std::int64_t max) const {
  const auto option = options.find(key);
  if (option == options.end()) return std::nullopt;
  const auto value = number_in<std::int64_t>(option->second);
  if (!value || *value < min || *value > max)
    throw error(fmt::format("{}={}: right would be an integer from {} to {}", key, option->second, min, max));
  return value;
}

std::optional<std::string> PortSpec::text(std::string_view key) const {
  const auto option = options.find(key);
  if (option == options.end()) return std::nullopt;
  return option->second;
}

std::string PortSpec::one_of(std::string_view key, std::string_view choices) const {
  const auto option = options.find(key);
  if (option == options.end()) return std::string(words(choices, ' ').front());
  if (!contains(choices, option->second))
    throw error(fmt::format("{}={}: right would be one of: {}", key, option->second, choices));
  return option->second;
}

void PortSpec::allow_only(std::span<const PortOption> known, bool is_device) const {
  std::vector<std::string_view> keys;
  for (const PortOption& option : known)
    if (is_device || !option.device_only) keys.push_back(option.key);
  for (const auto& [key, value] : options)
    if (std::find(keys.begin(), keys.end(), key) == keys.end())
      throw error(keys.empty() ? fmt::format("unknown option '{}'; {} has none", key, scheme)
                               : fmt::format("unknown option '{}'; {} knows: {}", key, scheme, fmt::join(keys, " ")));
  for (const PortOption& option : known) {
    if (option.has_range() && !contains(option.choices, text(option.key).value_or("")))
      static_cast<void>(integer(option));
    else if (!option.choices.empty())
      static_cast<void>(one_of(option));
  }
}

PortError PortSpec::error(std::string_view what) const {
  return PortError(fmt::format("{}:{}: {}", scheme, address, what));
}

NumericAddress NumericAddress::parse(std::string_view text) {
  const auto wrong = [text](std::string_view what) {
    return PortError(
        fmt::format("'{}': {}; right would be ADDR:PORT with a numeric address, such as 127.0.0.1:9810 or "
                    "[::1]:9810",
                    text, what));
  };
  const std::size_t colon = text.rfind(':');
  if (colon == std::string_view::npos) throw wrong("no port");
  NumericAddress result;
  const auto port = number_in<std::uint16_t>(text.substr(colon + 1));
  if (!port) throw wrong("no port from 0 to 65535");
  result.port = *port;

  const std::string_view host = text.substr(0, colon);
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') {
    result.address = host.substr(1, host.size() - 2);
    if (!ipv6_in(result.address)) throw wrong("no IPv6 address");
  } else {
    result.address = host;
    in_addr binary{};
    if (::inet_pton(AF_INET, result.address.c_str(), &binary) != 1) throw wrong("no IPv4 address");
  }
  return result;
}

std::optional<NumericAddress> NumericAddress::try_parse(std::string_view text) {
  try {
    return parse(text);
  } catch (const PortError&) {
    return std::nullopt;
  }
}

bool NumericAddress::is_loopback() const {
  const auto binary = ipv6_in(address);
  return binary ? IN6_IS_ADDR_LOOPBACK(&*binary) != 0 : address.starts_with("127.");
}

}  // namespace imud
