#include "protocols/canopen/settings.hpp"

#include <cmath>
#include <stdexcept>
#include <string>
#include <string_view>

#include "protocols/canopen/pdo.hpp"

namespace imud::canopen {
namespace {

constexpr std::array<std::string_view, quantities> quantity_names = {"rate", "specific_force", "delta_angle",
                                                                     "delta_velocity", "magnetic_field"};
constexpr std::array<std::string_view, 3> formats = {"i16", "i32", "f32"};
constexpr std::array<std::string_view, 3> axes = {"x", "y", "z"};

struct Named {
  std::string_view name;
  std::uint16_t index;
  std::uint8_t sub = 0;
};
constexpr Named scalars[] = {
    {"error_register", 0x1001},     {"pressure_u32", 0x2150, 1},    {"pressure_f32", 0x2150, 2},
    {"temperature_i16", 0x2160, 1}, {"temperature_f32", 0x2160, 2}, {"time_u16", 0x2170, 1},
    {"time_u32", 0x2170, 2},        {"time_u64", 0x2170, 3},        {"time_of_day", 0x2170, 4},
    {"counter_u8", 0x2180, 1},      {"counter_u16", 0x2180, 2},     {"counter_u32", 0x2180, 3},
    {"counter_u64", 0x2180, 4},     {"status_u8", 0x2190, 1},       {"status_u16", 0x2190, 2},
    {"status_u32", 0x2190, 3},      {"slope_long_i16", 0x6010},     {"slope_lateral_i16", 0x6020},
    {"slope_long_i32", 0x6110},     {"slope_lateral_i32", 0x6120}};

constexpr std::string_view tpdo_1[] = {"specific_force_i16", "counter_u16"};
constexpr std::string_view tpdo_2[] = {"rate_i16", "counter_u8", "status_u8"};
constexpr std::string_view tpdo_3[] = {"delta_angle_i16", "counter_u16"};
constexpr std::string_view tpdo_4[] = {"delta_velocity_i16", "counter_u16"};

// Appends the position of the object of this name, or the positions of all axes of a quantity of this name. Returns
// false if there is no such name.
bool append_named(std::string_view name, std::vector<std::size_t>& positions) {
  for (const Named& one : scalars)
    if (one.name == name) {
      positions.push_back(find_object(one.index, one.sub));
      return true;
    }
  for (unsigned q = 0; q < quantities; ++q)
    for (unsigned f = 0; f < formats.size(); ++f) {
      const std::string vector = std::string(quantity_names[q]) + '_' + std::string(formats[f]);
      for (unsigned axis = 0; axis < axes.size(); ++axis) {
        if (name != vector && name != vector + '.' + std::string(axes[axis])) continue;
        const auto index = static_cast<std::uint16_t>(first_quantity + 0x10 * q + f);
        positions.push_back(find_object(index, static_cast<std::uint8_t>(axis + 1)));
        if (name != vector || axis + 1 == axes.size()) return true;
      }
    }
  return false;
}

std::string tpdo_key(std::size_t i, std::string_view suffix = "") {
  return "tpdo" + std::to_string(i + 1) + std::string(suffix);
}

std::vector<std::size_t> mapped_objects(const Settings& settings, const std::string& key) {
  std::vector<std::size_t> positions;
  for (const std::string& name : settings.list(key))
    if (!append_named(name, positions))
      throw std::invalid_argument(key + ": there is no '" + name +
                                  "'; give such as \"rate_i16\", \"rate_f32.x\", \"counter_u16\", \"status_u8\", "
                                  "\"time_u32\", \"temperature_i16\", \"slope_long_i16\"");
  std::size_t size = 0;
  for (const std::size_t position : positions) size += size_of(objects[position].type);
  if (size > 8 || positions.size() > largest_mapping)
    throw std::invalid_argument(key + ": these objects have " + std::to_string(size) +
                                " bytes; a message has 8 at most");
  return positions;
}

}  // namespace

constinit const Setting declared_settings[setting_count] = {
    integer_setting("node_id", "node id, 1 to 127; 255: none, the device waits for LSS to set one", 10, 1,
                    unconfigured),
    integer_setting("device_type",
                    "1000: profile 410, in the high word the variant: 4 two axes of 32 bits, 2 of 16 bits",
                    inclinometer_32_bit, 0, 0xFFFFFFFF),
    integer_setting("vendor_id", "1018:1, and for LSS", 0, 0, 0xFFFFFFFF),
    integer_setting("product_code", "1018:2", 1, 0, 0xFFFFFFFF),
    integer_setting("revision_number", "1018:3", 0x10000, 0, 0xFFFFFFFF),
    integer_setting("serial_number", "1018:4; LSS tells units apart by it", 1, 0, 0xFFFFFFFF),
    integer_setting("start_up_ms", "time from power on or a reset to the boot-up message, ms", 50, 0, 60000),
    flag_setting("self_start", "1F80: becomes operational by itself, without a master's command", false),
    integer_setting("heartbeat_ms", "1017: period of the heartbeat, ms; 0: none, and node guarding is answered", 1000,
                    0, 65535),
    list_setting("tpdo1", "1A00: what the message has", tpdo_1),
    flag_setting("tpdo1_enabled", "1800:1: the message is sent", true),
    integer_setting("tpdo1_type",
                    "1800:2: 0 to 240: at SYNC; 252, 253: at a remote request; 254, 255: by samples or timer", 254, 0,
                    255),
    integer_setting("tpdo1_event_ms", "1800:5: period of types 254 and 255, ms; 0: every sample", 0, 0, 65535),
    list_setting("tpdo2", "1A01", tpdo_2),
    flag_setting("tpdo2_enabled", "1801:1", true),
    integer_setting("tpdo2_type", "1801:2", 254, 0, 255),
    integer_setting("tpdo2_event_ms", "1801:5, ms", 0, 0, 65535),
    list_setting("tpdo3", "1A02", tpdo_3),
    flag_setting("tpdo3_enabled", "1802:1", false),
    integer_setting("tpdo3_type", "1802:2", 254, 0, 255),
    integer_setting("tpdo3_event_ms", "1802:5, ms", 0, 0, 65535),
    list_setting("tpdo4", "1A03", tpdo_4),
    flag_setting("tpdo4_enabled", "1803:1", false),
    integer_setting("tpdo4_type", "1803:2", 254, 0, 255),
    integer_setting("tpdo4_event_ms", "1803:5, ms", 0, 0, 65535),
    real_setting("rate_lsb_rad_per_s", "2103:1: LSB of the rate in 16 bits, rad/s", lsb_16[0], 1e-12, 1e3),
    real_setting("specific_force_lsb_m_per_s2", "2113:1: LSB of the specific force in 16 bits, m/s^2", lsb_16[1],
                 1e-12, 1e3),
    real_setting("delta_angle_lsb_rad", "2123:1: LSB of the delta-angle in 16 bits, rad", lsb_16[2], 1e-12, 1e3),
    real_setting("delta_velocity_lsb_m_per_s", "2133:1: LSB of the delta-velocity in 16 bits, m/s", lsb_16[3], 1e-12,
                 1e3),
};

std::size_t TpdoSettings::size() const noexcept {
  std::size_t size = 0;
  for (const std::size_t position : mapped) size += size_of(objects[position].type);
  return size;
}

unsigned node_id_of(const Settings& settings) {
  const auto node_id = static_cast<unsigned>(settings.integer("node_id"));
  if (node_id > last_node_id && node_id != unconfigured)
    throw std::invalid_argument("node_id: must be 1 to 127, or 255 for a device that waits for LSS");
  return node_id;
}

Identity identity_of(const Settings& settings) {
  const auto number = [&](std::string_view key) { return static_cast<std::uint32_t>(settings.integer(key)); };
  return {number("vendor_id"), number("product_code"), number("revision_number"), number("serial_number")};
}

std::array<TpdoSettings, tpdos> tpdos_of(const Settings& settings) {
  std::array<TpdoSettings, tpdos> all;
  for (std::size_t i = 0; i < tpdos; ++i) {
    const std::string type_key = tpdo_key(i, "_type");
    all[i] = {settings.flag(tpdo_key(i, "_enabled")), static_cast<unsigned>(settings.integer(type_key)),
              static_cast<unsigned>(settings.integer(tpdo_key(i, "_event_ms"))),
              mapped_objects(settings, tpdo_key(i))};
    all[i].is_enabled = all[i].is_enabled && !all[i].mapped.empty();
    if (all[i].type > 240 && all[i].type < 252)
      throw std::invalid_argument(type_key + ": must be 0 to 240, or 252 to 255");
  }
  return all;
}

float lsb_of(const Settings& settings, Quantity quantity) {
  constexpr std::array<std::string_view, 4> keys = {"rate_lsb_rad_per_s", "specific_force_lsb_m_per_s2",
                                                    "delta_angle_lsb_rad", "delta_velocity_lsb_m_per_s"};
  const auto q = static_cast<std::size_t>(quantity);
  return q < keys.size() ? static_cast<float>(settings.real(keys[q])) : lsb_16[q];
}

void deliver(const Settings& settings, ObjectDictionary& dictionary) {
  dictionary.set_delivered(at(0x1000), static_cast<std::uint64_t>(settings.integer("device_type")));
  const Identity identity = identity_of(settings);
  for (std::uint8_t k = 0; k < identity.size(); ++k)
    dictionary.set_delivered(find_object(0x1018, static_cast<std::uint8_t>(k + 1)), identity[k]);
  constexpr unsigned awaits_master = 4;
  dictionary.set_delivered(at(0x1F80), settings.flag("self_start") ? 0 : awaits_master);
  dictionary.set_delivered(at(0x1017), static_cast<std::uint64_t>(settings.integer("heartbeat_ms")));
  const std::array<TpdoSettings, tpdos> all = tpdos_of(settings);
  for (std::size_t i = 0; i < tpdos; ++i) {
    const auto communication = static_cast<std::uint16_t>(0x1800 + i),
               mapping = static_cast<std::uint16_t>(0x1A00 + i);
    const std::uint64_t id = first_tpdo_id + 0x100 * i;
    dictionary.set_delivered(find_object(communication, 1), id | (all[i].is_enabled ? 0U : bit_31));
    dictionary.set_delivered(find_object(communication, 2), all[i].type);
    dictionary.set_delivered(find_object(communication, 5), all[i].event_ms);
    dictionary.set_delivered(find_object(mapping, 0), all[i].mapped.size());
    for (std::size_t k = 0; k < all[i].mapped.size(); ++k)
      dictionary.set_delivered(find_object(mapping, static_cast<std::uint8_t>(k + 1)),
                               mapping_of(objects[all[i].mapped[k]]));
  }
  for (unsigned q = 0; q < quantities; ++q) {
    const auto lsbs = static_cast<std::uint16_t>(first_quantity + 0x10 * q + 3);
    dictionary.set_delivered(find_object(lsbs, 1),
                             std::bit_cast<std::uint32_t>(lsb_of(settings, static_cast<Quantity>(q))));
  }
}

// SYNC and remote requests are assumed to arrive at the sample rate at most. Answers to SDO requests count as load of
// the master that asks. The LSS answer is not listed: all slaves have the same identifier, and only one slave
// answers.
std::vector<CanMessage> can_messages(const Settings& settings, double rate_hz) {
  const unsigned node_id = node_id_of(settings);
  const std::array<TpdoSettings, tpdos> all = tpdos_of(settings);
  if (node_id == unconfigured) return {};
  constexpr double ms_per_s = 1000, emergencies_per_s = 10;
  const auto heartbeat_ms = static_cast<double>(settings.integer("heartbeat_ms"));
  std::vector<CanMessage> messages = {{{.id = emcy_id + node_id}, 8, emergencies_per_s}};
  for (std::size_t i = 0; i < tpdos; ++i) {
    double per_s = rate_hz;
    if (!all[i].is_enabled)
      per_s = 0;
    else if (all[i].type >= 254 && all[i].event_ms != 0)
      per_s = std::min(rate_hz, std::ceil(ms_per_s / all[i].event_ms));
    else if (all[i].type >= 1 && all[i].type <= 240)
      per_s = rate_hz / all[i].type;
    messages.push_back(
        {{.id = first_tpdo_id + 0x100U * static_cast<std::uint32_t>(i) + node_id}, all[i].size(), per_s});
  }
  messages.push_back({{.id = sdo_answer_id + node_id}, 8, 0});
  const double heartbeats = heartbeat_ms == 0 ? 0 : std::ceil(ms_per_s / heartbeat_ms);
  messages.push_back({{.id = heartbeat_id + node_id}, 1, heartbeats + 1});  // boot-up
  return messages;
}

// All messages pass, because a master can change most identifiers, and the node id by LSS.
std::vector<CanFilter> can_filters(const Settings&) { return {{.id = 0, .mask = 0, .remote = true}}; }

std::string bus_name(const Settings& settings) {
  if (node_id_of(settings) != unconfigured) return {};
  std::string text = "LSS address";
  for (const std::uint32_t number : identity_of(settings)) text.append(" ").append(std::to_string(number));
  return text + " (serial_number)";
}

std::string_view waits_for_host(const Settings& settings) {
  const bool starts = settings.flag("self_start");
  if (node_id_of(settings) == unconfigured)
    return starts ? "node_id = 10" : "node_id = 10 and device.self_start = true";
  return starts ? "" : "self_start = true";
}

}  // namespace imud::canopen
