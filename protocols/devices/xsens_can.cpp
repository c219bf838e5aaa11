// Xsens MTi-600 series on CAN. Big-endian; no checksum; the unit only sends. xsens_can.dbc beside this file describes
// the same layouts for CAN tools.
//
// Layouts: the ROS driver of a vendor's engineer (jiminghe/Xsens_MTi_CAN_ROS_Driver), with config/xsens.dbc and a
// parser. These two differ in the unit of SampleTime (here 100 us) and in the sign of the pressure (here unsigned).
// The protocol's document was not at hand. The driver needs SampleTime and UTC to group the messages of a sample.
//
// The tables below are the layouts. The axes of the case, S, are forward, left, up, so that the specific force at
// rest is +9.81 in z; sensors, increments and magnetic field have these axes. By Xsens's default, attitude, free
// acceleration and velocity are relative to east-north-up. Messages whose names end in _ned are relative to
// north-east-down: this turns the local axes alone (RotLocal, MTi User Manual MT0605P.E, pages 45 and 46), so that a
// level unit has a roll of 180 deg. Attitude, position and velocity are the truth's or, if the unit has its own
// filter, the filter's solution. While the filter has no place, position and velocity are the receiver's. The
// arbitrary unit of the magnetometer is assumed to be 50 uT.
#include <cmath>

#include "core/attitude.hpp"
#include "protocols/signals/signal_product.hpp"

namespace imud {
namespace {

constexpr double rate_lsb = 0x1p-9, force_lsb = 0x1p-8, temperature_lsb = 0x1p-8;

// StatusWord: bit 0 self-test, 1 attitude valid, 2 the receiver has a fix, 8 to 10 accelerometer clipped, 11 to 13
// gyro clipped, 19 any clipped; 23 to 25 the mode of the unit's own filter: 1 without fixes, 3 with fixes (Xsens's
// XsStatusWord message).
double status_word(const Reading& reading) noexcept {
  const std::uint32_t status = reading.sample.status;
  const std::uint32_t clipped = (status >> 3 & 7U) << 8 | (status & 7U) << 11;
  const auto is_in = [&](Solution::State state) {
    return reading.sample.solution && reading.sample.solution->state == state;
  };
  const unsigned mode = is_in(Solution::State::coasting) ? 1 : is_in(Solution::State::aided) ? 3 : 0;
  return ((status & status::self_test_failed) == 0 ? 1U : 0U) | (is_in(Solution::State::aligning) ? 0U : 2U) |
         (reading.sample.fix().is_known ? 4U : 0U) | clipped | (clipped != 0 ? 1U << 19 : 0U) | mode << 23;
}
void put_status_word(double value, ReadBack& read) noexcept {
  const auto word = static_cast<std::uint32_t>(value);
  read.measurement.sample.status =
      (word >> 11 & 7U) | (word >> 8 & 7U) << 3 | ((word & 1U) == 0 ? status::self_test_failed : 0U);
  read.measurement.fields |= Measurement::status;
}
constexpr MeasuredQuantity status_quantity = {
    .name = "status_word", .help = "", .get = status_word, .set = put_status_word};

// The components of DeltaV have a common exponent e: a value is mantissa * 2^-e. The parser of the driver takes any
// e; xsens.dbc has the factor 2^-17. Here e is 17, or less if a component would not fit.
constexpr int largest_exponent = 17;
double exponent(const Reading& reading) noexcept {
  const double largest = reading.delta_velocity.cwiseAbs().maxCoeff();
  int e = largest_exponent;
  while (e > 0 && std::ldexp(largest, e) >= 32767.5) --e;
  return e;
}
template <int Axis>
constexpr double direction = Axis == 0 ? 1 : -1;  // the sign of S's axis along P's
template <int Axis>
double mantissa(const Reading& reading) noexcept {
  return direction<Axis> * std::ldexp(reading.delta_velocity[Axis], static_cast<int>(exponent(reading)));
}
void put_exponent(double value, ReadBack& read) noexcept { read.scratch = value; }
template <int Axis>
void put_mantissa(double value, ReadBack& read) noexcept {
  read.measurement.sample.delta_velocity[Axis] = direction<Axis> * std::ldexp(value, -static_cast<int>(read.scratch));
  read.components |= 1U << (9 + Axis);
}
constexpr MeasuredQuantity exponent_quantity = {
    .name = "exponent", .help = "", .get = exponent, .set = put_exponent, .is_increment = true};
template <int Axis>
constexpr MeasuredQuantity mantissa_quantity = {
    .name = "mantissa", .help = "", .get = mantissa<Axis>, .set = put_mantissa<Axis>, .is_increment = true};

// Attitude of the case relative to north-east-down, L, and to east-north-up, U. Of q and -q, the one with w >= 0.
Quaternion with_positive_scalar(const Quaternion& q) noexcept {
  return q.w() < 0 ? Quaternion(-q.w(), -q.x(), -q.y(), -q.z()) : q;
}
Quaternion q_LS(const Reading& reading) noexcept {
  return with_positive_scalar(reading.sample.q_LP * Quaternion(0, 1, 0, 0));
}
Quaternion q_US(const Reading& reading) noexcept {
  constexpr double half = 0.7071067811865476;
  return with_positive_scalar(Quaternion(0, half, half, 0) * q_LS(reading));
}
using Attitude = Quaternion(const Reading&) noexcept;
template <Attitude Of, int Index>
double component(const Reading& reading) noexcept {
  const Quaternion q = Of(reading);
  return Index == 0 ? q.w() : q.vec()[Index == 0 ? 0 : Index - 1];
}
template <Attitude Of, int Index>
double euler_deg(const Reading& reading) noexcept {
  return yaw_pitch_roll_from_dcm(Of(reading).conjugate().toRotationMatrix())[Index] / units::degree;
}
template <Attitude Of, int Index>
constexpr MeasuredQuantity attitude_quantity = {.name = "attitude", .help = "", .get = component<Of, Index>};
template <Attitude Of, int Index>
constexpr MeasuredQuantity euler_quantity = {.name = "euler", .help = "", .get = euler_deg<Of, Index>};

constexpr CanSignal own(std::string_view name, unsigned start, unsigned length, SignalEncoding encoding, double scale,
                        const MeasuredQuantity& quantity) {
  return {
      .name = name, .start = start, .length = length, .encoding = encoding, .scale = scale, .quantity = &quantity};
}

constexpr CanSignal sample_time[] = {{"Timestamp", 7, 32, motorola_unsigned, 100, 0, "time_us"}};
constexpr CanSignal group_counter[] = {{"Counter", 7, 16, motorola_unsigned, 1, 0, "sample_counter"}};
constexpr CanSignal utc[] = {{"year", 7, 8, motorola_unsigned, 1, 2000, "utc_year"},
                             {"month", 15, 8, motorola_unsigned, 1, 0, "utc_month"},
                             {"day", 23, 8, motorola_unsigned, 1, 0, "utc_day"},
                             {"hour", 31, 8, motorola_unsigned, 1, 0, "utc_hour"},
                             {"minute", 39, 8, motorola_unsigned, 1, 0, "utc_minute"},
                             {"second", 47, 8, motorola_unsigned, 1, 0, "utc_second"},
                             {"tenthms", 55, 16, motorola_unsigned, 100, 0, "utc_subsecond_us"}};
constexpr CanSignal status_signals[] = {own("StatusWord", 7, 32, motorola_unsigned, 1, status_quantity)};
constexpr CanSignal quaternion[] = {own("Q1", 7, 16, motorola_signed, 0x1p-15, attitude_quantity<q_US, 0>),
                                    own("Q2", 23, 16, motorola_signed, 0x1p-15, attitude_quantity<q_US, 1>),
                                    own("Q3", 39, 16, motorola_signed, 0x1p-15, attitude_quantity<q_US, 2>),
                                    own("Q4", 55, 16, motorola_signed, 0x1p-15, attitude_quantity<q_US, 3>)};
constexpr CanSignal quaternion_ned[] = {own("Q1", 7, 16, motorola_signed, 0x1p-15, attitude_quantity<q_LS, 0>),
                                        own("Q2", 23, 16, motorola_signed, 0x1p-15, attitude_quantity<q_LS, 1>),
                                        own("Q3", 39, 16, motorola_signed, 0x1p-15, attitude_quantity<q_LS, 2>),
                                        own("Q4", 55, 16, motorola_signed, 0x1p-15, attitude_quantity<q_LS, 3>)};
constexpr CanSignal euler[] = {own("roll", 7, 16, motorola_signed, 0x1p-7, euler_quantity<q_US, 2>),
                               own("pitch", 23, 16, motorola_signed, 0x1p-7, euler_quantity<q_US, 1>),
                               own("yaw", 39, 16, motorola_signed, 0x1p-7, euler_quantity<q_US, 0>)};
constexpr CanSignal euler_ned[] = {own("roll", 7, 16, motorola_signed, 0x1p-7, euler_quantity<q_LS, 2>),
                                   own("pitch", 23, 16, motorola_signed, 0x1p-7, euler_quantity<q_LS, 1>),
                                   own("yaw", 39, 16, motorola_signed, 0x1p-7, euler_quantity<q_LS, 0>)};
// The exponent is decoded first.
constexpr CanSignal delta_v[] = {own("Exponent", 55, 8, motorola_unsigned, 1, exponent_quantity),
                                 own("X", 7, 16, motorola_signed, 1, mantissa_quantity<0>),
                                 own("Y", 23, 16, motorola_signed, 1, mantissa_quantity<1>),
                                 own("Z", 39, 16, motorola_signed, 1, mantissa_quantity<2>)};
constexpr CanSignal rate_of_turn[] = {{"gyrX", 7, 16, motorola_signed, rate_lsb, 0, "rate_x_rad_per_s"},
                                      {"gyrY", 23, 16, motorola_signed, rate_lsb, 0, "-rate_y_rad_per_s"},
                                      {"gyrZ", 39, 16, motorola_signed, rate_lsb, 0, "-rate_z_rad_per_s"}};
constexpr CanSignal delta_q[] = {{"DeltaQ1", 7, 16, motorola_signed, 1.0 / 32767, 0, "rotation_w"},
                                 {"DeltaQ2", 23, 16, motorola_signed, 1.0 / 32767, 0, "rotation_x"},
                                 {"DeltaQ3", 39, 16, motorola_signed, 1.0 / 32767, 0, "-rotation_y"},
                                 {"DeltaQ4", 55, 16, motorola_signed, 1.0 / 32767, 0, "-rotation_z"}};
constexpr CanSignal acceleration[] = {{"accX", 7, 16, motorola_signed, force_lsb, 0, "specific_force_x_m_per_s2"},
                                      {"accY", 23, 16, motorola_signed, force_lsb, 0, "-specific_force_y_m_per_s2"},
                                      {"accZ", 39, 16, motorola_signed, force_lsb, 0, "-specific_force_z_m_per_s2"}};
constexpr CanSignal free_acceleration[] = {
    {"FreeAccX", 7, 16, motorola_signed, force_lsb, 0, "free_acceleration_east_m_per_s2"},
    {"FreeAccY", 23, 16, motorola_signed, force_lsb, 0, "free_acceleration_north_m_per_s2"},
    {"FreeAccZ", 39, 16, motorola_signed, force_lsb, 0, "-free_acceleration_down_m_per_s2"}};
constexpr CanSignal magnetic_field[] = {{"magX", 7, 16, motorola_signed, 0x1p-10, 0, "magnetic_field_x_au"},
                                        {"magY", 23, 16, motorola_signed, 0x1p-10, 0, "-magnetic_field_y_au"},
                                        {"magZ", 39, 16, motorola_signed, 0x1p-10, 0, "-magnetic_field_z_au"}};
constexpr CanSignal temperature[] = {{"Temperature", 7, 16, motorola_signed, temperature_lsb, 0, "temperature_c"}};
constexpr CanSignal pressure[] = {{"Pressure", 7, 32, motorola_unsigned, 0x1p-15, 0, "pressure_pa"}};
constexpr CanSignal rate_hr[] = {{"HrGyrX", 7, 16, motorola_signed, rate_lsb, 0, "rate_x_rad_per_s"},
                                 {"HrGyrY", 23, 16, motorola_signed, rate_lsb, 0, "-rate_y_rad_per_s"},
                                 {"HrGyrZ", 39, 16, motorola_signed, rate_lsb, 0, "-rate_z_rad_per_s"}};
constexpr CanSignal acceleration_hr[] = {
    {"HrAccX", 7, 16, motorola_signed, force_lsb, 0, "specific_force_x_m_per_s2"},
    {"HrAccY", 23, 16, motorola_signed, force_lsb, 0, "-specific_force_y_m_per_s2"},
    {"HrAccZ", 39, 16, motorola_signed, force_lsb, 0, "-specific_force_z_m_per_s2"}};
constexpr CanSignal position[] = {{"latitude", 7, 32, motorola_signed, 0x1p-24, 0, "latitude_deg"},
                                  {"longitude", 39, 32, motorola_signed, 0x1p-23, 0, "longitude_deg"}};
constexpr CanSignal altitude[] = {{"altEllipsoid", 7, 32, motorola_signed, 0x1p-15, 0, "height_m"}};
constexpr CanSignal velocity[] = {{"velX", 7, 16, motorola_signed, 0x1p-6, 0, "velocity_east_m_per_s"},
                                  {"velY", 23, 16, motorola_signed, 0x1p-6, 0, "velocity_north_m_per_s"},
                                  {"velZ", 39, 16, motorola_signed, 0x1p-6, 0, "-velocity_down_m_per_s"}};

constexpr SignalProductMessage messages[] = {
    {"sample_time", 0x05, 4, sample_time},
    {"group_counter", 0x06, 2, group_counter},
    {"utc", 0x07, 8, utc},
    {"status_word", 0x11, 4, status_signals},
    {"quaternion", 0x21, 8, quaternion},
    {"quaternion_ned", 0x21, 8, quaternion_ned},
    {"euler", 0x22, 6, euler},
    {"euler_ned", 0x22, 6, euler_ned},
    {"delta_v", 0x31, 7, delta_v},
    {"rate_of_turn", 0x32, 6, rate_of_turn},
    {"delta_q", 0x33, 8, delta_q},
    {"acceleration", 0x34, 6, acceleration},
    {"free_acceleration", 0x35, 6, free_acceleration},
    {"magnetic_field", 0x41, 6, magnetic_field},
    {"temperature", 0x51, 2, temperature},
    {"pressure", 0x52, 4, pressure},
    {"rate_of_turn_hr", 0x61, 6, rate_hr},
    {"acceleration_hr", 0x62, 6, acceleration_hr},
    {"position", 0x71, 8, position},
    {"altitude", 0x72, 4, altitude},
    {"velocity", 0x76, 6, velocity},
};
// MTi-600: 2000 deg/s, 0.007 deg/s/sqrt(Hz); 10 g, 60 ug/sqrt(Hz); from memory of the data sheet.
constexpr SignalProduct xsens_can_table = {.messages = messages,
                                           .has_choice = true,
                                           .gyro_noise = 0.007 * units::degree,
                                           .gyro_max = 2000 * units::degree,
                                           .accelerometer_noise = 60e-6 * units::standard_gravity,
                                           .accelerometer_max = 10 * units::standard_gravity};

constexpr std::string_view delivered[] = {"sample_time", "group_counter", "utc",          "status_word",
                                          "quaternion",  "rate_of_turn",  "acceleration", "temperature"};
constexpr Setting settings[] = {output_rate_setting(100, 2000), messages_setting(delivered), identifiers_setting(),
                                id_offset_setting(), extended_setting()};

}  // namespace

extern constexpr Protocol xsens_can_protocol = signal_protocol<xsens_can_table>({
    .name = "xsens-can",
    .summary = "Xsens MTi-600 series on CAN: inertial data, increments, attitude, position, UTC",
    .document = "Xsens_MTi_CAN_ROS_Driver, config/xsens.dbc and xsens_parser.cpp",
    .settings = settings,
    .fields = Measurement::all & ~(Measurement::delta_angle | Measurement::delta_velocity),
    .resolution = {.time_s = 1e-4, .rate = rate_lsb, .specific_force = force_lsb, .temperature_c = temperature_lsb},
    .range = {.rate = 32767 * rate_lsb,
              .specific_force = 32767 * force_lsb,
              .temperature_c = 32767 * temperature_lsb},
    .time_period_ns = (std::int64_t{1} << 32) * 100'000,
    .counter_bits = 16,
    .status_bits = 0x3F | status::self_test_failed,
    .has_self_test = true,
    .preset = [](const Settings&) -> std::string_view { return "mti-630"; },
    .solves = [](const Settings&) { return Solves::attitude; },
    .make = by_table,
    .make_decoder = by_table,
});

}  // namespace imud
