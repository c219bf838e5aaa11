#include "protocols/j1939/configuration.hpp"

#include <algorithm>

#include "core/units.hpp"

namespace imud::j1939 {
namespace {

// Extensions that are not emulated: DM1's lamps, sources of odometry and the second bank of the OpenIMU335RI; the
// magnetic alignment of the OpenIMU300RI.
constexpr std::uint8_t unsupported_335[] = {0x5A, 0x5F, 0x60, 0xF2};
constexpr std::uint8_t unsupported_300[] = {0x5E};

constexpr std::array<std::uint8_t, 8> cutoffs_hz = {0, 2, 5, 10, 20, 25, 40, 50};

std::uint16_t pair_at(const Message& message, std::size_t i) noexcept {
  return static_cast<std::uint16_t>(message[i] | message[i + 1] << 8);
}

bool set_packet_types(Configuration& c, const Model& model, const Message& message) noexcept {
  const unsigned types = message[1] | (message.data.size() > 2 ? unsigned{message[2]} << 8 : 0U);
  unsigned possible = 0;
  for (unsigned bit = 0; bit < model.packet_bits.size(); ++bit)
    possible |= (model.packet_bits[bit] != packets ? 1U : 0U) << bit;
  if ((types & ~possible) != 0) return false;
  c.packet_types = types;
  if (message.data.size() < 5) return true;
  // Priorities of two bits each, and a mask of the priorities to change.
  unsigned* const priorities[] = {&c.rate_priority, &c.force_priority, &c.angle_priority};
  for (unsigned i = 0; i < 3; ++i)
    if ((message[4] >> 2 * i & 3U) == 3) *priorities[i] = message[3] >> 2 * i & 3U;
  return true;
}

}  // namespace

// Noise densities were taken from memory of the data sheets: 0.3 deg/sqrt(h) and 0.06 m/s/sqrt(h).
constinit const std::array<Model, 2> models = {{
    {.keyword = "openimu335ri",
     .name = "OpenIMU335RI",
     .packet_bits = {ssi2, ari, accs, ari_fine, accs_fine, ssi},
     .bank_0 = {reset_algorithm, save, hardware_status, software_status, master_status, fine_rate, fine_acceleration},
     .bank_1 = {packet_rate, packet_type, filter, orientation, user_behavior, algorithm, functions},
     .unsupported = unsupported_335,
     .last_extension = 0x6C,
     .rounds = true,
     .has_merits = true,
     .pads = true,
     .claim_period = {},
     .gyro_max = 400 * units::degree,
     .gyro_noise = 0.005 * units::degree,
     .accelerometer_max = 8 * units::standard_gravity,
     .accelerometer_noise = 0.001},
    {.keyword = "openimu300ri",
     .name = "OpenIMU300RI",
     .packet_bits = {ssi2, ari, accs, magnetic, position, packets},
     .bank_0 = {reset_algorithm, save, master_status, functions, functions, functions, functions},
     .bank_1 = {packet_rate, packet_type, filter, orientation, user_behavior, functions, functions},
     .unsupported = unsupported_300,
     .last_extension = 0x7F,
     .rounds = false,
     .has_merits = false,
     .pads = false,
     .claim_period = std::chrono::seconds(1),
     .gyro_max = 300 * units::degree,
     .gyro_noise = 0.005 * units::degree,
     .accelerometer_max = 8 * units::standard_gravity,
     .accelerometer_noise = 0.001},
}};

Function Configuration::function_of(unsigned extension) const noexcept {
  const auto found = std::ranges::find(extensions, extension);
  return static_cast<Function>(found - extensions.begin());
}

Header Configuration::header_of(Packet packet) const noexcept {
  switch (packet) {
    case ssi2:
      return {angle_priority, pgn::slope_2};
    case ari:
      return {rate_priority, pgn::angular_rate};
    case accs:
      return {force_priority, pgn::acceleration};
    case ari_fine:
      return {rate_priority, pgn::proprietary_b + extensions[fine_rate]};
    case accs_fine:
      return {force_priority, pgn::proprietary_b + extensions[fine_acceleration]};
    case ssi:
      return {angle_priority, pgn::slope};
    case magnetic:
      return {control_priority, pgn::proprietary_b + 0x6A};
    default:
      return {control_priority, pgn::vehicle_position};
  }
}

std::optional<Matrix3> dcm_of_orientation(unsigned word) noexcept {
  if (word >= 1U << 9) return std::nullopt;
  Matrix3 dcm = Matrix3::Zero();
  for (unsigned axis = 0; axis < 3; ++axis) {
    const unsigned field = word >> 3 * axis & 7U;
    if (field >> 1 == 3) return std::nullopt;
    dcm(axis, (axis + (field >> 1)) % 3) = (field & 1U) != 0 ? -1.0 : 1.0;
  }
  return dcm.determinant() > 0.5 ? std::optional(dcm) : std::nullopt;
}

bool set(Configuration& c, const Model& model, Function function, const Message& message) noexcept {
  switch (function) {
    case packet_rate:
      if (std::ranges::find(dividers, message[1]) == dividers.end()) return false;
      c.divider = message[1];
      return true;
    case packet_type:
      return set_packet_types(c, model, message);
    case filter:
      if (std::ranges::find(cutoffs_hz, message[1]) == cutoffs_hz.end() ||
          std::ranges::find(cutoffs_hz, message[2]) == cutoffs_hz.end())
        return false;
      c.rate_filter_hz = message[1];
      c.force_filter_hz = message[2];
      return true;
    case orientation: {
      const unsigned word = unsigned{message[1]} << 8 | message[2];
      if (!dcm_of_orientation(word)) return false;
      c.orientation = word;
      return true;
    }
    case user_behavior:
      if (message.data.size() < 5) return false;
      c.behavior = (c.behavior | pair_at(message, 1)) & ~unsigned{pair_at(message, 3)};
      if (message[5] >= 128 && message[5] <= 247) c.address = message[5];
      return true;
    case algorithm:
      if (message.data.size() < 8) return false;
      for (std::size_t i = 0; i < c.algorithm.size(); ++i) c.algorithm[i] = pair_at(message, 2 + 2 * i);
      return true;
    default:
      return false;
  }
}

void set_bank(Configuration& c, const Model& model, unsigned bank, const Message& message) noexcept {
  const auto& changed = bank == bank_0 ? model.bank_0 : model.bank_1;
  for (std::size_t i = 0; i < changed.size(); ++i) {
    const std::uint8_t extension = message[i + 1];
    if (changed[i] != functions && extension >= 0x40 && extension <= model.last_extension)
      c.extensions[changed[i]] = extension;
  }
}

std::optional<Report> report(const Configuration& c, Function function, std::uint8_t host) noexcept {
  const auto with_host = [host](std::uint64_t rest, std::size_t size) { return Report{rest << 8 | host, size}; };
  switch (function) {
    // All bits are 0: there is no fault. The master status has also a checksum of the application, which is 0 here.
    case hardware_status:
      return Report{0, 2};
    case software_status:
    case master_status:
      return Report{0, 4};
    case packet_rate:
      return with_host(c.divider, 2);
    case packet_type:
      return with_host(c.packet_types | (c.rate_priority & 3U) << 16 | (c.force_priority & 3U) << 18 |
                           (c.angle_priority & 3U) << 20,
                       4);
    case filter:
      return with_host(c.rate_filter_hz | unsigned{c.force_filter_hz} << 8, 3);
    case orientation:
      return with_host(c.orientation >> 8 | (c.orientation & 0xFFU) << 8, 3);
    case user_behavior:
      return with_host(c.behavior & 0xFFFFU, 3);
    case algorithm: {
      std::uint64_t word = 0xFF;
      for (std::size_t i = 0; i < c.algorithm.size(); ++i) word |= std::uint64_t{c.algorithm[i]} << (8 + 16 * i);
      return with_host(word, 8);
    }
    default:
      return std::nullopt;
  }
}

}  // namespace imud::j1939
