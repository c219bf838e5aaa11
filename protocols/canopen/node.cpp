#include "protocols/canopen/node.hpp"

#include <cmath>

namespace imud::canopen {
namespace {

constexpr std::uint32_t save_signature = 0x65766173, load_signature = 0x64616F6C;  // "save", "load"

// The indexes of a group of parameters (1010, 1011): all, communication, application, manufacturer.
struct Range {
  std::uint16_t first, last;
};
constexpr std::array<Range, parameter_groups> groups = {
    {{0x1000, 0xFFFF}, {0x1000, 0x1FFF}, {0x6000, 0x9FFF}, {0x2000, 0x5FFF}}};
constexpr Range communication_group = groups[1], manufacturer_group = groups[3];

bool is_pdo_parameter(std::uint16_t index) noexcept { return index >= 0x1800 && index < 0x1B00; }
bool is_lsb(const Object& object) noexcept {
  return object.index >= first_quantity && object.index < first_quantity + 0x10 * quantities &&
         (object.index & 0xFU) == 3;
}
// Returns true for the preset of a slope (6012, 6022, 6112, 6122).
bool is_preset(const Object& object) noexcept { return object.index > slopes.front() && (object.index & 0xFU) == 2; }

}  // namespace

Node::Node(const ObjectDictionary& delivered, const Identity& identity, unsigned node_id) noexcept
    : dictionary(delivered),
      emergencies(dictionary, alarms),
      supervision(dictionary, alarms),
      pdos(dictionary),
      lss(identity, node_id) {}

void Node::load_all() noexcept {
  dictionary.load(groups[0].first, groups[0].last, lss.node_id());
  note_ = stored_note_;
  pdos.update();
}

void Node::load_communication() noexcept {
  dictionary.load(communication_group.first, communication_group.last, lss.node_id());
  pdos.update();
}

std::string_view Node::text(const Object& object) const noexcept {
  switch (object.index) {
    case 0x1008:
      return "imud CANopen inertial measurement unit";
    case 0x1009:
    case 0x100A:
      return "1.0";
    default:
      return {note_.text.data(), note_.size};
  }
}

std::uint64_t Node::number(std::size_t position) const noexcept {
  const Object& object = objects[position];
  if (object.source != Source::computed) return dictionary[position];
  switch (object.index) {
    case 0x1001:
      return emergencies.error_register();
    case 0x1003:
      return object.sub == 0 ? emergencies.history_size() : emergencies.history(object.sub - 1U);
    case 0x1010:
    case 0x1011:
      return 1;  // the device stores and loads on command
    case 0x2002:
      return object.sub == 1 ? lss.node_id() : lss.bit_rate();
    default:
      return measure(object, reading());
  }
}

Abort Node::read(std::uint16_t index, std::uint8_t sub, std::span<std::byte> value, std::size_t& size) noexcept {
  const std::size_t position = find_object(index, sub);
  if (position == object_count) return has_object(index) ? Abort::no_subindex : Abort::no_object;
  const Object& object = objects[position];
  if (object.access == Access::write_only) return Abort::write_only;
  if (object.index == 0x1003 && object.sub > emergencies.history_size()) return Abort::no_data;
  if (object.type != Type::text) {
    size = size_of(object.type);
    write_little(number(position), value.first(size));
    return Abort::none;
  }
  const std::span<const std::byte> bytes = std::as_bytes(std::span(text(object)));
  std::copy(bytes.begin(), bytes.end(), value.begin());
  size = bytes.size();
  return Abort::none;
}

Abort Node::check_write(std::uint16_t index, std::uint8_t sub, std::optional<std::size_t> size) const noexcept {
  const std::size_t position = find_object(index, sub);
  if (position == object_count) return has_object(index) ? Abort::no_subindex : Abort::no_object;
  const Object& object = objects[position];
  if (object.access == Access::constant || object.access == Access::read_only) return Abort::read_only;
  if (!size) return Abort::none;
  const std::size_t wanted = size_of(object.type);
  if (object.type == Type::text) return *size > longest_text ? Abort::too_long : Abort::none;
  return *size > wanted ? Abort::too_long : *size < wanted ? Abort::too_short : Abort::none;
}

Abort Node::write(std::uint16_t index, std::uint8_t sub, std::span<const std::byte> value, DeviceTime now) noexcept {
  const std::size_t position = find_object(index, sub);
  const Object& object = objects[position];
  if (object.type == Type::text) {
    note_.size = value.size();
    for (std::size_t i = 0; i < value.size(); ++i) note_.text[i] = std::to_integer<char>(value[i]);
    return Abort::none;
  }
  const std::uint64_t number = read_little(value);
  if (const Abort refused = check_value(position, number); refused != Abort::none) return refused;
  if (object.source == Source::parameter) dictionary.set(position, number);
  take_effect(position, number, now);
  return Abort::none;
}

Abort Node::check_value(std::size_t position, std::uint64_t value) const noexcept {
  const Object& object = objects[position];
  if (object.index != 0x1003 && value > object.largest) return Abort::value_too_high;
  if (is_pdo_parameter(object.index)) return pdos.check(object, value);
  if (is_lsb(object)) {
    const float lsb = std::bit_cast<float>(static_cast<std::uint32_t>(value));
    return std::isfinite(lsb) && lsb > 0 ? Abort::none : Abort::value;
  }
  const auto allow = [](bool is_allowed) { return is_allowed ? Abort::none : Abort::value; };
  switch (object.index) {
    case 0x1003:
      return allow(value == 0);
    case 0x1005:
    case 0x1012:
    case 0x1014:
      return check_cob_id(position, value);
    case 0x1010:
      return value == save_signature ? Abort::none : Abort::not_stored;
    case 0x1011:
      return value == load_signature ? Abort::none : Abort::not_stored;
    case 0x1016:
      return supervision.check_consumer(object.sub, value);
    case 0x1019:
      if (dictionary[at(0x1006)] != 0) return Abort::state;
      return allow(value != 1);
    case 0x1F80:
      return allow((value & ~std::uint64_t{4}) == 0);
    case 0x2001:
      return allow(value == 1);
    case 0x6000:
      return allow(value == 1 || value == 10 || value == 100 || value == 1000);
    default:
      return Abort::none;
  }
}

// The device only receives SYNC and TIME. No identifier may have 29 bits. The identifier of EMCY cannot change while
// it is valid.
Abort Node::check_cob_id(std::size_t position, std::uint64_t value) const noexcept {
  const bool is_emergency = position == at(0x1014);
  const std::uint64_t kept = can_id_bits | (position == at(0x1005) ? 0U : bit_31);
  const auto id = static_cast<std::uint32_t>(value & can_id_bits);
  if ((value & ~kept) != 0 || is_restricted(id)) return Abort::value;
  const std::uint32_t present = dictionary.u32(position);
  const bool stays_valid = ((present | value) & bit_31) == 0;
  return is_emergency && stays_valid && id != (present & can_id_bits) ? Abort::value : Abort::none;
}

void Node::take_effect(std::size_t position, std::uint64_t value, DeviceTime now) noexcept {
  const Object& object = objects[position];
  if (is_pdo_parameter(object.index)) pdos.update();
  supervision.update(position, now);
  if (is_preset(object)) {
    const auto slope = static_cast<std::uint16_t>(object.index - 2);
    dictionary.set(find_object(static_cast<std::uint16_t>(slope + 3), 0), offset_of_preset(slope, value, reading()));
  }
  switch (object.index) {
    case 0x1003:
      return emergencies.clear_history();
    case 0x1006:
      return emergencies.set(Error::sync_lost, false);
    case 0x1017:
      if (value == 0) return;
      [[fallthrough]];
    case 0x100C:
    case 0x100D:
      return emergencies.set(Error::life_guarding, false);
    case 0x1016:
      if (!supervision.is_any_lost()) emergencies.set(Error::heartbeat, false);
      return;
    case 0x1010: {
      const Range& group = groups[object.sub - 1U];
      dictionary.store(group.first, group.last);
      if (group.last >= manufacturer_group.last && group.first <= manufacturer_group.first) stored_note_ = note_;
      return;
    }
    case 0x1011: {
      const Range& group = groups[object.sub - 1U];
      dictionary.forget(group.first, group.last);
      if (group.last >= manufacturer_group.last && group.first <= manufacturer_group.first) stored_note_ = {};
      return;
    }
    case 0x2001:
      return pdos.restart_increments();
    default:
      return;
  }
}

}  // namespace imud::canopen
