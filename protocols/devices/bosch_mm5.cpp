// Bosch MM5.10, automotive inertial sensor: two rates and three accelerations in three messages, little-endian,
// without counter, status and checksum. bosch_mm5.dbc beside this file describes the same layouts for CAN tools.
//
// Layout: Bosch's calibration sheet of MM5.10, as others report it. It has the identifiers and numbers of MM7.10
// (bosch_mm7.cpp), in bytes 0-1 and 4-5; all other bytes are reserved, here 0; there is no pitch rate. Variants of
// the firmware have other identifiers: see the setting `identifiers`. The sheet itself was not at hand.
//
// | byte | 0x174          | 0x178          | 0x17C          | number                    |
// |------|----------------|----------------|----------------|---------------------------|
// | 0-1  | yaw rate       | roll rate      | reserved       | u16, 0.005 deg/s, -163.84 |
// | 4-5  | acceleration y | acceleration x | acceleration z | u16, 0.000127465 g, -4.1768 |
#include "protocols/signals/signal_product.hpp"

namespace imud {
namespace {

constexpr double rate_scale = 0.005, rate_offset = -163.84;                        // deg/s
constexpr double acceleration_scale = 0.000127465, acceleration_offset = -4.1768;  // g

constexpr CanSignal yaw_ay[] = {
    {"YawRate", 0, 16, intel_unsigned, rate_scale, rate_offset, "rate_z_deg_per_s"},
    {"AY", 32, 16, intel_unsigned, acceleration_scale, acceleration_offset, "specific_force_y_g"}};
constexpr CanSignal roll_ax[] = {
    {"RollRate", 0, 16, intel_unsigned, rate_scale, rate_offset, "rate_x_deg_per_s"},
    {"AX", 32, 16, intel_unsigned, acceleration_scale, acceleration_offset, "specific_force_x_g"}};
constexpr CanSignal az[] = {
    {"AZ", 32, 16, intel_unsigned, acceleration_scale, acceleration_offset, "specific_force_z_g"}};

constexpr SignalProductMessage messages[] = {
    {"yaw_ay", 0x174, 8, yaw_ay}, {"roll_ax", 0x178, 8, roll_ax}, {"az", 0x17C, 8, az}};
// No data sheet was at hand. The ranges are the largest values that the fields can hold, and the noise has the order
// of magnitude of the noise of similar sensors.
constexpr SignalProduct bosch_mm5_table = {.messages = messages,
                                           .gyro_noise = 0.01 * units::degree,
                                           .gyro_max = 163 * units::degree,
                                           .accelerometer_noise = 200e-6 * units::standard_gravity,
                                           .accelerometer_max = 4.1 * units::standard_gravity};
constexpr Setting settings[] = {output_rate_setting(100, 200), identifiers_setting(), id_offset_setting(),
                                extended_setting()};

constexpr double rate_lsb = rate_scale * units::degree, force_lsb = acceleration_scale * units::standard_gravity;

}  // namespace

extern constexpr Protocol bosch_mm5_protocol = signal_protocol<bosch_mm5_table>({
    .name = "bosch-mm5",
    .summary = "Bosch MM5.10 automotive inertial sensor: yaw and roll rate, three accelerations",
    .document = "Bosch MM5.10, calibration sheet",
    .settings = settings,
    .fields = Measurement::rate | Measurement::specific_force,
    .resolution = {.rate = rate_lsb, .specific_force = force_lsb},
    .range = {.rate = 32767 * rate_lsb, .specific_force = 32766 * force_lsb},
    .status_bits = 0,
    .make = by_table,
    .make_decoder = by_table,
});

}  // namespace imud
