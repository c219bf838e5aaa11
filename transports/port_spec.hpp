// PortSpec: the parsed text of a port in the configuration.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

namespace imud {

// A fault of a port; its text names the fault and the remedy.
struct PortError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// An option of a kind of port. Its value is an integer in [min, max] or one of `choices`; an option with neither a
// range nor choices takes any text.
struct PortOption {
  std::string_view key;
  std::string_view help;  // one line, with the unit and the default
  std::int64_t min = 0, max = 0;
  std::string_view choices = {};  // separated by blanks; the first is the default, unless there is a range as well
  bool device_only = false;       // a listener does not have it

  constexpr bool has_range() const { return min != max; }
};

// "serial:/dev/ttyUSB0?baud=921600&parity=even": scheme, address, options.
struct PortSpec {
  std::string scheme;
  std::string address;  // everything between the first colon and the question mark
  std::map<std::string, std::string, std::less<>> options;

  // Throws PortError on a text of another form.
  static PortSpec parse(std::string_view text);

  // Returns an integer option; nullopt if absent. Throws PortError if it is not an integer within [min, max].
  std::optional<std::int64_t> integer(std::string_view key, std::int64_t min, std::int64_t max) const;
  std::optional<std::int64_t> integer(const PortOption& option) const {
    return integer(option.key, option.min, option.max);
  }
  // Returns the text of an option; nullopt if absent.
  std::optional<std::string> text(std::string_view key) const;
  // Returns an option that is one of `choices` ("none even odd"); the first of them if absent. Throws PortError if
  // it is none of them.
  std::string one_of(std::string_view key, std::string_view choices) const;
  std::string one_of(const PortOption& option) const { return one_of(option.key, option.choices); }
  // Throws PortError if an option is none of `known`, or if its value is not one that it may have.
  void allow_only(std::span<const PortOption> known, bool is_device) const;

  // Returns the error to throw: "scheme:address: what".
  PortError error(std::string_view what) const;
};

// "ADDR:PORT" of UDP or TCP: a numeric IPv4 address, or a numeric IPv6 address in brackets; for port 0 the system
// chooses a port.
struct NumericAddress {
  std::string address;  // without brackets
  std::uint16_t port = 0;

  // Throws PortError on a text of another form.
  static NumericAddress parse(std::string_view text);
  // Returns nullopt for a text of another form.
  static std::optional<NumericAddress> try_parse(std::string_view text);
  // Returns whether programs of this machine alone can reach the address.
  bool is_loopback() const;
};

}  // namespace imud
