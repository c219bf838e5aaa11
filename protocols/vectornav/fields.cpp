// What messages and binary fields say. Attitude, position and velocity are the truth's; of GNSS solutions the quality
// is made up, as the numbers below say.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <utility>

#include "core/attitude.hpp"
#include "core/earth.hpp"
#include "core/units.hpp"
#include "protocols/vectornav/vectornav.hpp"

namespace imud::vectornav {

namespace {

constexpr std::uint8_t satellites = 12, fix_3d = 3;
constexpr double position_error_m = 1.0, velocity_error_m_per_s = 0.05, time_error_s = 2e-8, dilution = 1.0,
                 attitude_error_deg = 0.5;
constexpr int leap_seconds = 18;
constexpr double gauss = 1e-4, kilopascal = 1e3;
constexpr std::int64_t week_ns = 604'800'000'000'000;

constexpr const char *angle = "%+08.3f", *field = "%+08.4f", *acceleration = "%+07.3f", *rate = "%+010.6f",
                     *quaternion = "%+09.6f", *metres = "%+010.3f", *speed = "%+08.3f";

struct Message1 {
  unsigned type;
  std::string_view name;
  unsigned register_id;  // that says the same; 0: none
  unsigned receivers;    // that a model with this message has
  std::size_t size;
};
constexpr Message1 messages[] = {
    {1, "VNYPR", 8, 0, 38},    {2, "VNQTN", 9, 0, 51},    {8, "VNQMR", 15, 0, 135},   {10, "VNMAG", 17, 0, 38},
    {11, "VNACC", 18, 0, 35},  {12, "VNGYR", 19, 0, 44},  {13, "VNMAR", 20, 0, 95},   {14, "VNYMR", 27, 0, 122},
    {16, "VNYBA", 239, 0, 95}, {17, "VNYIA", 240, 0, 95}, {19, "VNIMU", 54, 0, 110},  {20, "VNGPS", 58, 1, 145},
    {21, "VNGPE", 59, 1, 146}, {22, "VNINS", 63, 1, 142}, {23, "VNINE", 64, 1, 143},  {28, "VNISL", 72, 1, 160},
    {29, "VNISE", 73, 1, 161}, {30, "VNDTV", 80, 0, 75},  {32, "VNG2S", 103, 2, 145}, {33, "VNG2E", 104, 2, 146},
};

// The quantities that several messages and fields give.
class Quantities {
 public:
  explicit Quantities(const Reading& reading) noexcept
      : r_(reading), s_(reading.sample), navigation_(reading.sample.navigation) {}

  const Quaternion& q() const noexcept { return s_.q_LP; }
  Quaternion tared_q() const noexcept { return r_.tare * s_.q_LP; }
  Vector3 ypr_deg() const noexcept {
    return yaw_pitch_roll_from_dcm(tared_q().conjugate().toRotationMatrix()) / units::degree;
  }
  Vector3 magnetic(const Sample& sample) const noexcept { return sample.magnetic_field / gauss; }
  double pressure_kpa() const noexcept { return s_.pressure / kilopascal; }
  // The specific force of a true vertical of standard gravity taken away.
  Vector3 linear_L() const noexcept { return q() * s_.specific_force + Vector3(0, 0, units::standard_gravity); }
  Vector3 linear_P() const noexcept { return q().conjugate() * linear_L(); }

  bool has_fix() const noexcept { return r_.model.receivers > 0 && navigation_.is_known; }
  Vector3 lla() const noexcept {
    return has_fix() ? Vector3(navigation_.latitude / units::degree, navigation_.longitude / units::degree,
                               navigation_.height)
                     : Vector3(Vector3::Zero());
  }
  Vector3 r_E() const noexcept { return has_fix() ? navigation_.r_E : Vector3(Vector3::Zero()); }
  Vector3 v_L() const noexcept { return has_fix() ? navigation_.v_L : Vector3(Vector3::Zero()); }
  Vector3 to_E(const Vector3& v_L) const noexcept {
    return has_fix() ? Vector3(dcm_EL(navigation_.latitude, navigation_.longitude) * v_L) : Vector3(Vector3::Zero());
  }
  std::int64_t gps_ns() const noexcept { return has_fix() ? navigation_.gps_ns + r_.age.count() : 0; }
  std::uint16_t week() const noexcept { return static_cast<std::uint16_t>(gps_ns() / week_ns); }
  double time_of_week_s() const noexcept { return 1e-9 * static_cast<double>(gps_ns() % week_ns); }
  // Mode 2 (tracking) and the fix; a VN-300's heading by two antennas (vnproglib, InsStatus).
  std::uint16_t ins_status() const noexcept {
    if (!has_fix()) return 0;
    return r_.model.receivers == 2 ? 0x0306 : 0x0006;
  }
  Vector3 accuracy(double each) const noexcept {
    return has_fix() ? Vector3::Constant(each) : Vector3(Vector3::Zero());
  }

 private:
  const Reading& r_;
  const Sample& s_;
  const Navigation& navigation_;
};

using Frame8 = FrameWriter<boost::endian::order::little>;

void put_utc(std::int64_t gps_ns, Frame8& frame) noexcept {
  if (gps_ns == 0) return;
  namespace chrono = std::chrono;
  constexpr chrono::sys_days gps_began{chrono::year(1980) / chrono::January / 6};
  const auto utc = gps_began + Nanoseconds(gps_ns) - chrono::seconds(leap_seconds);
  const auto day = chrono::floor<chrono::days>(utc);
  const chrono::year_month_day date{day};
  const chrono::hh_mm_ss time{chrono::floor<chrono::milliseconds>(utc - day)};
  frame.put(static_cast<std::int8_t>(static_cast<int>(date.year()) - 2000));
  frame.put(static_cast<std::uint8_t>(static_cast<unsigned>(date.month())));
  frame.put(static_cast<std::uint8_t>(static_cast<unsigned>(date.day())));
  frame.put(static_cast<std::uint8_t>(time.hours().count()));
  frame.put(static_cast<std::uint8_t>(time.minutes().count()));
  frame.put(static_cast<std::uint8_t>(time.seconds().count()));
  frame.put(static_cast<std::uint16_t>(time.subseconds().count()));
}

void put_gnss(unsigned receiver, unsigned bit, const Reading& reading, Frame8& frame) noexcept {
  const Quantities now(reading);
  if (!now.has_fix() || receiver > reading.model.receivers) return;
  switch (bit) {
    case 0:
      return put_utc(now.gps_ns(), frame);
    case 1:
      return frame.put(static_cast<std::uint64_t>(now.gps_ns() % week_ns));
    case 2:
      return frame.put(now.week());
    case 3:
      return frame.put(satellites);
    case 4:
      return frame.put(fix_3d);
    case 5:
      return frame.put_doubles(now.lla());
    case 6:
      return frame.put_doubles(now.r_E());
    case 7:
      return frame.put_floats(now.v_L());
    case 8:
      return frame.put_floats(now.to_E(now.v_L()));
    case 9:
      return frame.put_floats(now.accuracy(position_error_m));
    case 10:
      return frame.put_float(velocity_error_m_per_s);
    case 11:
      return frame.put_float(time_error_s);
    case 12:
      frame.put(std::uint8_t{7});  // time, date and UTC are good
      return frame.put(static_cast<std::int8_t>(leap_seconds));
    case 13:
      for (int i = 0; i < 7; ++i) frame.put_float(dilution);
      return;
    default:
      return;
  }
}

}  // namespace

std::string_view name_of(unsigned type, const Model& model) noexcept {
  for (const Message1& message : messages)
    if (message.type == type && message.receivers <= model.receivers) return message.name;
  return "";
}

std::size_t size_of(unsigned type) noexcept {
  for (const Message1& message : messages)
    if (message.type == type) return message.size;
  return 0;
}

unsigned type_of_register(unsigned id) noexcept {
  for (const Message1& message : messages)
    if (message.register_id == id && id != 0) return message.type;
  return 0;
}

void put_measurement(unsigned type, const Reading& reading, Sums& sums, Message& message) noexcept {
  const Quantities now(reading);
  const Sample& s = reading.sample;
  const auto put_q = [&] {
    const Quaternion q = now.tared_q();
    for (const double part : {q.x(), q.y(), q.z(), q.w()}) message.put(part, quaternion);
  };
  const auto put_field = [&] { message.put(now.magnetic(s), field); };
  const auto put_inertial = [&] { message.put(s.specific_force, acceleration).put(s.rate, rate); };
  const auto put_lla = [&] {
    message.put(now.lla()[0], "%+012.8f").put(now.lla()[1], "%+013.8f").put(now.lla()[2], metres);
  };
  const auto put_time = [&] { message.put(now.time_of_week_s(), "%013.6f").put(now.week(), "%04.0f"); };
  const auto put_gnss_text = [&](bool geodetic) {
    put_time();
    message.put(now.has_fix() ? fix_3d : 0, "%.0f").put(now.has_fix() ? satellites : 0, "%02.0f");
    if (geodetic)
      put_lla();
    else
      message.put(now.r_E(), "%+012.3f");
    message.put(geodetic ? now.v_L() : now.to_E(now.v_L()), speed).put(now.accuracy(position_error_m), speed);
    message.put(now.accuracy(velocity_error_m_per_s)[0], speed).put(now.accuracy(time_error_s)[0], "%.2E");
  };
  const auto put_ins_text = [&](bool geodetic) {
    put_time();
    std::array<char, 8> status;
    std::snprintf(status.data(), status.size(), ",%04X", static_cast<unsigned>(now.ins_status()));
    message.put(status.data()).put(now.ypr_deg(), angle);
    if (geodetic)
      put_lla();
    else
      message.put(now.r_E(), "%+012.3f");
    message.put(geodetic ? now.v_L() : now.to_E(now.v_L()), speed);
    message.put(now.accuracy(attitude_error_deg)[0], "%04.1f").put(now.accuracy(position_error_m)[0], "%04.1f");
    message.put(now.accuracy(velocity_error_m_per_s)[0], "%04.2f");
  };
  switch (type) {
    case 1:
      message.put(now.ypr_deg(), angle);
      break;
    case 2:
      put_q();
      break;
    case 8:
      put_q();
      put_field();
      put_inertial();
      break;
    case 10:
      put_field();
      break;
    case 11:
      message.put(s.specific_force, acceleration);
      break;
    case 12:
      message.put(s.rate, rate);
      break;
    case 13:
      put_field();
      put_inertial();
      break;
    case 14:
      message.put(now.ypr_deg(), angle);
      put_field();
      put_inertial();
      break;
    case 16:
      message.put(now.ypr_deg(), angle).put(now.linear_P(), acceleration).put(s.rate, rate);
      break;
    case 17:
      message.put(now.ypr_deg(), angle).put(now.linear_L(), acceleration).put(s.rate, rate);
      break;
    case 19:
      message.put(now.magnetic(reading.raw), field)
          .put(reading.raw.specific_force, acceleration)
          .put(reading.raw.rate, rate);
      message.put(s.temperature_c, "%+05.1f").put(now.pressure_kpa(), "%+08.3f");
      break;
    case 20:
    case 32:
      put_gnss_text(true);
      break;
    case 21:
    case 33:
      put_gnss_text(false);
      break;
    case 22:
      put_ins_text(true);
      break;
    case 23:
      put_ins_text(false);
      break;
    case 28:
      message.put(now.ypr_deg(), angle);
      put_lla();
      message.put(now.v_L(), speed);
      put_inertial();
      break;
    case 29:
      message.put(now.ypr_deg(), angle).put(now.r_E(), "%+012.3f").put(now.to_E(now.v_L()), speed);
      put_inertial();
      break;
    case 30: {
      const Sums since = std::exchange(sums, {});
      message.put(since.dt, "%+09.6f").put(Vector3(since.delta_angle / units::degree), "%+08.3f");
      message.put(since.delta_velocity, speed);
      break;
    }
    default:
      break;
  }
}

void put_appended(double count_mode, double status_mode, const Reading& reading, Message& message) noexcept {
  if (status_mode != 0) {
    std::array<char, 8> status;
    const unsigned bits = status_mode == 2 ? Quantities(reading).ins_status() : 0U;
    std::snprintf(status.data(), status.size(), ",S%04X", bits & 0xFFFFU);
    message.put(status.data());
  }
  if (count_mode != 0) message.put(",T0");  // nothing is connected to SyncIn, SyncOut and PPS
}

void put_field(unsigned group, unsigned bit, const Reading& reading, const Sums& sums, Frame8& frame) noexcept {
  const Quantities now(reading);
  const Sample &s = reading.sample, &raw = reading.raw;
  const Quaternion& q = now.q();
  const auto put_q = [&] {
    const Quaternion tared = now.tared_q();
    for (const double part : {tared.x(), tared.y(), tared.z(), tared.w()}) frame.put_float(part);
  };
  const auto put_delta_angle = [&] {
    frame.put_float(sums.dt);
    frame.put_floats(sums.delta_angle / units::degree);
  };
  if (group == gnss1 || group == gnss2) return put_gnss(group == gnss1 ? 1 : 2, bit, reading, frame);
  switch (group << 4 | bit) {
    case common << 4 | 0:
    case time_group << 4 | 0:
      return frame.put(static_cast<std::uint64_t>(reading.since_start.count()));
    case common << 4 | 1:
    case time_group << 4 | 1:
      return frame.put(static_cast<std::uint64_t>(now.gps_ns()));
    case common << 4 | 3:
    case attitude << 4 | 1:
      return frame.put_floats(now.ypr_deg());
    case common << 4 | 4:
    case attitude << 4 | 2:
      return put_q();
    case common << 4 | 5:
    case imu << 4 | 10:
      return frame.put_floats(s.rate);
    case common << 4 | 6:
    case ins << 4 | 1:
      return frame.put_doubles(now.lla());
    case common << 4 | 7:
    case ins << 4 | 4:
      return frame.put_floats(now.v_L());
    case common << 4 | 8:
    case imu << 4 | 9:
      return frame.put_floats(s.specific_force);
    case common << 4 | 9:
      frame.put_floats(raw.specific_force);
      return frame.put_floats(raw.rate);
    case common << 4 | 10:
      frame.put_floats(now.magnetic(s));
      frame.put_float(s.temperature_c);
      return frame.put_float(now.pressure_kpa());
    case common << 4 | 11:
      put_delta_angle();
      return frame.put_floats(sums.delta_velocity);
    case common << 4 | 12:
    case ins << 4 | 0:
      return frame.put(now.ins_status());
    case time_group << 4 | 2:
      return frame.put(static_cast<std::uint64_t>(now.gps_ns() % week_ns));
    case time_group << 4 | 3:
      return frame.put(now.week());
    case time_group << 4 | 6:
      return put_utc(now.gps_ns(), frame);
    case time_group << 4 | 9:
      return frame.put(static_cast<std::uint8_t>(now.has_fix() ? 7 : 0));
    case imu << 4 | 1:
      return frame.put_floats(now.magnetic(raw));
    case imu << 4 | 2:
      return frame.put_floats(raw.specific_force);
    case imu << 4 | 3:
      return frame.put_floats(raw.rate);
    case imu << 4 | 4:
      return frame.put_float(s.temperature_c);
    case imu << 4 | 5:
      return frame.put_float(now.pressure_kpa());
    case imu << 4 | 6:
      return put_delta_angle();
    case imu << 4 | 7:
      return frame.put_floats(sums.delta_velocity);
    case imu << 4 | 8:
      return frame.put_floats(now.magnetic(s));
    case imu << 4 | 11:
      return frame.put(static_cast<std::uint16_t>((s.status >> 3 & 7U) << 3 | (s.status & 7U) << 6));
    case imu << 4 | 12:
      frame.put_floats(now.magnetic(raw));
      frame.put_floats(raw.specific_force);
      frame.put_floats(raw.rate);
      return frame.put_float(s.temperature_c);
    case attitude << 4 | 3: {
      const Matrix3 dcm_PL = now.tared_q().conjugate().toRotationMatrix();  // in column-major order
      for (int column = 0; column < 3; ++column) frame.put_floats(dcm_PL.col(column));
      return;
    }
    case attitude << 4 | 4:
      return frame.put_floats(q * now.magnetic(s));
    case attitude << 4 | 5:
      return frame.put_floats(q * s.specific_force);
    case attitude << 4 | 6:
      return frame.put_floats(now.linear_P());
    case attitude << 4 | 7:
      return frame.put_floats(now.linear_L());
    case attitude << 4 | 8:
      return frame.put_floats(Vector3::Constant(attitude_error_deg));
    case ins << 4 | 2:
      return frame.put_doubles(now.r_E());
    case ins << 4 | 3:
      return frame.put_floats(q.conjugate() * now.v_L());
    case ins << 4 | 5:
      return frame.put_floats(now.to_E(now.v_L()));
    case ins << 4 | 6:
      return frame.put_floats(now.to_E(q * now.magnetic(s)));
    case ins << 4 | 7:
      return frame.put_floats(now.to_E(q * s.specific_force));
    case ins << 4 | 8:
      return frame.put_floats(now.to_E(now.linear_L()));
    case ins << 4 | 9:
      return frame.put_float(now.accuracy(position_error_m)[0]);
    case ins << 4 | 10:
      return frame.put_float(now.accuracy(velocity_error_m_per_s)[0]);
    default:
      return;
  }
}

}  // namespace imud::vectornav
