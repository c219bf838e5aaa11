// SignalProduct: a product whose messages a table describes, and the settings that select and schedule the
// messages and set their identifiers. A file of protocols/devices has the table and the Protocol entry; everything
// else is here.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "protocols/signals/signal_device.hpp"

namespace imud {

struct SignalProductMessage {
  std::string_view name;  // in the settings
  std::uint32_t id = 0;   // as delivered
  std::size_t size = 8;
  std::span<const CanSignal> signals;
  MessageChecksum checksum = {};
};

struct SignalProduct {
  std::span<const SignalProductMessage> messages;  // in the order of sending after one sample
  bool has_choice = false;  // true: the setting `messages` selects messages; false: all are sent
  // The sensors as delivered: noise densities, rad/s and m/s^2 per sqrt(Hz), and ranges, rad/s and m/s^2.
  double gyro_noise = 0, gyro_max = 0;
  double accelerometer_noise = 0, accelerometer_max = 0;
};

// The rate of its messages and samples.
constexpr Setting output_rate_setting(double initial, double highest) {
  return real_setting("output_rate_hz", "samples per second, and messages of each kind that has no rate of its own",
                      initial, 1, highest);
}
// `initial` must outlive the setting.
constexpr Setting messages_setting(std::span<const std::string_view> initial) {
  return list_setting("messages",
                      "messages that are sent; NAME@HZ at a rate of its own, by which output_rate_hz is divisible",
                      initial);
}
constexpr Setting identifiers_setting() {
  return list_setting("identifiers", "identifiers that are not those as delivered: NAME=ID");
}
constexpr Setting id_offset_setting() {
  return integer_setting("id_offset",
                         "is added to every identifier as delivered, so that several units can be on one bus", 0, 0,
                         0x1FFF'FFFF);
}
constexpr Setting extended_setting() { return flag_setting("extended", "29-bit identifiers", false); }

// Returns the messages that a unit with these settings sends. Throws std::invalid_argument, "KEY: ..." with the fault
// and the remedy.
std::vector<SignalMessage> messages_of(const SignalProduct& product, const Settings& settings);

// Returns the product as delivered, at its output rate.
Product product_of(const SignalProduct& product, const Settings& settings);

// Returns the entries of Protocol::can_messages.
std::vector<CanMessage> can_messages_of(const std::vector<SignalMessage>& messages, double rate_hz);
inline std::vector<CanFilter> no_can_filters(const Settings&) { return {}; }

// The value of Protocol::make and make_decoder in an entry that signal_protocol() completes.
inline constexpr std::nullptr_t by_table = nullptr;

// Completes `entry`, the Protocol of a product. `Choose` returns the product's table for the settings; `entry`
// needs only the members that do not follow from the table. The name of `Choose` must be unique among all files.
template <const SignalProduct& (*Choose)(const Settings&)>
constexpr Protocol signal_protocol(Protocol entry) {
  entry.link = Link::can;
  entry.can_messages = [](const Settings& settings, double rate_hz) {
    return can_messages_of(messages_of(Choose(settings), settings), rate_hz);
  };
  entry.can_filters = no_can_filters;
  entry.product = [](const Settings& settings) { return product_of(Choose(settings), settings); };
  entry.make = [](const Settings& settings) -> std::unique_ptr<Device> {
    return std::make_unique<SignalDevice>(messages_of(Choose(settings), settings));
  };
  entry.make_decoder = [](const Settings& settings) -> std::unique_ptr<Decoder> {
    return std::make_unique<SignalDecoder>(messages_of(Choose(settings), settings));
  };
  return entry;
}

// Returns the table of a product with one table. The name of `Table` must be unique among all files.
template <const SignalProduct& Table>
const SignalProduct& only_table(const Settings&) {
  return Table;
}
template <const SignalProduct& Table>
constexpr Protocol signal_protocol(Protocol entry) {
  return signal_protocol<only_table<Table>>(entry);
}

}  // namespace imud
