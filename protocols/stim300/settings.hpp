// The options of the STIM300 in imud's configuration, and the product as delivered.
#pragma once

#include <array>
#include <span>
#include <string_view>

#include "protocols/protocol.hpp"
#include "protocols/stim300/stim300.hpp"

namespace imud::stim300 {

inline constexpr std::array<std::string_view, 5> gyro_units = {"rate", "increment", "average", "integrated"};
inline constexpr std::array<std::string_view, 5> force_units = {"acceleration", "increment", "average",
                                                                "integrated_g_s", "integrated_m_per_s"};
inline constexpr std::array<std::string_view, 3> parities = {"none", "even", "odd"};
inline constexpr Setting declared_settings[] = {
    integer_setting("sample_rate",
                    "datagrams per second: 125, 250, 500, 1000 or 2000; 0: one at each external trigger", 1000, 0,
                    2000),
    flag_setting("acceleration", "the datagram has acceleration", true),
    flag_setting("inclination", "the datagram has inclination", true),
    flag_setting("temperature", "the datagram has temperature", true),
    flag_setting("pps", "the datagram has PPS, or AUX", false),
    flag_setting("aux_input", "an older unit, with an AUX input in place of PPS", false),
    flag_setting("cr_lf", "each datagram ends with CR LF", false),
    text_setting("gyro_unit", "output unit of the gyros", "rate", std::span(gyro_units).first(4)),
    text_setting("accelerometer_unit", "output unit of the accelerometers", "acceleration", force_units),
    text_setting("inclinometer_unit", "output unit of the inclinometers", "acceleration", force_units),
    integer_setting("accelerometer_range_g", "g: 5, 10, 30 or 80", 10, 5, 80),
    integer_setting("bit_rate", "bit/s: 374400, 460800, 921600 or 1843200", 921600, 374400, 1843200),
    text_setting("parity", "parity of the UART", "none", parities),
    integer_setting("stop_bits", "stop bits of the UART", 1, 1, 2),
    flag_setting("start_up", "start-up at each power-on: special datagrams, then data that are not valid until 0.7 s",
                 true),
};

// Throws std::invalid_argument, whose message lists the valid values.
Configuration configuration(const Settings& settings);
// Throws std::invalid_argument if the line cannot carry the datagrams at their rate.
void check(const Settings& settings);
Product product(const Settings& settings);

}  // namespace imud::stim300
