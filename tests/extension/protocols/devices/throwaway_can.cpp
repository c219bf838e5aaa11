// A product whose messages are a table, of no vendor: the whole product is this file.
#include "protocols/signals/signal_product.hpp"

namespace imud {

namespace {

constexpr double rate_lsb = 0.001, force_lsb = 0.005;  // rad/s, m/s^2

constexpr CanSignal rates[] = {{"X", 7, 16, motorola_signed, rate_lsb, 0, "rate_x_rad_per_s"},
                               {"Y", 23, 16, motorola_signed, rate_lsb, 0, "rate_y_rad_per_s"},
                               {"Z", 39, 16, motorola_signed, rate_lsb, 0, "rate_z_rad_per_s"},
                               {"Counter", 48, 8, intel_unsigned, 1, 0, "sample_counter"}};
constexpr CanSignal forces[] = {{"X", 7, 16, motorola_signed, force_lsb, 0, "specific_force_x_m_per_s2"},
                                {"Y", 23, 16, motorola_signed, force_lsb, 0, "specific_force_y_m_per_s2"},
                                {"Z", 39, 16, motorola_signed, force_lsb, 0, "specific_force_z_m_per_s2"},
                                {"Counter", 48, 8, intel_unsigned, 1, 0, "sample_counter"}};
constexpr SignalProductMessage messages[] = {{"rates", 0x300, 7, rates}, {"forces", 0x301, 7, forces}};
constexpr SignalProduct throwaway_can_table = {
    .messages = messages, .gyro_max = 30, .accelerometer_max = 150};  // without noise
constexpr Setting settings[] = {output_rate_setting(100, 500), identifiers_setting(), id_offset_setting(),
                                extended_setting()};

}  // namespace

extern constexpr Protocol throwaway_can_protocol = signal_protocol<throwaway_can_table>({
    .name = "throwaway-can",
    .summary = "a product whose messages are a table, of a test",
    .document = "this file",
    .settings = settings,
    .fields = Measurement::counter | Measurement::rate | Measurement::specific_force,
    .resolution = {.rate = rate_lsb, .specific_force = force_lsb},
    .range = {.rate = 32767 * rate_lsb, .specific_force = 32767 * force_lsb},
    .counter_bits = 8,
    .status_bits = 0,
    .make = by_table,
    .make_decoder = by_table,
});

}  // namespace imud
