#include "emulator/config/recorded_config.hpp"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <sstream>
#include <string_view>

#include "transports/capture/pcapng_reader.hpp"
#include "transports/capture/record_packet.hpp"

namespace imud {
namespace {

constexpr std::array<std::string_view, 4> free_keys = {"clock", "control", "realtime", "truth.port"};
constexpr std::array<std::string_view, 4> free_keys_of_imu = {"also", "pace", "port", "second_port"};

template <std::size_t n>
bool has(const std::array<std::string_view, n>& keys, std::string_view key) {
  return std::find(keys.begin(), keys.end(), key) != keys.end();
}

// Returns a value as in TOML; words for a missing key or a table.
std::string text_of(const toml::node* node) {
  if (node == nullptr) return "no value";
  if (node->is_table()) return "a table";
  std::ostringstream text;
  node->visit([&](const auto& value) { text << value; });
  return text.str();
}

const toml::table* imu_named(const toml::table& root, const std::string& name) {
  if (const toml::array* imus = root["imu"].as_array())
    for (const toml::node& imu : *imus)
      if (const toml::table* table = imu.as_table(); table && (*table)["name"].value_or(std::string()) == name)
        return table;
  return nullptr;
}

// Compares tables with all keys of both. `prefix`: of the keys' names; `is_free` returns true for keys that may
// differ.
template <class IsFree>
void compare(const toml::table& ours, const toml::table& theirs, const std::string& prefix, const IsFree& is_free,
             std::vector<std::string>& all) {
  std::vector<std::string> keys;
  for (const toml::table* table : {&ours, &theirs})
    for (auto&& [key, value] : *table)
      if (const std::string name(key.str()); std::find(keys.begin(), keys.end(), name) == keys.end())
        keys.push_back(name);
  for (const std::string& key : keys) {
    const std::string name = prefix + key;
    const toml::node *one = ours.get(key), *other = theirs.get(key);
    if (is_free(name)) continue;
    if (one != nullptr && other != nullptr && one->is_table() && other->is_table()) {
      compare(*one->as_table(), *other->as_table(), name + ".", is_free, all);
    } else if (text_of(one) != text_of(other)) {
      all.push_back(fmt::format("{}: {}, but {} in the recorded run", name, text_of(one), text_of(other)));
    }
  }
}

}  // namespace

std::optional<std::string> recorded_config(const std::string& path) {
  const Transport* transport = record_transport_of(path);
  if (transport == nullptr) return std::nullopt;
  PcapngReader reader(PortSpec{std::string(transport->name), path, {}});
  std::string text;
  // Programs that sort or merge packets by time may put others before it and between its pieces.
  constexpr std::size_t most_others = 10'000;
  std::size_t others = 0;  // since the last piece
  while ((text.empty() || others < most_others) && !reader.at_end()) {
    const auto packet = reader.next();
    if (!packet) continue;
    const PcapngInterface& interface = reader.interfaces()[packet->interface];
    ++others;
    if (interface.link_type != link_type::text || interface.name != config_interface) continue;
    text.append(reinterpret_cast<const char*>(packet->bytes.data()), packet->bytes.size());
    others = 0;
  }
  return text;
}

std::vector<std::string> differences(const Config& config, const Config& recorded) {
  const toml::table ours = toml::parse(config.resolved), theirs = toml::parse(recorded.resolved);
  std::vector<std::string> all;
  compare(
      ours, theirs, "", [](std::string_view key) { return key == "imu" || has(free_keys, key); }, all);
  for (const ImuConfig& imu : config.imus) {
    const toml::table *one = imu_named(ours, imu.name), *other = imu_named(theirs, imu.name);
    if (one == nullptr || other == nullptr) continue;
    const std::string prefix = fmt::format("imu.{}.", imu.name);
    compare(
        *one, *other, prefix, [&](std::string_view key) { return has(free_keys_of_imu, key.substr(prefix.size())); },
        all);
  }
  return all;
}

}  // namespace imud
