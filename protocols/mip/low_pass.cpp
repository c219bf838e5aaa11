#include "protocols/mip/low_pass.hpp"

#include <algorithm>
#include <cmath>

#include "protocols/mip/mip.hpp"

namespace imud::mip {

double Configuration::cut_off_hz(const LowPass& low_pass) const noexcept {
  // A digital filter has no cut-off at half of its rate, or above it.
  constexpr double below = 0.5 * internal_hz;
  double frequency = 0;
  if (low_pass.is_enabled && low_pass.is_manual) frequency = low_pass.frequency_hz;
  if (low_pass.is_enabled && !low_pass.is_manual)
    if (const Stream* stream = find(sensor))
      for (std::size_t i = 0; i < stream->count; ++i)
        if (stream->format[i].descriptor == low_pass.descriptor)
          frequency = std::max(frequency, 0.5 * stream->base_hz / stream->format[i].decimation);
  return frequency < below ? frequency : 0;
}

Memory::Code Memory::low_pass(Reader& reader, Packet& answer, bool with_set) noexcept {
  const auto function = reader.take<std::uint8_t>();
  const std::uint8_t set = with_set ? reader.take<std::uint8_t>() : std::uint8_t{sensor};
  const auto descriptor = reader.take<std::uint8_t>();
  const auto has = [&](const LowPass& one) { return find_field(model_, sensor, one.descriptor) != nullptr; };
  const auto is_meant = [&](const LowPass& one) {
    return has(one) && (descriptor == 0 || one.descriptor == descriptor);
  };
  // All quantities: descriptor 0, of the sensor data or of every set.
  if (!(set == sensor || (set == 0 && descriptor == 0))) return bad_parameter;
  if (std::ranges::none_of(active_.low_passes, is_meant)) return bad_parameter;
  if (function == read) {
    if (descriptor == 0 || !reader.is_done()) return bad_parameter;
    const LowPass& one = *std::ranges::find_if(active_.low_passes, is_meant);
    const double frequency = one.is_manual ? one.frequency_hz : active_.cut_off_hz(one);
    answer.begin(with_set ? 0xD4 : 0x8B);
    if (with_set) answer.put(std::uint8_t{sensor});
    answer.put(descriptor);
    answer.put(std::uint8_t{one.is_enabled});
    answer.put(std::uint8_t{one.is_manual});
    if (with_set)
      answer.put_float(frequency);
    else
      answer.put(static_cast<std::uint16_t>(std::lround(frequency)));
    if (!with_set) answer.put(std::uint8_t{0});  // reserved
    answer.end();
    return ok;
  }
  if (function == write) {
    const auto enable = reader.take<std::uint8_t>(), manual = reader.take<std::uint8_t>();
    const double frequency =
        with_set ? static_cast<double>(reader.take<float>()) : static_cast<double>(reader.take<std::uint16_t>());
    if (!with_set) reader.take<std::uint8_t>();
    const bool is_frequency = std::isfinite(frequency) && frequency > 0;
    if (!reader.is_done() || enable > 1 || manual > 1 || (manual == 1 && !is_frequency)) return bad_parameter;
    for (LowPass& one : active_.low_passes) {
      if (!is_meant(one)) continue;
      one.is_enabled = enable == 1;
      one.is_manual = manual == 1;
      if (one.is_manual) one.frequency_hz = frequency;
    }
    return ok;
  }
  if (!reader.is_done()) return bad_parameter;
  return transfer(function, [&](Configuration& to, const Configuration& from) {
    for (std::size_t i = 0; i < to.low_passes.size(); ++i)
      if (is_meant(to.low_passes[i])) to.low_passes[i] = from.low_passes[i];
  });
}

}  // namespace imud::mip
