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
    {.key = "sample_rate",
     .help = "datagrams per second: 125, 250, 500, 1000 or 2000; 0: one at each external trigger",
     .initial = std::int64_t{1000},
     .min = 0,
     .max = 2000},
    {.key = "acceleration", .help = "the datagram has acceleration", .initial = true},
    {.key = "inclination", .help = "the datagram has inclination", .initial = true},
    {.key = "temperature", .help = "the datagram has temperature", .initial = true},
    {.key = "pps", .help = "the datagram has PPS, or AUX", .initial = false},
    {.key = "aux_input", .help = "an older unit, with an AUX input in place of PPS", .initial = false},
    {.key = "cr_lf", .help = "each datagram ends with CR LF", .initial = false},
    {.key = "gyro_unit",
     .help = "output unit of the gyros",
     .initial = std::string_view("rate"),
     .choices = std::span(gyro_units).first(4)},
    {.key = "accelerometer_unit",
     .help = "output unit of the accelerometers",
     .initial = std::string_view("acceleration"),
     .choices = force_units},
    {.key = "inclinometer_unit",
     .help = "output unit of the inclinometers",
     .initial = std::string_view("acceleration"),
     .choices = force_units},
    {.key = "accelerometer_range_g", .help = "g: 5, 10, 30 or 80", .initial = std::int64_t{10}, .min = 5, .max = 80},
    {.key = "bit_rate",
     .help = "bit/s: 374400, 460800, 921600 or 1843200",
     .initial = std::int64_t{921600},
     .min = 374400,
     .max = 1843200},
    {.key = "parity", .help = "parity of the UART", .initial = std::string_view("none"), .choices = parities},
    {.key = "stop_bits", .help = "stop bits of the UART", .initial = std::int64_t{1}, .min = 1, .max = 2},
    {.key = "start_up",
     .help = "start-up at each power-on: special datagrams, then data that are not valid until 0.7 s",
     .initial = true},
};

// Throws std::invalid_argument, whose message lists the valid values.
Configuration configuration(const Settings& settings);
// Throws std::invalid_argument if the line cannot carry the datagrams at their rate.
void check(const Settings& settings);
Product product(const Settings& settings);

}  // namespace imud::stim300
