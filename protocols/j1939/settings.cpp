#include <algorithm>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "core/units.hpp"
#include "protocols/j1939/j1939.hpp"
#include "protocols/j1939/transport.hpp"

namespace imud::j1939 {
namespace {

constexpr std::string_view model_choices[] = {"openimu335ri", "openimu300ri"};
constexpr std::string_view initial_packets[] = {"ssi2", "ari", "accs"};
constexpr std::string_view slot_orders[] = {"xyz", "j1939"};
constexpr std::string_view axis_signs[] = {"ned", "enu"};
constexpr std::string_view byte_orders[] = {"j1939", "swapped", "auto"};
constexpr std::string_view identifications[] = {"aceinna", "j1939"};
constexpr std::array<std::string_view, packets> packet_names = {"ssi2",    "ari", "accs", "ari_hr",
                                                                "accs_hr", "ssi", "mag",  "position"};

unsigned natural(const Settings& settings, std::string_view key) {
  return static_cast<unsigned>(settings.integer(key));
}

const Model& model_of(const Settings& settings) {
  return *std::ranges::find(models, std::string_view(settings.text("model")), &Model::keyword);
}

unsigned packet_types_of(const Settings& settings) {
  const Model& model = model_of(settings);
  unsigned types = 0;
  for (const std::string& name : settings.list("packet_types")) {
    const auto packet = static_cast<unsigned>(std::ranges::find(packet_names, name) - packet_names.begin());
    const auto bit = static_cast<unsigned>(std::ranges::find(model.packet_bits, packet) - model.packet_bits.begin());
    if (packet == packets || bit == model.packet_bits.size()) {
      std::string possible;
      for (const Packet one : model.packet_bits)
        if (one != packets) possible.append(possible.empty() ? "" : ", ").append(packet_names[one]);
      throw std::invalid_argument("packet_types: the " + std::string(model.name) + " has " + possible +
                                  ", and no \"" + name + "\"");
    }
    types |= 1U << bit;
  }
  return types;
}

}  // namespace

constinit const Setting declared_settings[25] = {
    text_setting("model", "product", "openimu335ri", model_choices),
    integer_setting("source_address", "address that the unit claims at power on", 0x80, 0, 253),
    integer_setting("name_identity",
                    "NAME: identity number, which each unit on a bus has for itself; the lowest NAME wins an address",
                    1, 0, 0x1FFFFF),
    integer_setting("name_manufacturer", "NAME: manufacturer code", 823, 0, 2047),
    integer_setting("name_ecu_instance", "NAME: ECU instance", 0, 0, 7),
    integer_setting("name_function_instance", "NAME: function instance", 0, 0, 31),
    integer_setting("name_function", "NAME: function", 131, 0, 255),
    integer_setting("name_vehicle_system", "NAME: vehicle system", 0, 0, 127),
    integer_setting("name_vehicle_system_instance", "NAME: vehicle system instance", 0, 0, 15),
    integer_setting("name_industry_group", "NAME: industry group", 0, 0, 7),
    flag_setting("name_arbitrary_address",
                 "the unit moves to a free address from 128 to 247 when it loses its own; false: it falls silent",
                 true),
    integer_setting("claim_wait_ms",
                    "time after an address claim in which the unit sends nothing else; J1939 requires 250", 250, 0,
                    1000),
    integer_setting("claim_period_ms",
                    "time between repeated address claims; 0: claims are not repeated; -1: as the model's firmware, "
                    "1000 of an OpenIMU300RI, 0 of an OpenIMU335RI",
                    -1, -1, 60'000),
    integer_setting("packet_rate", "divider of 100 Hz: 1, 2, 4, 5, 10, 20, 25 or 50; 0: no output", 1, 0, 50),
    list_setting("packet_types",
                 "messages: ssi2, ari, accs; OpenIMU335RI: ari_hr, accs_hr, ssi; OpenIMU300RI: mag, position",
                 initial_packets),
    integer_setting("angle_priority", "priority of ssi2 and ssi", 3, 0, 7),
    integer_setting("rate_priority", "priority of ari and ari_hr", 3, 0, 7),
    integer_setting("acceleration_priority", "priority of accs and accs_hr", 2, 0, 7),
    text_setting(
        "slot_order",
        "xyz: the axes x, y, z in this order, as the firmware is delivered; j1939: pitch, roll, yaw rate and "
        "lateral, longitudinal, vertical acceleration, which is y, x, z",
        "xyz", slot_orders),
    text_setting("axis_signs", "ned: x forward, y right, z down; enu: x forward, y left, z up, which negates y and z",
                 "ned", axis_signs),
    text_setting(
        "request_byte_order",
        "of the number in a request: j1939: low byte first; swapped: 00, high, low, as some of ACEINNA's tools "
        "send it; auto: either",
        "auto", byte_orders),
    text_setting(
        "identification",
        "answers to requests for ECU (64965) and software (65242): aceinna: 8 bytes, as the firmware; j1939: "
        "texts by the transport protocol",
        "aceinna", identifications),
    flag_setting("acknowledge_settings",
                 "settings made over the bus are acknowledged; false: only refused ones are, by NACK", true),
    real_setting("latency_ms", "measurement latency that messages report, without delay", 0.0, 0, 125),
    integer_setting("orientation", "orientation word, such as 0x0048 (x, -y, -z)", 0, 0, 511),
};

Unit unit_of(const Settings& settings) {
  Unit unit;
  unit.model = &model_of(settings);
  unit.name = {.identity = natural(settings, "name_identity"),
               .manufacturer = natural(settings, "name_manufacturer"),
               .ecu_instance = natural(settings, "name_ecu_instance"),
               .function_instance = natural(settings, "name_function_instance"),
               .function = natural(settings, "name_function"),
               .vehicle_system = natural(settings, "name_vehicle_system"),
               .vehicle_system_instance = natural(settings, "name_vehicle_system_instance"),
               .industry_group = natural(settings, "name_industry_group"),
               .arbitrary_address = settings.flag("name_arbitrary_address")};
  unit.claim_wait = std::chrono::milliseconds(settings.integer("claim_wait_ms"));
  const std::int64_t claim_period_ms = settings.integer("claim_period_ms");
  unit.claim_period =
      claim_period_ms < 0 ? unit.model->claim_period : Nanoseconds(std::chrono::milliseconds(claim_period_ms));
  const std::string& order = settings.text("request_byte_order");
  unit.request_order = static_cast<ByteOrder>(std::ranges::find(byte_orders, order) - std::begin(byte_orders));
  unit.has_texts = settings.text("identification") == "j1939";
  unit.acknowledges = settings.flag("acknowledge_settings");
  unit.latency = static_cast<std::uint8_t>(2.0 * settings.real("latency_ms") + 0.5);
  const std::string identity = std::to_string(unit.name.identity);
  // Part number, serial number, location, type, manufacturer; number of texts, version.
  unit.ecu_text = std::string(unit.model->name) + '*' + identity + "**IMU*ACEINNA*";
  unit.software_text = std::string("\1") + std::string(unit.model->name) + " 1.0.5*";
  return unit;
}

Configuration configuration_of(const Settings& settings) {
  Configuration c;
  c.address = static_cast<std::uint8_t>(settings.integer("source_address"));
  c.divider = natural(settings, "packet_rate");
  if (std::ranges::find(dividers, c.divider) == dividers.end())
    throw std::invalid_argument("packet_rate: give 0, 1, 2, 4, 5, 10, 20, 25 or 50");
  c.packet_types = packet_types_of(settings);
  c.angle_priority = natural(settings, "angle_priority");
  c.rate_priority = natural(settings, "rate_priority");
  c.force_priority = natural(settings, "acceleration_priority");
  c.orientation = natural(settings, "orientation");
  if (!dcm_of_orientation(c.orientation))
    throw std::invalid_argument("orientation: give the word of a right-handed triad, such as 0 or 0x0048");
  if (settings.text("slot_order") == "j1939") c.behavior |= swap_slots;
  if (settings.text("axis_signs") == "enu") c.behavior |= z_up;
  return c;
}

Product product_of(const Settings& settings) {
  configuration_of(settings);
  const Model& model = model_of(settings);
  Product product;
  product.rate_hz = internal_hz;
  product.gyro = TriadErrors::white(model.gyro_noise, internal_hz, model.gyro_max);
  product.accelerometer = TriadErrors::white(model.accelerometer_noise, internal_hz, model.accelerometer_max);
  product.magnetometer = TriadErrors::white(0, internal_hz, 8 * units::gauss);
  return product;
}

std::vector<CanMessage> can_messages(const Settings& settings, double rate_hz) {
  const Configuration c = configuration_of(settings);
  const Unit unit = unit_of(settings);
  std::vector<CanMessage> messages;
  const auto add = [&](Header header, double frames_per_s) {
    header.source = c.address;
    messages.push_back({header.can(), 8, frames_per_s});
  };
  for (unsigned bit = 0; bit < unit.model->packet_bits.size(); ++bit) {
    const Packet packet = unit.model->packet_bits[bit];
    const bool is_sent = c.divider != 0 && (c.packet_types >> bit & 1U) != 0;
    if (packet != packets) add(c.header_of(packet), is_sent ? rate_hz / c.divider : 0.0);
  }
  const double period_s = seconds(unit.claim_period);
  add({.pgn = pgn::address_claimed}, period_s > 0 ? std::max(1.0, std::ceil(1.0 / period_s)) : 1.0);
  add({.pgn = pgn::acknowledgement}, 0);
  add({.pgn = pgn::ecu_identification}, 0);
  add({.pgn = pgn::software_identification}, 0);
  add({transfer_priority, pgn::transfer_control}, 0);
  add({transfer_priority, pgn::transfer_data}, 0);
  for (unsigned function = 0; function < fine_rate; ++function)
    add({.pgn = pgn::proprietary_b + c.extensions[function]}, 0);
  return messages;
}

std::vector<CanFilter> can_filters(const Settings& settings) {
  const Unit unit = unit_of(settings);
  // The filter ignores the priority and the source. Messages with a destination pass for all destinations.
  const auto of_number = [](std::uint32_t number, std::uint32_t mask) {
    return CanFilter{.id = number << 8, .mask = mask << 8, .extended = true};
  };
  const auto of_source = [](std::uint32_t source, std::uint32_t mask) {
    return CanFilter{.id = source, .mask = mask, .extended = true};
  };
  std::vector<CanFilter> filters;
  for (const std::uint32_t number : {pgn::request, pgn::transfer_control, pgn::transfer_data, pgn::address_claimed,
                                     pgn::stop_start, pgn::memory_request})
    filters.push_back(of_number(number, 0x3FF00));
  // Settings: extensions 0x40 to 0x7F, and the banks.
  filters.push_back(of_number(pgn::proprietary_b | 0x40, 0x3FFC0));
  filters.push_back(of_number(pgn::proprietary_b | 0xF0, 0x3FFFC));
  // Frames of other nodes with the unit's address: from the settings, or any of the pool.
  filters.push_back(of_source(static_cast<std::uint32_t>(settings.integer("source_address")), 0xFF));
  if (unit.name.arbitrary_address) filters.push_back(of_source(pool_begin, pool_begin));
  return filters;
}

std::string bus_name(const Settings& settings) {
  char text[64];
  std::snprintf(text, sizeof text, "NAME 0x%016" PRIX64 " (name_identity)", unit_of(settings).name.word());
  return text;
}

}  // namespace imud::j1939
