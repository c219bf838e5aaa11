#include <isa-l/crc.h>

#include <array>

#include "core/units.hpp"
#include "protocols/stim300/datagram.hpp"

namespace imud::stim300 {

// ISA-L uses the processor's instructions for polynomial multiplication; a table lookup (Boost.CRC) takes more than
// twice as many instructions for a datagram. The CRC of ISA-L has the polynomial 0x04C11DB7, and complements the
// initial and the final value.
std::uint32_t crc_of(std::span<const std::byte> bytes) noexcept {
  constexpr std::array<unsigned char, 3> zeros{};
  const std::uint32_t crc = crc32_ieee(0, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  return ~crc32_ieee(crc, zeros.data(), (4 - bytes.size() % 4) % 4);
}

// Table 5-20.
std::size_t write_measurement(const std::array<Axes, 3>& axes, const Reading& reading, Memory& memory,
                              FrameBuffer& out) noexcept {
  const Configuration& c = memory.active;
  Datagram datagram(out);
  datagram.put(identifier(c.content, c.has_aux), 1);
  for (const Cluster cluster : clusters) {
    if (!c.has(cluster)) continue;
    const Axes& of = axes[cluster];
    const unsigned unit = c.units[cluster] % delayed;
    const bool in_m = cluster != gyro && (unit == increment || unit == integrated_m_per_s);
    const double scale = (in_m ? units::standard_gravity : 1.0) / lsb(c, cluster, unit);
    const bool wraps = unit == integrated || unit == integrated_m_per_s;
    Vector3 numbers = unit == value ? of.now : wraps ? of.integral.vector() : of.sum.vector();
    if (unit == average)
      numbers = internal_hz * numbers / static_cast<double>(std::max<std::uint64_t>(of.samples, 1));
    numbers *= scale;
    unsigned status = of.status;
    for (unsigned i = 0; i < 3; ++i) {
      if (wraps) {
        datagram.put(static_cast<std::uint64_t>(to_integer(std::remainder(numbers[i], 0x1p24))), 3);
        continue;
      }
      if (unit == increment && std::abs(numbers[i]) >= 0x1p23)
        status |= memory.overload(cluster, i);  // Table 5-2, note 9
      datagram.put_number(numbers[i], 3);
    }
    datagram.put(status, 1);
  }
  for (const Cluster cluster : clusters) {
    if (!c.has_temperature() || !c.has(cluster)) continue;
    for (int i = 0; i < 3; ++i) datagram.put_number(reading.temperature_c * 256, 2);
    datagram.put(reading.status, 1);
  }
  if (c.has_pps()) {
    if (reading.pps == longest_pps) memory.set_error(112);
    datagram.put(reading.pps << 8 | reading.pps_status, 4);
  }
  datagram.put(reading.counter, 1);
  datagram.put(reading.latency_us, 2);
  return datagram.finish(c.cr_lf);
}

}  // namespace imud::stim300
