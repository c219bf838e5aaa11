// PortSpec: a port's name in the configuration, taken apart.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

namespace imud {

// A fault of a port; the text has the fault and what would be right.
struct PortError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// "serial:/dev/ttyUSB0?baud=921600&parity=even": scheme, address, options.
struct PortSpec {
  std::string scheme;
  std::string address;  // all between the first colon and the question mark
  std::map<std::string, std::string, std::less<>> options;

  // Throws PortError on a text that has not this form.
  static PortSpec parse(std::string_view text);

  // An integer option within [min, max]; nullopt if absent. Throws PortError.
  std::optional<std::int64_t> integer(std::string_view key, std::int64_t min, std::int64_t max) const;
  std::optional<std::string> text(std::string_view key) const;
  // An option that is one of `choices` ("none even odd"); the first of them if absent. Throws PortError.
  std::string one_of(std::string_view key, std::string_view choices) const;
  // Throws PortError if an option is none of `known` ("baud parity stop").
  void allow_only(std::string_view known) const;

  // The error to throw: "scheme:address: what".
  PortError error(std::string_view what) const;
};

// "ADDR:PORT" of UDP: a numeric IPv4 address, or a numeric IPv6 address in brackets. Throws PortError.
struct UdpAddress {
  std::string address;
  std::uint16_t port = 0;
  static UdpAddress parse(std::string_view text);
};

}  // namespace imud
