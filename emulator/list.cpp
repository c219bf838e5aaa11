#include "emulator/list.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdio>
#include <type_traits>
#include <variant>

#include "protocols/protocol.hpp"
#include "protocols/truth_format.hpp"
#include "transports/port.hpp"

namespace imud {

namespace {

template <class Table>
void list_table(const char* title, const Table& table) {
  fmt::print("{}\n", title);
  for (const auto* entry : table) fmt::print("  {:<12} {} [{}]\n", entry->name, entry->summary, entry->document);
}

// Prints the keys of [imu.device] or [truth] that only this entry has.
template <class Entry>
void list_settings(const Entry& entry) {
  fmt::print("{}: {}\n", entry.name, entry.summary);
  if (entry.settings.empty()) fmt::print("  no settings of its own\n");
  for (const Setting& setting : entry.settings) {
    std::string initial = std::visit(
        [](const auto& value) -> std::string {
          using Value = std::decay_t<decltype(value)>;
          if constexpr (std::is_same_v<Value, std::string_view>)
            return fmt::format("\"{}\"", value);
          else if constexpr (std::is_same_v<Value, std::span<const std::string_view>>)
            return fmt::format("[{}]", fmt::join(value, ", "));
          else
            return fmt::format("{}", value);
        },
        setting.initial);
    if (!setting.choices.empty()) initial += fmt::format("; one of {}", fmt::join(setting.choices, ", "));
    if (setting.min != setting.max) initial += fmt::format("; {} to {}", setting.min, setting.max);
    fmt::print("  {:<24} {} ({})\n", setting.key, setting.help, initial);
  }
}

}  // namespace

int list(const std::string& name) {
  if (!name.empty()) {
    const Protocol* protocol = find_protocol(name);
    const TruthFormat* format = find_truth_format(name);
    if (protocol == nullptr && format == nullptr) {
      fmt::print(stderr, "there is no protocol and no truth format \"{}\"; see imud list\n", name);
      return 2;
    }
    if (protocol != nullptr) list_settings(*protocol);
    if (format != nullptr) list_settings(*format);
    return 0;
  }
  list_table("protocols", protocols());
  list_table("truth formats", truth_formats());
  fmt::print("transports\n");
  for (const Transport* transport : transports())
    fmt::print("  {:<12} {}; {} [{}]\n", transport->name, transport->summary, transport->syntax, transport->document);
  return 0;
}

}  // namespace imud
