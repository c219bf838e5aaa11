// The parts of reading a configuration that are shared, or have a file of their own.
#pragma once

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/config.hpp"
#include "emulator/table_reader.hpp"
#include "transports/port.hpp"

namespace imud {

template <class Entry>
std::vector<std::string> names(std::span<const Entry* const> table) {
  std::vector<std::string> all;
  for (const Entry* entry : table) all.emplace_back(entry->name);
  return all;
}

// Returns `found`, the table entry that `word` names. If there is none, that is a fault of `key`, unless `word` is
// empty because the key is absent or no text, which is a fault already.
template <class Entry>
const Entry* entry(TableReader& table, std::string_view key, const std::string& word,
                   std::span<const Entry* const> entries, const Entry* found) {
  if (found != nullptr || (word.empty() && !table.is_text(key))) return found;
  const std::string meant = nearest(word, names(entries));
  table.fault(key, fmt::format("there is no \"{}\"; {}", word,
                               meant.empty() ? fmt::format("known: {}", fmt::join(names(entries), ", "))
                                             : fmt::format("did you mean \"{}\"?", meant)));
  return nullptr;
}

// Takes every declared setting that is there.
Settings read_settings(TableReader& table, std::span<const Setting> declared);

// Returns the transport of a port's text if a port of it can be opened with `settings`; nullptr with a fault of `key`
// if not, and without if the key has no text.
const Transport* read_port(TableReader& table, std::string_view key, const std::string& text,
                           const PortSettings& settings);

// Returns what can be given for a port whose transport fulfils `condition`, in quotes.
template <class Condition>
std::string ports_that(Condition condition) {
  return fmt::format("\"{}\"", fmt::join(port_examples(condition), "\" or \""));
}

// One [[imu]], the `index`-th (imu_config.cpp).
ImuConfig read_imu(TableReader& table, std::size_t index);
// Two imus that would disturb one another are a fault.
void check_imus_together(const std::vector<ImuConfig>& imus, const std::string& truth_port, const toml::array* tables,
                         Faults& faults);
// Whether these bits of Sample::status come through the imu's protocol.
bool carries_status(const ImuConfig& imu, std::uint32_t bits);

}  // namespace imud
