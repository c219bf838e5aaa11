// SignalProduct: a product whose messages are a table, and the settings that select, schedule and number them. A file
// of protocols/devices has the table and the entry; all else is here.
#pragma once

#include <memory>
#include <vector>

#include "protocols/signal_device.hpp"

namespace imud {

struct SignalProductMessage {
  std::string_view name;  // in the settings
  std::uint32_t id = 0;   // as delivered
  std::size_t size = 8;
  std::span<const CanSignal> signals;
  MessageChecksum checksum = {};
};

struct SignalProduct {
  std::span<const SignalProductMessage> messages;  // in the order in which those of one sample are sent
  bool has_choice = false;  // the setting `messages` chooses among them; otherwise all are sent
};

// --- The settings of a product, which its file lists ---

// The rate of its messages and samples.
constexpr Setting output_rate_setting(double initial, double highest) {
  return {.key = "output_rate_hz",
          .help = "samples per second, and messages of each kind that has no rate of its own",
          .initial = initial,
          .min = 1,
          .max = highest};
}
// `initial` must outlive the setting.
constexpr Setting messages_setting(std::span<const std::string_view> initial) {
  return {.key = "messages",
          .help = "messages that are sent; NAME@HZ at a rate of its own, by which output_rate_hz is divisible",
          .initial = initial};
}
constexpr Setting identifiers_setting() {
  return {.key = "identifiers",
          .help = "identifiers that are not those as delivered: NAME=ID",
          .initial = std::span<const std::string_view>{}};
}
constexpr Setting id_offset_setting() {
  return {.key = "id_offset",
          .help = "is added to every identifier as delivered, so that several units can be on one bus",
          .initial = std::int64_t{0},
          .max = 0x1FFF'FFFF};
}
constexpr Setting extended_setting() { return {.key = "extended", .help = "29-bit identifiers", .initial = false}; }

// Returns the messages that a unit with these settings sends. Throws std::invalid_argument, "KEY: ..." with the fault
// and the remedy.
std::vector<SignalMessage> messages_of(const SignalProduct& product, const Settings& settings);

// Returns the entries of Protocol::can_messages.
std::vector<CanMessage> can_messages_of(const std::vector<SignalMessage>& messages, double rate_hz);

// --- The functions of the entry; `Product` is the table ---
template <const SignalProduct& Product>
std::unique_ptr<Device> make_signal_device(const Settings& settings) {
  return std::make_unique<SignalDevice>(messages_of(Product, settings));
}
template <const SignalProduct& Product>
std::unique_ptr<Decoder> make_signal_decoder(const Settings& settings) {
  return std::make_unique<SignalDecoder>(messages_of(Product, settings));
}
template <const SignalProduct& Product>
std::vector<CanMessage> signal_can_messages(const Settings& settings, double rate_hz) {
  return can_messages_of(messages_of(Product, settings), rate_hz);
}
inline std::vector<CanFilter> no_can_filters(const Settings&) { return {}; }

}  // namespace imud
