#include "emulator/config/recorded_config.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <span>
#include <string_view>

#include "emulator/ground/table_comparison.hpp"
#include "transports/capture/pcapng_reader.hpp"
#include "transports/capture/record_packet.hpp"

namespace imud {
namespace {

constexpr std::string_view free_keys[] = {"clock", "control", "imu", "realtime", "truth.port"};
constexpr std::string_view free_keys_of_imu[] = {"also", "pace", "port", "second_port"};

// Returns true if the key is in the list, or below a key of the list.
bool is_in(std::span<const std::string_view> keys, std::string_view key) {
  return std::ranges::any_of(keys, [&](std::string_view one) {
    return key.starts_with(one) && (key.size() == one.size() || key[one.size()] == '.');
  });
}

}  // namespace

std::optional<std::string> recorded_config(const std::string& path) {
  const Transport* transport = record_transport_of(path);
  if (transport == nullptr) return std::nullopt;
  PcapngReader reader(PortSpec{std::string(transport->name), path, {}});
  std::string text;
  // Programs that sort or merge packets by time may put other packets before the configuration and between its
  // pieces.
  constexpr std::size_t most_others = 10'000;
  std::size_t others = 0;  // other packets since the last piece
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
  const toml::table ours = toml::parse(config.resolved()), theirs = toml::parse(recorded.resolved());
  std::vector<std::string> all;
  const auto add = [&](const std::string& key, const std::string& is, const std::string& was) {
    all.push_back(fmt::format("{}: {}, but {} in the recorded run", key, is, was));
  };
  compare(&ours, &theirs, "", false, [&](const std::string& key, const std::string& is, const std::string& was) {
    if (!is_in(free_keys, key)) add(key, is, was);
  });
  for (const ImuConfig& imu : config.imus) {
    const toml::table *one = imu_table(ours, imu.name), *other = imu_table(theirs, imu.name);
    if (one == nullptr || other == nullptr) continue;
    const std::string prefix = fmt::format("imu.{}.", imu.name);
    compare(one, other, prefix, false, [&](const std::string& key, const std::string& is, const std::string& was) {
      if (!is_in(free_keys_of_imu, std::string_view(key).substr(prefix.size()))) add(key, is, was);
    });
  }
  return all;
}

}  // namespace imud
