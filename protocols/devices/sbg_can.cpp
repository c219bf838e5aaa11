// SBG Systems Ellipse on CAN: sbgECan, as SBG's sbgECom 5 documents it (doc/canProtocol.md). Little-endian; no
// counter and no checksum; the unit only sends. sbg_can.dbc beside this file describes the same layouts for CAN
// tools.
//
// The tables below are the layouts. IMU_INFO, IMU_ACCEL and IMU_GYRO, in this order, are a set. A real unit as
// delivered sends nothing. The setting `messages` is its configuration; by default it has this set.
//
// Attitude, position and velocity are the truth's or, if the unit has its own filter, the filter's solution. While
// the filter has no place, position and velocity are the receiver's. Status words and accuracies follow the filter
// (bits and limits: sbgEComLogEkf.h, sbgEComLogStatus.h and doc/binaryMessages.md of sbgECom 05c19cd). The undulation
// is 0, so that the altitude is the height above the ellipsoid. The arbitrary unit of the magnetometer is assumed to
// be 50 uT.
//
// The messages GPS1 are the last fix of the unit's receiver, whatever its solution is, with the time of the fix
// ("position timestamp"). AIR_DATA is the unit's barometer, whose altitude is "referenced to a standard 1013.25 hPa
// zero level pressure".
#include <algorithm>
#include <cmath>

#include "core/attitude.hpp"
#include "protocols/measurements/receiver_accuracy.hpp"
#include "protocols/signals/signal_product.hpp"

namespace imud {
namespace {

constexpr double accel_lsb = 0.01, gyro_lsb = 0.001, temperature_lsb = 0.01;

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

bool is_in(const Reading& reading, Solution::State state) noexcept {
  return reading.sample.solution && reading.sample.solution->state == state;
}
bool has_magnetometer(const Sample& sample) noexcept { return !sample.magnetic_field.isZero(0.0); }

// CLOCK_STATUS: bit 0: PPS; bits 1 to 4, the clock: 1 free running, 3 valid; bit 5: UTC is accurate; bits 6 to 9,
// UTC: 0 invalid, 2 initialized. No document states for how long the clock stays valid without PPS. Here it is not
// valid.
double clock_status(const Reading& reading) noexcept {
  const unsigned clock = reading.sample.fix().is_known ? 1U | 3U << 1 | 1U << 5 : 1U << 1;
  return clock | (reading.sample.timed().is_known ? 2U << 6 : 0U);
}
// AIDING_STATUS has a bit for each kind of data that arrives: position (bit 0), velocity (1) and UTC (3) of the
// receiver, the heading of two antennas (2), the magnetometer (8), the barometer (13).
double aiding_status(const Reading& reading) noexcept {
  const Sample& sample = reading.sample;
  return (sample.fix().is_known ? 0x0BU : 0U) | (sample.antennas() != nullptr ? 0x04U : 0U) |
         (has_magnetometer(sample) ? 0x100U : 0U) | (sample.pressure != 0 ? 0x2000U : 0U);
}

// SOLUTION_STATUS, bits 0 to 3, the mode: 1 vertical gyro, 2 AHRS, 4 navigation. No document states when a unit that
// has lost its fixes leaves mode 4. Here it stays in mode 4 while it coasts.
unsigned solution_mode(const Reading& reading) noexcept {
  enum : unsigned { vertical_gyro = 1, ahrs = 2, nav_position = 4 };
  if (reading.sample.navigation.is_known) return nav_position;
  return !reading.sample.solution || has_magnetometer(reading.sample) ? ahrs : vertical_gyro;
}
// Bits 4 to 7: attitude, heading, velocity and position are valid: their standard deviations are below 0.5 deg, 1
// deg, 1.5 m/s and 10 m.
unsigned valid_bits(const Reading& reading) noexcept {
  constexpr auto tilt = static_cast<float>(0.5 * units::degree), heading = static_cast<float>(units::degree);
  constexpr float velocity = 1.5F, position = 10;
  constexpr unsigned attitudes = 0x30, places = 0xC0;
  const Sample& sample = reading.sample;
  if (!sample.solution) return attitudes | (sample.navigation.is_known ? places : 0U);
  const Solution& solution = *sample.solution;
  const unsigned attitude =
      (solution.attitude.head<2>().maxCoeff() < tilt ? 0x10U : 0U) | (solution.attitude.z() < heading ? 0x20U : 0U);
  if (!sample.navigation.is_known) return attitude;
  return attitude | (solution.velocity.maxCoeff() < velocity ? 0x40U : 0U) |
         (solution.position.maxCoeff() < position ? 0x80U : 0U);
}
// Bits 8 to 13, 25 and 26: the aids that are used. A receiver's fix counts as used for 3 s ("since 3 s"); of another
// aid, the last measurement counts. Bit 27 (the alignment has converged) has no documented limit: here it is set if
// bits 4 to 7 are. A unit that reports the truth uses its receiver.
double solution_status(const Reading& reading) noexcept {
  constexpr unsigned vertical = 1U << 8, magnetic = 1U << 9, receiver = 3U << 10, antennas = 1U << 13,
                     air_data = 1U << 25, zero_velocity = 1U << 26, converged = 1U << 27, all_valid = 0xF0;
  constexpr float hold_s = 3;
  const Sample& sample = reading.sample;
  const unsigned valid = valid_bits(reading);
  const unsigned status = solution_mode(reading) | valid | (valid == all_valid ? converged : 0U);
  if (!sample.solution)
    return status | (sample.navigation.is_known ? receiver : 0U) | (sample.antennas() != nullptr ? antennas : 0U);
  if (is_in(reading, Solution::State::aligning))
    return status | vertical | (has_magnetometer(sample) ? magnetic : 0U);
  const Solution& solution = *sample.solution;
  const auto if_used = [&](unsigned aid, unsigned bits) { return (solution.used & aid) != 0 ? bits : 0U; };
  const bool has_fixes = sample.navigation.is_known && solution.since_fix_s < hold_s;
  return status | (has_fixes ? receiver : 0U) | if_used(aid::gravity, vertical) |
         if_used(aid::magnetic_heading, magnetic) | if_used(aid::antennas_heading, antennas) |
         if_used(aid::pressure, air_data) | if_used(aid::zero_velocity, zero_velocity);
}

// Returns the standard deviation of an angle, rad (0 roll, 1 pitch, 2 yaw), from the deviations of rotations about
// north, east and down, which are assumed to be independent. The document's ranges end at pi, pi/2 and pi.
template <int Angle>
double angle_accuracy(const Reading& reading) noexcept {
  if (!reading.sample.solution) return 0;
  const double sigma =
      roll_pitch_yaw_deviations(reading.sample.q_LP, reading.sample.solution->attitude.cast<double>())[Angle];
  return std::min(sigma, Angle == 1 ? units::pi / 2 : units::pi);
}
constexpr double largest_position = 655.35, largest_velocity = 327.67;  // m, m/s
// Returns the standard deviation of a component, at most 655.35 m (the largest value of its field) or 327.67 m/s
// (SBG's document has accuracies of velocities as unsigned numbers, its sbgCan.dbc as signed numbers). While there is
// no place, returns these limits.
template <Eigen::Vector3f Solution::*Member, int Axis>
double accuracy(const Reading& reading) noexcept {
  constexpr double largest = Member == &Solution::position ? largest_position : largest_velocity;
  if (!reading.sample.solution) return 0;
  if (!reading.sample.navigation.is_known) return largest;
  return std::min(largest, static_cast<double>(((*reading.sample.solution).*Member)[Axis]));
}

// GPS_POS_STATUS and GPS_VEL_STATUS (sbgEComLogGnssPos.h, sbgEComLogGnssVel.h). Bits 0 to 5: 0 computed, 1 too few
// satellites. Bits 6 to 11, the type: of a position 2, single; of a velocity 2, Doppler; 0 without a solution. Bit
// 12: GPS L1 is used, which is chosen.
constexpr unsigned no_solution = 1, computed = 2U << 6, gps_l1 = 1U << 12;
double gps_position_status(const Reading& reading) noexcept {
  return reading.sample.fix().is_known ? computed | gps_l1 : no_solution;
}
double gps_velocity_status(const Reading& reading) noexcept {
  return reading.sample.fix().is_known ? computed : no_solution;
}
// Returns the accuracy of a component, at most 655.35 m or 327.67 m/s, as above; without a fix, returns this limit.
template <Vector3 ReceiverAccuracy::*Member, int Axis>
double gps_accuracy(const Reading& reading) noexcept {
  constexpr double largest = Member == &ReceiverAccuracy::position ? largest_position : largest_velocity;
  return reading.sample.fix().is_known ? std::min(largest, (receiver_accuracy(reading).*Member)[Axis]) : largest;
}
// Returns the standard deviation of the course, rad, at most pi, by the horizontal velocity and its accuracy.
double gps_course_accuracy(const Reading& reading) noexcept {
  const Vector3& v = reading.sample.fix().v_L;
  const double north = v.x() * gps_accuracy<&ReceiverAccuracy::velocity, 1>(reading),
               east = v.y() * gps_accuracy<&ReceiverAccuracy::velocity, 0>(reading);
  const double square = v.head<2>().squaredNorm(), across = std::sqrt(north * north + east * east);
  return across < units::pi * square ? across / square : units::pi;
}

// GPS_HDT_STATUS, bits 0 to 5: 0 computed, 1 too few satellites; bit 6: the length of the baseline is valid, which no
// message on CAN has. Without a heading the accuracies of heading and pitch are 180 and 90 deg, from which on they
// are not valid (sbgEComLogGnssHdt.c; an accuracy of 0 is not valid either). Some receivers measure no pitch
// (sbgEComLogGnssHdt.h). This receiver measures none either, because no document states its accuracy.
double gps_heading_status(const Reading& reading) noexcept { return reading.sample.antennas() != nullptr ? 0 : 1; }
constexpr double heading_lsb = 0.01 * units::degree;
double gps_heading_accuracy(const Reading& reading) noexcept {
  const AntennaLine* const line = reading.sample.antennas();
  return line != nullptr ? std::clamp(line->sigma, heading_lsb, units::pi - heading_lsb) : units::pi;
}

// AIR_DATA_STATUS (doc/binaryMessages.md): bit 1: the pressure is valid, bit 2: the altitude is valid.
double air_data_status(const Reading& reading) noexcept { return reading.sample.pressure > 0 ? 6 : 0; }

// The number that a function of this file returns, as a quantity.
template <double (*Get)(const Reading&) noexcept>
constexpr MeasuredQuantity quantity = {.name = "own", .help = "", .get = Get};

template <double (*Get)(const Reading&) noexcept>
constexpr CanSignal own(std::string_view name, unsigned start, unsigned length, double scale) {
  return {.name = name,
          .start = start,
          .length = length,
          .encoding = intel_unsigned,
          .scale = scale,
          .quantity = &quantity<Get>};
}

constexpr CanSignal time_stamp = {"TIME_STAMP", 0, 32, intel_unsigned, 1, 0, "time_us"},
                    fix_time_stamp = {"TIME_STAMP", 0, 32, intel_unsigned, 1, 0, "gnss_time_us"},
                    heading_time_stamp = {"TIME_STAMP", 0, 32, intel_unsigned, 1, 0, "gnss_heading_time_us"};

// GENERAL_STATUS: power, settings, temperature, logger and processor are good. COM_STATUS: no error on the ports A to
// E (bits 0 to 14), nor on the CAN bus (25 to 27), whose state is 2, good (28 to 30).
constexpr CanSignal status_01[] = {time_stamp,
                                   {.name = "GENERAL", .start = 32, .length = 16, .initial = 0x7F},
                                   own<clock_status>("CLOCK", 48, 16, 1)};
constexpr CanSignal status_02[] = {{.name = "COM", .start = 0, .length = 32, .initial = 0x2E007FFF},
                                   own<aiding_status>("AIDING", 32, 32, 1)};
constexpr CanSignal status_03[] = {own<solution_status>("SOLUTION", 0, 32, 1),
                                   {.name = "HEAVE_STATUS", .start = 32, .length = 16, .initial = 0}};
constexpr CanSignal utc_0[] = {time_stamp, {"GPS_TOW", 32, 32, intel_unsigned, 1, 0, "gps_time_of_week_ms"}};
constexpr CanSignal utc_1[] = {{"YEAR", 0, 8, intel_unsigned, 1, 2000, "utc_year"},
                               {"MONTH", 8, 8, intel_unsigned, 1, 0, "utc_month"},
                               {"DAY", 16, 8, intel_unsigned, 1, 0, "utc_day"},
                               {"HOUR", 24, 8, intel_unsigned, 1, 0, "utc_hour"},
                               {"MIN", 32, 8, intel_unsigned, 1, 0, "utc_minute"},
                               {"SEC", 40, 8, intel_unsigned, 1, 0, "utc_second"},
                               {"MICRO_SEC", 48, 16, intel_unsigned, 100, 0, "utc_subsecond_us"}};
constexpr CanSignal imu_info[] = {time_stamp,
                                  own<imu_status>("STATUS", 32, 16, 1),
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
constexpr CanSignal ekf_orientation_acc[] = {own<angle_accuracy<0>>("ROLL_ACC", 0, 16, 1e-4),
                                             own<angle_accuracy<1>>("PITCH_ACC", 16, 16, 1e-4),
                                             own<angle_accuracy<2>>("YAW_ACC", 32, 16, 1e-4)};
constexpr CanSignal ekf_pos[] = {{"LATITUDE", 0, 32, intel_signed, 1e-7, 0, "latitude_deg"},
                                 {"LONGITUDE", 32, 32, intel_signed, 1e-7, 0, "longitude_deg"}};
constexpr CanSignal ekf_altitude[] = {{"ALTITUDE", 0, 32, intel_signed, 1e-3, 0, "height_m"},
                                      {"UNDULATION", 32, 16, intel_signed, 5e-3, 0}};
constexpr CanSignal ekf_pos_acc[] = {own<accuracy<&Solution::position, 0>>("LATITUDE_ACC", 0, 16, 0.01),
                                     own<accuracy<&Solution::position, 1>>("LONGITUDE_ACC", 16, 16, 0.01),
                                     own<accuracy<&Solution::position, 2>>("ALTITUDE_ACC", 32, 16, 0.01)};
constexpr CanSignal ekf_vel_ned[] = {{"VELOCITY_N", 0, 16, intel_signed, 0.01, 0, "velocity_north_m_per_s"},
                                     {"VELOCITY_E", 16, 16, intel_signed, 0.01, 0, "velocity_east_m_per_s"},
                                     {"VELOCITY_D", 32, 16, intel_signed, 0.01, 0, "velocity_down_m_per_s"}};
constexpr CanSignal ekf_vel_ned_acc[] = {own<accuracy<&Solution::velocity, 0>>("VELOCITY_ACC_N", 0, 16, 0.01),
                                         own<accuracy<&Solution::velocity, 1>>("VELOCITY_ACC_E", 16, 16, 0.01),
                                         own<accuracy<&Solution::velocity, 2>>("VELOCITY_ACC_D", 32, 16, 0.01)};
constexpr CanSignal ekf_vel_body[] = {{"VELOCITY_X", 0, 16, intel_signed, 0.01, 0, "velocity_x_m_per_s"},
                                      {"VELOCITY_Y", 16, 16, intel_signed, 0.01, 0, "velocity_y_m_per_s"},
                                      {"VELOCITY_Z", 32, 16, intel_signed, 0.01, 0, "velocity_z_m_per_s"}};
constexpr CanSignal mag_0[] = {time_stamp,
                               {.name = "STATUS", .start = 32, .length = 16, .initial = 0xFF}};  // all is good
constexpr CanSignal mag_1[] = {{"MAG_X", 0, 16, intel_signed, 1e-3, 0, "magnetic_field_x_au"},
                               {"MAG_Y", 16, 16, intel_signed, 1e-3, 0, "magnetic_field_y_au"},
                               {"MAG_Z", 32, 16, intel_signed, 1e-3, 0, "magnetic_field_z_au"}};
constexpr CanSignal air_data_info[] = {time_stamp,
                                       own<air_data_status>("AIR_DATA_STATUS", 32, 8, 1),
                                       {.name = "AIR_TEMPERATURE", .start = 40, .length = 16, .initial = 0}};
constexpr CanSignal air_data_altitude[] = {{"PRESSURE_ABS", 0, 32, intel_unsigned, 1e-3, 0, "pressure_pa"},
                                           {"ALTITUDE", 32, 32, intel_signed, 1e-3, 0, "pressure_altitude_m"}};
constexpr CanSignal gps1_vel_info[] = {fix_time_stamp, own<gps_velocity_status>("GPS_VEL_STATUS", 32, 32, 1)};
constexpr CanSignal gps1_vel[] = {{"VEL_N", 0, 16, intel_signed, 0.01, 0, "gnss_velocity_north_m_per_s"},
                                  {"VEL_E", 16, 16, intel_signed, 0.01, 0, "gnss_velocity_east_m_per_s"},
                                  {"VEL_D", 32, 16, intel_signed, 0.01, 0, "gnss_velocity_down_m_per_s"}};
constexpr CanSignal gps1_vel_acc[] = {own<gps_accuracy<&ReceiverAccuracy::velocity, 0>>("VEL_ACC_N", 0, 16, 0.01),
                                      own<gps_accuracy<&ReceiverAccuracy::velocity, 1>>("VEL_ACC_E", 16, 16, 0.01),
                                      own<gps_accuracy<&ReceiverAccuracy::velocity, 2>>("VEL_ACC_D", 32, 16, 0.01)};
constexpr CanSignal gps1_course[] = {{"COURSE", 0, 16, intel_unsigned, 0.01, 0, "gnss_track_deg%360"},
                                     own<gps_course_accuracy>("COURSE_ACC", 16, 16, 0.01 * units::degree)};
constexpr CanSignal gps1_pos_info[] = {fix_time_stamp, own<gps_position_status>("GPS_POS_STATUS", 32, 32, 1)};
constexpr CanSignal gps1_pos[] = {{"LATITUDE", 0, 32, intel_signed, 1e-7, 0, "gnss_latitude_deg"},
                                  {"LONGITUDE", 32, 32, intel_signed, 1e-7, 0, "gnss_longitude_deg"}};
constexpr CanSignal gps1_pos_alt[] = {{"ALTITUDE", 0, 32, intel_signed, 1e-3, 0, "gnss_height_m"},
                                      {"UNDULATION", 32, 16, intel_signed, 5e-3, 0},
                                      {"NUM_SV", 48, 8, intel_unsigned, 1, 0, "gnss_satellites"},
                                      {.name = "DIFF_CORR_AGE", .start = 56, .length = 8, .initial = 0xFF}};
constexpr CanSignal gps1_pos_acc[] = {own<gps_accuracy<&ReceiverAccuracy::position, 0>>("LAT_ACC", 0, 16, 0.01),
                                      own<gps_accuracy<&ReceiverAccuracy::position, 1>>("LONG_ACC", 16, 16, 0.01),
                                      own<gps_accuracy<&ReceiverAccuracy::position, 2>>("ALT_ACC", 32, 16, 0.01),
                                      {.name = "BASE_STATION_ID", .start = 48, .length = 16, .initial = 0xFFFF}};
constexpr CanSignal gps1_hdt_info[] = {heading_time_stamp, own<gps_heading_status>("GPS_HDT_STATUS", 32, 16, 1)};
constexpr CanSignal gps1_hdt[] = {{"TRUE_HEADING", 0, 16, intel_unsigned, 0.01, 0, "gnss_heading_deg%360"},
                                  own<gps_heading_accuracy>("TRUE_HEADING_ACC", 16, 16, heading_lsb),
                                  {.name = "PITCH", .start = 32, .length = 16, .initial = 0},
                                  {.name = "PITCH_ACC", .start = 48, .length = 16, .initial = 9000}};

constexpr SignalProductMessage messages[] = {
    {"status_01", 0x100, 8, status_01},
    {"status_02", 0x101, 8, status_02},
    {"status_03", 0x102, 6, status_03},
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
    {"ekf_orientation_acc", 0x133, 6, ekf_orientation_acc},
    {"ekf_pos", 0x134, 8, ekf_pos},
    {"ekf_altitude", 0x135, 6, ekf_altitude},
    {"ekf_pos_acc", 0x136, 6, ekf_pos_acc},
    {"ekf_vel_ned", 0x137, 6, ekf_vel_ned},
    {"ekf_vel_ned_acc", 0x138, 6, ekf_vel_ned_acc},
    {"ekf_vel_body", 0x139, 6, ekf_vel_body},
    {"mag_0", 0x150, 6, mag_0},
    {"mag_1", 0x151, 6, mag_1},
    {"air_data_info", 0x162, 7, air_data_info},
    {"air_data_altitude", 0x163, 8, air_data_altitude},
    {"gps1_vel_info", 0x170, 8, gps1_vel_info},
    {"gps1_vel", 0x171, 6, gps1_vel},
    {"gps1_vel_acc", 0x172, 6, gps1_vel_acc},
    {"gps1_course", 0x173, 4, gps1_course},
    {"gps1_pos_info", 0x174, 8, gps1_pos_info},
    {"gps1_pos", 0x175, 8, gps1_pos},
    {"gps1_pos_alt", 0x176, 8, gps1_pos_alt},
    {"gps1_pos_acc", 0x177, 8, gps1_pos_acc},
    {"gps1_hdt_info", 0x178, 6, gps1_hdt_info},
    {"gps1_hdt", 0x179, 8, gps1_hdt},
};
// Figures of the Ellipse, from memory of the data sheet: 450 deg/s, 0.15 deg/sqrt(h); 8 g, 57 ug/sqrt(Hz).
constexpr SignalProduct sbg_can_table = {.messages = messages,
                                         .has_choice = true,
                                         .gyro_noise = 0.15 / 60 * units::degree,
                                         .gyro_max = 450 * units::degree,
                                         .accelerometer_noise = 57e-6 * units::standard_gravity,
                                         .accelerometer_max = 8 * units::standard_gravity};

constexpr std::string_view delivered[] = {"imu_info", "imu_accel", "imu_gyro"};
constexpr Setting settings[] = {output_rate_setting(200, 1000), messages_setting(delivered), identifiers_setting(),
                                id_offset_setting(), extended_setting()};

}  // namespace

extern constexpr Protocol sbg_can_protocol = signal_protocol<sbg_can_table>({
    .name = "sbg-can",
    .summary = "SBG Systems Ellipse on CAN (sbgECan): IMU, attitude, position, receiver, UTC, status",
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
    .make = by_table,
    .make_decoder = by_table,
});

}  // namespace imud
