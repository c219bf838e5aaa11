#include "protocols/dronecan/settings.hpp"

#include <stdexcept>
#include <string>

#include "core/numbers/number_text.hpp"
#include "core/units.hpp"

namespace imud::dronecan {
namespace {

Version version_in(const Settings& settings, const std::string& key) {
  const std::string_view text = settings.text(key);
  const std::size_t dot = text.find('.');
  const auto major = number_in<std::uint8_t>(text.substr(0, dot));
  const auto minor = dot == text.npos ? std::nullopt : number_in<std::uint8_t>(text.substr(dot + 1));
  if (!major || !minor) throw std::invalid_argument(key + ": give two numbers of 0 to 255, such as \"1.0\"");
  return {*major, *minor};
}

UniqueId unique_id_of(const Settings& settings) {
  UniqueId id = {'i', 'm', 'u', 'd'};
  id.back() = static_cast<std::uint8_t>(settings.integer("node_id"));
  const std::string_view text = settings.text("unique_id");
  if (text.empty()) return id;
  bool is_good = text.size() == 2 * id.size() && text.find_first_not_of('0') != text.npos;
  for (std::size_t i = 0; i < id.size() && is_good; ++i) {
    const auto byte = number_in<std::uint8_t>(text.substr(2 * i, 2), 16);
    is_good = byte.has_value();
    id[i] = byte.value_or(0);
  }
  if (!is_good) throw std::invalid_argument("unique_id: give 32 hexadecimal digits, not all 0");
  return id;
}

std::string name_of(const Settings& settings) {
  const std::string& name = settings.text("name");
  constexpr std::string_view allowed = "abcdefghijklmnopqrstuvwxyz0123456789.-_";
  constexpr std::size_t longest = 80;
  if (name.empty() || name.size() > longest || name.find_first_not_of(allowed) != name.npos)
    throw std::invalid_argument("name: give 1 to 80 of the characters a-z 0-9 . - _");
  return name;
}

}  // namespace

Configuration configuration_of(const Settings& settings) {
  Configuration c{.identity = {.unique_id = unique_id_of(settings),
                               .name = name_of(settings),
                               .software = version_in(settings, "software_version"),
                               .hardware = version_in(settings, "hardware_version"),
                               .start_up = std::chrono::milliseconds(settings.integer("start_up_ms"))},
                  .values = {},
                  .sample_rate = settings.integer("sample_rate_hz"),
                  .is_device_time = settings.text("timestamp") == time_bases[1]};
  const Memory memory{.factory = {}, .stored = {}, .active = {}, .sample_rate = c.sample_rate};
  for (std::size_t key = 0; key < key_count; ++key) {
    const std::string name(parameters[key].name);
    c.values[key] = parameters[key].is_flag ? settings.flag(name) : settings.integer(name);
    if (!memory.accepts(key, c.values[key]))
      throw std::invalid_argument(name + ": give a divisor of sample_rate_hz, or 0 for none");
  }
  return c;
}

// The data sheets of an ICM-42688-P, an RM3100 and a DPS310: 2.8 mdeg/s, 70 ug and 1.2 nT per sqrt(Hz); 2000 deg/s,
// 16 g, 800 uT; 0.5 Pa.
Product product_of(const Settings& settings) {
  Product product;
  product.rate_hz = static_cast<double>(configuration_of(settings).sample_rate);
  product.gyro = TriadErrors::white(2.8e-3 * units::degree, product.rate_hz, 2000 * units::degree);
  product.accelerometer =
      TriadErrors::white(70e-6 * units::standard_gravity, product.rate_hz, 16 * units::standard_gravity);
  product.magnetometer = TriadErrors::white(1.2e-9, product.rate_hz, 800e-6);
  product.barometer.noise = 0.5;
  return product;
}

std::vector<CanMessage> can_messages(const Settings& settings, double) {
  const Configuration c = configuration_of(settings);
  std::vector<CanMessage> messages;
  // An allocated node id is listed as the highest id, which an allocator assigns to the first node that asks.
  constexpr unsigned first_allocated = 125;
  const auto node_id = static_cast<unsigned>(c.values[node_id_key]);
  const auto add = [&](unsigned priority, const DataType& type, std::size_t size, std::int64_t rate) {
    const std::size_t frames = frame_count(size);
    const Identifier identifier{
        .priority = priority, .type = type.id, .source = node_id != anonymous ? node_id : first_allocated};
    messages.push_back({.can = identifier.header(),
                        .max_size = frames > 1 ? frame_data + 1 : size + 1,
                        .max_frames_per_s = static_cast<double>(rate) * static_cast<double>(frames),
                        .is_assigned = node_id == anonymous});
  };
  for (const Stream& stream : streams)
    if (c.values[stream.rate] != 0)
      add(static_cast<unsigned>(c.values[priority_key]), *stream.type, stream.size, c.values[stream.rate]);
  add(status_priority, node_status, sizeof(NodeStatusWire), 1);
  if (node_id == anonymous) {
    constexpr double most_requests = 3;  // one for each part of the unique id
    const Identifier identifier{
        .priority = status_priority, .type = allocation.id, .discriminator = discriminator_of(c.identity.unique_id)};
    messages.push_back({identifier.header(), frame_data + 1, most_requests});
  }
  return messages;
}

// All NodeStatus messages pass, because they show other nodes that have the unit's node id. The destination is not
// filtered, because the host may change this node id.
std::vector<CanFilter> can_filters(const Settings&) {
  constexpr std::uint32_t service = 0x80, message_type = 0xFFFF80, anonymous_type = 0x3FF;
  const auto messages_of = [](const DataType& type) {
    return CanFilter{.id = std::uint32_t{type.id} << 8, .mask = message_type, .extended = true};
  };
  return {{.id = service, .mask = service, .extended = true},
          messages_of(node_status),
          messages_of(global_time_sync),
          messages_of(allocation),
          {.id = std::uint32_t{allocation.id} << 8, .mask = anonymous_type, .extended = true}};
}

}  // namespace imud::dronecan
