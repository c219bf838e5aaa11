#include "protocols/signals/signal_product.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "core/numbers/number_text.hpp"

namespace imud {
namespace {

[[noreturn]] void refuse(const char* key, const std::string& fault) {
  throw std::invalid_argument(std::string(key) + ": " + fault);
}

const SignalProductMessage& named(const SignalProduct& product, const char* key, std::string_view name) {
  std::string names;
  for (const SignalProductMessage& message : product.messages) {
    if (message.name == name) return message;
    names.append(names.empty() ? "" : ", ").append(message.name);
  }
  refuse(key, "unknown message \"" + std::string(name) + "\"; the messages are " + names);
}

// Returns the identifiers of the product's messages in the order of the table.
std::vector<std::uint32_t> identifiers_of(const SignalProduct& product, const Settings& settings, bool extended) {
  const auto offset = static_cast<std::uint64_t>(settings.integer("id_offset"));
  std::vector<std::uint64_t> ids;
  for (const SignalProductMessage& message : product.messages) ids.push_back(message.id + offset);
  for (const std::string& text : settings.list("identifiers")) {
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos) refuse("identifiers", "\"" + text + "\": give NAME=ID, such as imu=0x123");
    const SignalProductMessage& message = named(product, "identifiers", std::string_view(text).substr(0, equals));
    const auto id = number_or_hex_in<std::uint32_t>(std::string_view(text).substr(equals + 1));
    if (!id) refuse("identifiers", "\"" + text + "\": the identifier must be a number, such as 0x123");
    ids[static_cast<std::size_t>(&message - product.messages.data())] = *id;
  }
  const std::uint64_t highest = extended ? 0x1FFF'FFFF : 0x7FF;
  std::vector<std::uint32_t> result;
  for (const std::uint64_t id : ids) {
    if (id > highest)
      refuse(id - offset > highest ? "identifiers" : "id_offset",
             "an identifier exceeds " + std::to_string(highest) +
                 (extended ? "" : "; with extended = true it may be higher"));
    result.push_back(static_cast<std::uint32_t>(id));
  }
  return result;
}

// A message that is sent, with every `divider`-th sample.
struct Chosen {
  const SignalProductMessage* message;
  std::int64_t divider;
};
std::vector<Chosen> chosen(const SignalProduct& product, const Settings& settings) {
  std::vector<Chosen> all;
  if (!product.has_choice) {
    for (const SignalProductMessage& message : product.messages) all.push_back({&message, 1});
    return all;
  }
  const double rate_hz = settings.real("output_rate_hz");
  for (const std::string& text : settings.list("messages")) {
    const std::size_t at = text.find('@');
    const SignalProductMessage& message = named(product, "messages", std::string_view(text).substr(0, at));
    double ratio = 1;
    if (at != std::string::npos) {
      const double hz = number_in<double>(std::string_view(text).substr(at + 1)).value_or(0);
      ratio = hz > 0 ? rate_hz / hz : 0;
      if (!(ratio >= 1 && ratio <= 1e6) || std::abs(ratio - std::round(ratio)) > 1e-6)
        refuse("messages", "\"" + text + "\": output_rate_hz must be divisible by the rate of a message");
    }
    if (std::ranges::count(all, &message, &Chosen::message) > 0)
      refuse("messages", "\"" + text + "\": the message is listed twice");
    all.push_back({&message, std::llround(ratio)});
  }
  if (all.empty()) refuse("messages", "list at least one message");
  std::ranges::sort(all, {}, &Chosen::message);  // the order of the table
  return all;
}

}  // namespace

std::vector<SignalMessage> messages_of(const SignalProduct& product, const Settings& settings) {
  const bool extended = settings.flag("extended");
  const std::vector<std::uint32_t> ids = identifiers_of(product, settings, extended);
  const double rate_hz = settings.real("output_rate_hz");
  std::vector<SignalMessage> messages;
  for (const Chosen& one : chosen(product, settings)) {
    const std::uint32_t id = ids[static_cast<std::size_t>(one.message - product.messages.data())];
    for (const SignalMessage& other : messages)
      if (other.can.id == id) refuse("identifiers", "two messages have the identifier " + std::to_string(id));
    const Nanoseconds period =
        one.divider == 1 ? Nanoseconds{} : nanoseconds(static_cast<double>(one.divider) / rate_hz);
    messages.push_back({{.id = id, .extended = extended},
                        period,
                        CanSignalCodec(one.message->size, one.message->signals, one.message->checksum)});
  }
  return messages;
}

Product product_of(const SignalProduct& product, const Settings& settings) {
  Product delivered;
  delivered.rate_hz = settings.real("output_rate_hz");
  delivered.gyro = TriadErrors::white(product.gyro_noise, delivered.rate_hz, product.gyro_max);
  delivered.accelerometer =
      TriadErrors::white(product.accelerometer_noise, delivered.rate_hz, product.accelerometer_max);
  return delivered;
}

std::vector<CanMessage> can_messages_of(const std::vector<SignalMessage>& messages, double rate_hz) {
  std::vector<CanMessage> all;
  for (const SignalMessage& message : messages)
    all.push_back({message.can, message.codec.size(), rate_of(message, rate_hz)});
  return all;
}

}  // namespace imud
