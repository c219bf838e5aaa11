#include "protocols/j1939/measured.hpp"

#include <cmath>

namespace imud::j1939 {
namespace {

// Returns three numbers, one after another from bit 0 on.
std::uint64_t numbers(const Scale& scale, const std::array<double, 3>& values, bool rounds) noexcept {
  std::uint64_t word = 0;
  for (unsigned i = 0; i < 3; ++i) word |= scale.raw(values[i], rounds) << i * scale.bits;
  return word;
}

Merit merit_of(const Scale& scale, double value, Merit merit) noexcept {
  return std::abs(value) > scale.max() && merit != merit_not_available ? merit_out_of_range : merit;
}

// Returns the figures of merit of three numbers, two bits each, from bit 0 on.
std::uint64_t merits_of(const Scale& scale, const std::array<double, 3>& values,
                        const std::array<Merit, 3>& merits) noexcept {
  std::uint64_t word = 0;
  for (unsigned i = 0; i < 3; ++i) word |= std::uint64_t{merit_of(scale, values[i], merits[i])} << 2 * i;
  return word;
}

}  // namespace

std::uint64_t encoded(Packet packet, const Reading& r) noexcept {
  constexpr unsigned merit_bit = 48, last_bit = 54, fine_merit_bit = 57;
  constexpr std::uint64_t repetition_rate = 2;  // the firmware's constant
  const std::uint64_t latency = std::uint64_t{r.latency} << 56;
  switch (packet) {
    case ssi2:
      return angle_scale.raw(r.pitch, r.rounds) | angle_scale.raw(r.roll, r.rounds) << 24 |
             std::uint64_t{merit_of(angle_scale, r.pitch, r.angle_merit)} << 50 |
             std::uint64_t{merit_of(angle_scale, r.roll, r.angle_merit)} << 54 | latency;
    case ari:
      return numbers(rate_scale, r.rate, r.rounds) | merits_of(rate_scale, r.rate, r.rate_merit) << merit_bit |
             std::uint64_t{r.mode} << last_bit | latency;
    case accs:
      return numbers(force_scale, r.force, r.rounds) | merits_of(force_scale, r.force, r.force_merit) << merit_bit |
             repetition_rate << last_bit | (r.has_force_latency ? latency : 0);
    case ari_fine:
      return numbers(fine_rate_scale, r.rate, r.rounds) | merits_of(fine_rate_scale, r.rate, r.rate_merit)
                                                              << fine_merit_bit;
    case accs_fine:
      return numbers(fine_force_scale, r.force, r.rounds) | merits_of(fine_force_scale, r.force, r.force_merit)
                                                                << fine_merit_bit;
    case ssi: {
      const std::array<double, 3> values = {r.pitch, r.roll, r.pitch_rate};
      // The firmware rounds these down.
      return numbers(coarse_angle_scale, values, false) |
             merits_of(coarse_angle_scale, values, {r.angle_merit, r.angle_merit, r.pitch_rate_merit}) << merit_bit |
             latency;
    }
    case magnetic:
      return numbers(magnetic_scale, r.magnetic_field, r.rounds);
    default:
      return position_scale.raw(r.latitude, r.rounds) | position_scale.raw(r.longitude, r.rounds) << 32;
  }
}

bool decode(const Scale& scale, std::uint64_t word, std::array<double, 3>& values) noexcept {
  bool is_valid = true;
  for (unsigned i = 0; i < 3; ++i) {
    const std::uint64_t raw = word >> i * scale.bits & ((std::uint64_t{1} << scale.bits) - 1);
    is_valid = is_valid && scale.is_valid(raw);
    values[i] = scale.value(raw);
  }
  return is_valid;
}

}  // namespace imud::j1939
