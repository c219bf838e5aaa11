#include "protocols/stim300/datagram.hpp"

namespace imud::stim300 {
namespace {

unsigned g_compensation_code(const Configuration& c) noexcept {
  constexpr unsigned by_user = 15;
  for (unsigned code = 0; code < standard_g_compensations.size(); ++code) {
    const GCompensation& standard = standard_g_compensations[code];
    const bool filters = standard.bias_filter || standard.scale_filter;
    if (c.g_compensation == std::array{standard, standard, standard} && (!filters || c.g_filter_hz == 0.01))
      return code;
  }
  return by_user;
}

}  // namespace

// Tables 5-13 to 5-18.
std::size_t write_special(Special special, Memory& memory, FrameBuffer& out) noexcept {
  const Configuration& c = memory.active;
  Datagram datagram(out);
  switch (special) {
    case of_part: {
      datagram.put(c.cr_lf ? 0xB3 : 0xB1, 1);
      // "ddddd-ddddddd-ddd"; the last four digits are split.
      const std::string_view part_number = range_of(c).part_number;
      const auto digit = [&](std::size_t at) { return static_cast<unsigned>(part_number[at] - '0'); };
      datagram.put_halves(0, digit(0));
      datagram.put_halves(digit(1), digit(2));
      datagram.put_halves(digit(3), digit(4));
      datagram.put('-', 1);
      for (const std::size_t at : {6U, 8U, 10U}) datagram.put_halves(digit(at), digit(at + 1));
      datagram.put('-', 1);
      datagram.put_halves(digit(14), digit(15));
      datagram.put_halves(digit(16), 0);
      datagram.put_halves(0, digit(12));
      datagram.put(0, 3);
      datagram.put(static_cast<unsigned char>(part_revision), 1);
      break;
    }
    case of_serial:
      datagram.put(c.cr_lf ? 0xB7 : 0xB5, 1);
      datagram.put(static_cast<unsigned char>(serial_number[0]), 1);
      for (std::size_t at = 1; at < serial_number.size(); at += 2)
        datagram.put_halves(static_cast<unsigned>(serial_number[at] - '0'),
                            static_cast<unsigned>(serial_number[at + 1] - '0'));
      datagram.put(0, 7);
      break;
    case of_configuration:
      datagram.put(c.cr_lf ? 0xBD : 0xBC, 1);
      datagram.put(static_cast<unsigned char>(part_revision), 1);
      datagram.put(firmware_revision, 1);
      datagram.put(c.sample_rate << 5 | (c.has_pps() ? 16U : 0U) | (c.content & 4U) << 1 | (c.content & 3U) << 1 |
                       (c.cr_lf ? 1U : 0U),
                   1);
      datagram.put(c.bit_rate << 4 | (c.stop_bits - 1) << 3 | static_cast<unsigned>(c.parity) << 1 |
                       (c.line_termination ? 1U : 0U),
                   1);
      for (const Cluster cluster : clusters) {
        datagram.put(0x70U | c.units[cluster], 1);
        datagram.put_halves(c.filters[cluster][0], c.filters[cluster][1]);
        datagram.put_halves(c.filters[cluster][2], cluster == gyro           ? g_compensation_code(c)
                                                   : cluster == inclinometer ? c.pps_unit
                                                                             : 0);
      }
      datagram.put((c.has_aux ? 0U : 8U) | c.pps_filter, 1);
      datagram.put(0, 2);  // 400 deg/s
      datagram.put_halves(c.accelerometer_range, c.accelerometer_range);
      datagram.put_halves(c.accelerometer_range, 0);
      datagram.put(0, 2);  // 1.7 g
      datagram.put((c.tov_3v3 ? 8U : 0U) | (c.tov_toggles ? 4U : 0U) | (c.bias_trim_at_start ? 2U : 0U), 1);
      break;
    case of_trim:
      datagram.put(c.cr_lf ? 0xD2 : 0xD1, 1);
      for (const Cluster cluster : clusters)
        for (int i = 0; i < 3; ++i) datagram.put_number(memory.trim[cluster][i] / lsb(c, cluster, value), 3);
      datagram.put(memory.trim_reference, 4);
      datagram.put(memory.saves_left, 2);
      datagram.put(0, 2);
      break;
    default:
      datagram.put(c.cr_lf ? 0xBF : 0xBE, 1);
      for (const std::uint8_t byte : memory.errors) datagram.put(byte, 1);
      memory.errors = {};
      break;
  }
  return datagram.finish(c.cr_lf);
}

}  // namespace imud::stim300
