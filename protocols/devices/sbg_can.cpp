// SBG Systems Ellipse on CAN: sbgECan, as SBG's sbgECom 5 documents it (doc/canProtocol.md). Little-endian; no
// counter and no checksum; the unit only sends. sbg_can.dbc beside this file describes the same layouts for CAN
// tools.
//
// The tables below are the layouts. IMU_INFO, IMU_ACCEL and IMU_GYRO, in this order, are a set. As delivered, a unit
// sends nothing: the setting `messages` is its configuration, and begins with this set.
//
// Attitude, position and velocity are the truth's, or the solution of the unit's own filter; while that has no place,
// position and velocity are the receiver's. The undulation is 0, so that the altitude is the height above the
// ellipsoid. A magnetometer's arbitrary unit is taken as 50 uT.
#include "protocols/signals/signal_product.hpp"

namespace imud {
namespace {

constexpr double accel_lsb = 0.01, gyro_lsb = 0.001, temperature_lsb = 0.01;

// --- Numbers that only this product has ---
// IMU_STATUS (sbgEComLogImu.h): good communication is bit 0, the general built-in test bit 1, the tests of the
// sensors bits 2 to 7. Bits 8 and 9: accelerometers and gyros are within their range.
double imu_status(const Reading& reading) noexcept {
  const std::uint32_t status = reading.sample.status;
  const bool accelerometers = (status / status::accelerometer_saturated_x & 7U) == 0;
  const bool gyros = (status / status::gyro_saturated_x & 7U) == 0;
  const unsigned tests = (status & status::not_valid) != 0          ? 0x01
                         : (status & status::self_test_failed) != 0 ? 0xFD
                                                                    : 0xFF;
  return tests | (accelerometers ? 0x100U : 0U) | (gyros ? 0x200U : 0U);
}
constexpr MeasuredQuantity imu_status_word = {.name = "imu_status", .help = "", .get = imu_status};

constexpr CanSignal time_stamp = {"TIME_STAMP", 0, 32, intel_unsigned, 1, 0, "time_us"};

constexpr CanSignal utc_0[] = {time_stamp, {"GPS_TOW", 32, 32, intel_unsigned, 1, 0, "gps_time_of_week_ms"}};
constexpr CanSignal utc_1[] = {{"YEAR", 0, 8, intel_unsigned, 1, 2000, "utc_year"},
                               {"MONTH", 8, 8, intel_unsigned, 1, 0, "utc_month"},
                               {"DAY", 16, 8, intel_unsigned, 1, 0, "utc_day"},
                               {"HOUR", 24, 8, intel_unsigned, 1, 0, "utc_hour"},
                               {"MIN", 32, 8, intel_unsigned, 1, 0, "utc_minute"},
                               {"SEC", 40, 8, intel_unsigned, 1, 0, "utc_second"},
                               {"MICRO_SEC", 48, 16, intel_unsigned, 100, 0, "utc_subsecond_us"}};
constexpr CanSignal imu_info[] = {
    time_stamp,
    {.name = "STATUS", .start = 32, .length = 16, .encoding = intel_unsigned, .quantity = &imu_status_word},
    {"TEMPERATURE", 48, 16, intel_signed, temperature_lsb, 0, "temperature_c"}};
constexpr CanSignal imu_accel[] = {{"ACCEL_X", 0, 16, intel_signed, accel_lsb, 0, "specific_force_x_m_per_s2"},
                                   {"ACCEL_Y", 16, 16, intel_signed, accel_lsb, 0, "specific_force_y_m_per_s2"},
                                   {"ACCEL_Z", 32, 16, intel_signed, accel_lsb, 0, "specific_force_z_m_per_s2"}};
constexpr CanSignal imu_gyro[] = {{"GYRO_X", 0, 16, intel_signed, gyro_lsb, 0, "rate_x_rad_per_s"},
                                  {"GYRO_Y", 16, 16, intel_signed, gyro_lsb, 0, "rate_y_rad_per_s"},
                                  {"GYRO_Z", 32, 16, intel_signed, gyro_lsb, 0, "rate_z_rad_per_s"}};
constexpr CanSignal imu_delta_vel[] = {
    {"DELTA_VEL_X", 0, 16, intel_signed, accel_lsb, 0, "mean_specific_force_x_m_per_s2"},
    {"DELTA_VEL_Y", 16, 16, intel_signed, accel_lsb, 0, "mean_specific_force_y_m_per_s2"},
    {"DELTA_VEL_Z", 32, 16, intel_signed, accel_lsb, 0, "mean_specific_force_z_m_per_s2"}};
constexpr CanSignal imu_delta_angle[] = {
    {"DELTA_ANGLE_X", 0, 16, intel_signed, gyro_lsb, 0, "mean_rate_x_rad_per_s"},
    {"DELTA_ANGLE_Y", 16, 16, intel_signed, gyro_lsb, 0, "mean_rate_y_rad_per_s"},
    {"DELTA_ANGLE_Z", 32, 16, intel_signed, gyro_lsb, 0, "mean_rate_z_rad_per_s"}};
constexpr CanSignal ekf_info[] = {time_stamp};
constexpr CanSignal ekf_quat[] = {{"Q0", 0, 16, intel_signed, 1.0 / 32767, 0, "q_LP_w"},
                                  {"Q1", 16, 16, intel_signed, 1.0 / 32767, 0, "q_LP_x"},
                                  {"Q2", 32, 16, intel_signed, 1.0 / 32767, 0, "q_LP_y"},
                                  {"Q3", 48, 16, intel_signed, 1.0 / 32767, 0, "q_LP_z"}};
constexpr CanSignal ekf_euler[] = {{"ROLL", 0, 16, intel_signed, 1e-4, 0, "roll_rad"},
                                   {"PITCH", 16, 16, intel_signed, 1e-4, 0, "pitch_rad"},
                                   {"YAW", 32, 16, intel_signed, 1e-4, 0, "yaw_rad"}};
constexpr CanSignal ekf_pos[] = {{"LATITUDE", 0, 32, intel_signed, 1e-7, 0, "latitude_deg"},
                                 {"LONGITUDE", 32, 32, intel_signed, 1e-7, 0, "longitude_deg"}};
constexpr CanSignal ekf_altitude[] = {{"ALTITUDE", 0, 32, intel_signed, 1e-3, 0, "height_m"},
                                      {"UNDULATION", 32, 16, intel_signed, 5e-3, 0}};
constexpr CanSignal ekf_vel_ned[] = {{"VELOCITY_N", 0, 16, intel_signed, 0.01, 0, "velocity_north_m_per_s"},
                                     {"VELOCITY_E", 16, 16, intel_signed, 0.01, 0, "velocity_east_m_per_s"},
                                     {"VELOCITY_D", 32, 16, intel_signed, 0.01, 0, "velocity_down_m_per_s"}};
constexpr CanSignal ekf_vel_body[] = {{"VELOCITY_X", 0, 16, intel_signed, 0.01, 0, "velocity_x_m_per_s"},
                                      {"VELOCITY_Y", 16, 16, intel_signed, 0.01, 0, "velocity_y_m_per_s"},
                                      {"VELOCITY_Z", 32, 16, intel_signed, 0.01, 0, "velocity_z_m_per_s"}};
constexpr CanSignal mag_0[] = {time_stamp,
                               {.name = "STATUS", .start = 32, .length = 16, .initial = 0xFF}};  // all is good
constexpr CanSignal mag_1[] = {{"MAG_X", 0, 16, intel_signed, 1e-3, 0, "magnetic_field_x_au"},
                               {"MAG_Y", 16, 16, intel_signed, 1e-3, 0, "magnetic_field_y_au"},
                               {"MAG_Z", 32, 16, intel_signed, 1e-3, 0, "magnetic_field_z_au"}};

constexpr SignalProductMessage messages[] = {
    {"utc_0", 0x110, 8, utc_0},
    {"utc_1", 0x111, 8, utc_1},
    {"imu_info", 0x120, 8, imu_info},
    {"imu_accel", 0x121, 6, imu_accel},
    {"imu_gyro", 0x122, 6, imu_gyro},
    {"imu_delta_vel", 0x123, 6, imu_delta_vel},
    {"imu_delta_angle", 0x124, 6, imu_delta_angle},
    {"ekf_info", 0x130, 4, ekf_info},
    {"ekf_quat", 0x131, 8, ekf_quat},
    {"ekf_euler", 0x132, 6, ekf_euler},
    {"ekf_pos", 0x134, 8, ekf_pos},
    {"ekf_altitude", 0x135, 6, ekf_altitude},
    {"ekf_vel_ned", 0x137, 6, ekf_vel_ned},
    {"ekf_vel_body", 0x139, 6, ekf_vel_body},
    {"mag_0", 0x150, 6, mag_0},
    {"mag_1", 0x151, 6, mag_1},
};
// Ellipse: 450 deg/s, 0.15 deg/sqrt(h); 8 g, 57 ug/sqrt(Hz); from memory of the data sheet.
constexpr SignalProduct table = {.messages = messages,
                                 .has_choice = true,
                                 .gyro_noise = 0.15 / 60 * units::degree,
                                 .gyro_max = 450 * units::degree,
                                 .accelerometer_noise = 57e-6 * units::standard_gravity,
                                 .accelerometer_max = 8 * units::standard_gravity};

constexpr std::string_view delivered[] = {"imu_info", "imu_accel", "imu_gyro"};
constexpr Setting settings[] = {output_rate_setting(200, 1000), messages_setting(delivered), identifiers_setting(),
                                id_offset_setting(), extended_setting()};

}  // namespace

extern constexpr Protocol sbg_can_protocol = signal_protocol<table>({
    .name = "sbg-can",
    .summary = "SBG Systems Ellipse on CAN (sbgECan): IMU, attitude, position, UTC",
    .document = "sbgECom 5, doc/canProtocol.md",
    .settings = settings,
    .fields = Measurement::time | Measurement::rate | Measurement::specific_force | Measurement::temperature,
    .resolution = {.time_s = 1e-6, .rate = gyro_lsb, .specific_force = accel_lsb, .temperature_c = temperature_lsb},
    .range = {.rate = 32767 * gyro_lsb,
              .specific_force = 32767 * accel_lsb,
              .temperature_c = 32767 * temperature_lsb},
    .time_period_ns = (std::int64_t{1} << 32) * 1000,
    .status_bits = 0,
    .has_self_test = true,
    .preset = [](const Settings&) -> std::string_view { return "sbg-ellipse"; },
    .solves = [](const Settings&) { return Solves::place; },
});

}  // namespace imud
