// The fields of the filter and of the receiver, which report the truth.
#include <chrono>

#include "core/earth.hpp"
#include "core/elementary.hpp"
#include "core/units.hpp"
#include "protocols/mip/mip.hpp"

namespace imud::mip {

namespace {

void put_utc(Packet& packet, std::int64_t gps_ns, std::uint16_t flags) noexcept {
  constexpr std::int64_t gps_began_s = 315'964'800, leap_s = 18, day_ms = 86'400'000;
  const std::int64_t utc_ms = gps_ns / 1'000'000 + (gps_began_s - leap_s) * 1000, of_day = utc_ms % day_ms;
  const std::chrono::year_month_day date(std::chrono::sys_days(std::chrono::days(utc_ms / day_ms)));
  packet.put(static_cast<std::uint16_t>(static_cast<int>(date.year())));
  packet.put(static_cast<std::uint8_t>(static_cast<unsigned>(date.month())));
  packet.put(static_cast<std::uint8_t>(static_cast<unsigned>(date.day())));
  packet.put(static_cast<std::uint8_t>(of_day / 3'600'000));
  packet.put(static_cast<std::uint8_t>(of_day / 60'000 % 60));
  packet.put(static_cast<std::uint8_t>(of_day / 1000 % 60));
  packet.put(static_cast<std::uint32_t>(of_day % 1000));
  packet.put(flags);
}

}  // namespace

void Fields::put_filter(Packet& packet, std::uint8_t descriptor, DeviceTime at) const noexcept {
  const Navigation& navigation = sample_.navigation;
  if (descriptor == 0x10) return put_filter_status(packet);
  std::uint16_t valid = 1;
  switch (descriptor) {
    case 0x01:
      put_position(packet);
      valid = is_known();
      break;
    case 0x02:
      packet.put_floats(navigation.v_L);
      valid = is_known();
      break;
    case 0x03:
      put_quaternion(packet);
      break;
    case 0x04: {  // row by row, from L to V
      const Matrix3 dcm_VL = sample_.q_LP.conjugate().toRotationMatrix();
      for (int row = 0; row < 3; ++row) packet.put_floats(dcm_VL.row(row).transpose());
      break;
    }
    case 0x05:
      put_euler(packet);
      break;
    case 0x0D:
      packet.put_floats(sample_.specific_force + gravity());
      break;
    case 0x0E:
      packet.put_floats(sample_.rate);
      break;
    case 0x11:
      put_gps_time(packet, gps_ns(at));
      valid = has_time_of_week() && has_week();
      break;
    case 0x13:
      packet.put_floats(gravity());
      break;
    case 0x1C:
      packet.put_floats(sample_.specific_force);
      break;
    default:
      packet.put_doubles(navigation.r_E);
      valid = is_known();
      break;
  }
  packet.put(valid);
}

// Writes state, dynamics mode and flags. A GX5 is in state 1, initializing, without position and velocity, else in 2,
// running and valid. A CV7 is in state 3, AHRS, or 4, full navigation; its flags are 1, stable (from memory of the
// GQ7's manual).
void Fields::put_filter_status(Packet& packet) const noexcept {
  const bool navigates = memory_.model().is(ins) && is_known();
  const bool waits = memory_.model().is(gx5_45) && !navigates;
  packet.put(static_cast<std::uint16_t>(memory_.model().is(cv7) ? (navigates ? 4 : 3) : (waits ? 1 : 2)));
  packet.put(std::uint16_t{memory_.active().first_of(filter_command, 0x10).bytes[0]});
  packet.put(static_cast<std::uint16_t>(memory_.model().is(cv7) ? 1 : (waits ? 0x2000 : 0)));
}

// The receiver reports the truth. It reports no accuracy, and leaves the flags of accuracies unset.
void Fields::put_gnss(Packet& packet, std::uint8_t descriptor, DeviceTime at) const noexcept {
  const Navigation& navigation = sample_.navigation;
  const Vector3& v = navigation.v_L;
  const auto if_known = [&](int flags) { return static_cast<std::uint16_t>(is_known() ? flags : 0); };
  switch (descriptor) {
    case 0x03:
      put_position(packet);
      packet.put(navigation.height);  // in place of the height above mean sea level, which is flagged as invalid
      for (int i = 0; i < 2; ++i) packet.put(0.0F);
      packet.put(if_known(0x03));
      break;
    case 0x04:
      packet.put_doubles(navigation.r_E);
      packet.put(0.0F);
      packet.put(if_known(0x01));
      break;
    case 0x05: {
      const double course = elementary::atan2(v.y(), v.x()) / units::degree;
      packet.put_floats(v);
      packet.put_float(v.norm());
      packet.put_float(v.head<2>().norm());
      packet.put_float(course < 0 ? course + 360 : course);
      for (int i = 0; i < 2; ++i) packet.put(0.0F);
      packet.put(if_known(0x0F));
      break;
    }
    case 0x07:  // under an open sky: geometric, position, horizontal, vertical, time, north, east
      for (const float dop : {1.65F, 1.44F, 0.80F, 1.20F, 0.80F, 0.57F, 0.57F}) packet.put(is_known() ? dop : 99.99F);
      packet.put(if_known(0x7F));
      break;
    case 0x08:
      put_utc(packet, true_gps_ns(at), if_known(0x03));
      break;
    case 0x09:
      put_gps_time(packet, true_gps_ns(at));
      packet.put(if_known(0x03));
      break;
    case 0x0B:  // 3D or none
      packet.put(static_cast<std::uint8_t>(is_known() ? 0 : 3));
      packet.put(static_cast<std::uint8_t>(is_known() ? 12 : 0));
      packet.put(std::uint16_t{0});
      packet.put(std::uint16_t{0x07});
      break;
    default:  // on; antenna good, powered
      for (const int state : {1, 4, 1}) packet.put(static_cast<std::uint8_t>(state));
      packet.put(std::uint16_t{0x07});
      break;
  }
}

void Fields::put_position(Packet& packet) const noexcept {
  packet.put(sample_.navigation.latitude / units::degree);
  packet.put(sample_.navigation.longitude / units::degree);
  packet.put(sample_.navigation.height);
}

Vector3 Fields::gravity() const noexcept {
  const double g =
      is_known() ? normal_gravity(sample_.navigation.latitude, sample_.navigation.height) : units::standard_gravity;
  return sample_.q_LP.conjugate() * Vector3(0, 0, g);
}

}  // namespace imud::mip
