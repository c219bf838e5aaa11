// Quantities: the quantities that VectorNav's messages (messages.cpp) and binary fields (fields.cpp) report, in the
// product's units. Attitude, position and velocity come from the sample. Their accuracies are the standard deviations
// computed by the unit's filter, if it has a solution; otherwise the standard deviations of the modelled errors, or
// the constants below if there are no errors. While the filter aligns, position and velocity are the receiver's.
#pragma once

#include <cmath>
#include <cstdint>

#include "core/attitude.hpp"
#include "core/earth/earth.hpp"
#include "core/gps_time.hpp"
#include "core/units.hpp"
#include "protocols/vectornav/ins_mode.hpp"
#include "protocols/vectornav/vectornav.hpp"

namespace imud::vectornav {

// A view of a reading and of the increments of an output, both of which must outlive it. Without a fix, all GNSS
// quantities are zero.
class Quantities {
 public:
  Quantities(const Reading& reading, const Sums& sums) noexcept
      : Quantities(reading, sums, reading.sample.timed(), reading.sample.solution.has_value(), reading.age) {}
  // Returns the quantities with place and accuracies of the receiver. The GPS time is the time of its fix: "Available
  // at 5 Hz only" (VN-200 user manual UM004, page 44, whose example is at a multiple of 0.2 s).
  static Quantities of_receiver(const Reading& reading, const Sums& sums) noexcept {
    const Sample& sample = reading.sample;
    const bool has_epochs = sample.solution && sample.solution->has_epochs;
    return {reading, sums, sample.fix(), false, has_epochs ? -sample.fix_age() : reading.age};
  }

  // --- Time ---
  std::uint64_t since_start_ns() const noexcept { return static_cast<std::uint64_t>(r_.since_start.count()); }
  std::uint64_t gps_ns() const noexcept {
    const Navigation& known = navigation_.is_known ? navigation_ : s_.fix();
    return knows_time() ? static_cast<std::uint64_t>(known.gps_ns + since_sample_.count()) : 0;
  }
  std::uint16_t week() const noexcept { return static_cast<std::uint16_t>(gps_ns() / week_ns); }
  std::uint64_t time_of_week_ns() const noexcept { return gps_ns() % week_ns; }
  double time_of_week_s() const noexcept { return 1e-9 * static_cast<double>(time_of_week_ns()); }
  std::uint8_t time_status() const noexcept { return knows_time() ? 7 : 0; }  // time, date and UTC are valid
  std::uint64_t since_sync_in_ns() const noexcept { return static_cast<std::uint64_t>(r_.sync.since_in.count()); }
  std::uint32_t since_sync_in_us() const noexcept { return static_cast<std::uint32_t>(since_sync_in_ns() / 1000); }
  std::uint64_t since_pulse_ns() const noexcept { return static_cast<std::uint64_t>(r_.sync.since_pulse.count()); }
  std::uint32_t since_pulse_us() const noexcept { return static_cast<std::uint32_t>(since_pulse_ns() / 1000); }
  std::uint32_t sync_in_count() const noexcept { return r_.sync.in_count; }
  std::uint32_t sync_out_count() const noexcept { return r_.sync.out_count; }

  // --- Inertial and other sensors; `raw`: not compensated ---
  // Less the biases that the filter has estimated (VN-100 user manual UM001 2.22, page 42).
  Vector3 acceleration() const noexcept { return s_.specific_force; }  // m/s^2
  Vector3 rate() const noexcept { return s_.rate; }                    // rad/s
  Vector3 magnetic() const noexcept { return s_.magnetic_field / units::gauss; }
  Vector3 raw_acceleration() const noexcept { return r_.raw.specific_force; }
  Vector3 raw_rate() const noexcept { return r_.raw.rate; }
  Vector3 raw_magnetic() const noexcept { return r_.raw.magnetic_field / units::gauss; }
  double temperature_c() const noexcept { return s_.temperature_c; }
  double pressure_kpa() const noexcept { return s_.pressure / 1e3; }
  double dt() const noexcept { return sums_.dt; }  // s
  Vector3 delta_angle_deg() const noexcept { return sums_.delta_angle.vector() / units::degree; }
  Vector3 delta_velocity() const noexcept { return sums_.delta_velocity.vector(); }  // m/s
  std::uint16_t saturation() const noexcept {
    return static_cast<std::uint16_t>((s_.status >> 3 & 7U) << 3 | (s_.status & 7U) << 6);
  }

  // The status of the attitude filter (UM001 2.22, pages 49 and 50). Without a filter of the unit's own it is 0.
  // Otherwise it has quality 3 (not tracking) until there is an attitude, and the bits of saturated gyros and
  // accelerometers. Qualities 1 and 2 are not sent: no document states their limits.
  std::uint16_t vpe_status() const noexcept {
    if (!s_.solution) return 0;
    constexpr unsigned not_tracking = 3, gyro_bit = 1U << 2, accelerometer_bit = 1U << 9;
    const unsigned quality = s_.solution->state == Solution::State::aligning ? not_tracking : 0;
    return static_cast<std::uint16_t>(quality | ((s_.status & 7U) != 0 ? gyro_bit : 0) |
                                      ((s_.status >> 3 & 7U) != 0 ? accelerometer_bit : 0));
  }

  // --- Attitude; only tared_q(), tared_ypr_deg() and ypr_error_deg() include the tare ---
  Quaternion tared_q() const noexcept { return r_.tare * s_.q_LP; }
  Vector3 tared_ypr_deg() const noexcept {
    return yaw_pitch_roll_from_dcm(tared_q().conjugate().toRotationMatrix()) / units::degree;
  }
  Vector3 ypr_error_deg() const noexcept {
    if (is_filter_) {
      const Matrix3 tare = r_.tare.toRotationMatrix();
      const Vector3 variance = tare.cwiseAbs2() * s_.solution->attitude.cast<double>().cwiseAbs2();
      return roll_pitch_yaw_deviations(tared_q(), variance.cwiseSqrt()).reverse() / units::degree;
    }
    return figure_or(r_.figures.attitude.reverse() / units::degree, Vector3::Constant(attitude_error_deg));
  }
  Vector3 magnetic_L() const noexcept { return s_.q_LP * magnetic(); }
  Vector3 acceleration_L() const noexcept { return s_.q_LP * s_.specific_force; }
  // The specific force, less the specific force at rest in standard gravity.
  Vector3 linear_L() const noexcept { return acceleration_L() + Vector3(0, 0, units::standard_gravity); }
  Vector3 linear_P() const noexcept { return s_.q_LP.conjugate() * linear_L(); }

  // --- Position and velocity ---
  bool has_fix() const noexcept { return r_.model.receivers > 0 && navigation_.is_known; }
  bool has_receiver(unsigned number) const noexcept { return number <= r_.model.receivers; }
  std::uint8_t satellites() const noexcept {
    return static_cast<std::uint8_t>(has_fix() ? navigation_.satellites : 0);
  }
  std::uint8_t fix() const noexcept { return has_fix() ? 3 : 0; }  // 3D
  // Latitude and longitude in degrees, height in metres.
  Vector3 lla() const noexcept {
    return if_fixed(
        {navigation_.latitude / units::degree, navigation_.longitude / units::degree, navigation_.height});
  }
  Vector3 r_E() const noexcept { return if_fixed(navigation_.r_E); }
  Vector3 v_L() const noexcept { return if_fixed(navigation_.v_L); }
  Vector3 v_P() const noexcept { return s_.q_LP.conjugate() * v_L(); }
  Vector3 v_E() const noexcept { return to_E(v_L()); }
  Vector3 magnetic_E() const noexcept { return to_E(magnetic_L()); }
  Vector3 acceleration_E() const noexcept { return to_E(acceleration_L()); }
  Vector3 linear_E() const noexcept { return to_E(linear_L()); }
  // The mode and the bit of a fix. A VN-300 also has the bits of its two antennas. Where the receivers measure a
  // heading (Sample::antennas()), the compass works while there is one. The bit of its aid is set while the filter
  // uses it, or, without a filter, while it works. Otherwise the compass works with a fix, and its heading aids a
  // filter that is aligned.
  std::uint16_t ins_status() const noexcept {
    constexpr unsigned fix_bit = 0x0004, heading_bit = 0x0100, compass_bit = 0x0200;
    const bool is_fixed = r_.model.receivers > 0 && s_.fix().is_known;
    unsigned bits = static_cast<unsigned>(mode());
    if (is_fixed) bits |= fix_bit;
    if (!is_fixed || r_.model.receivers < 2) return static_cast<std::uint16_t>(bits);
    const bool measures = s_.fix().antennas.sigma > 0, has_heading = !measures || s_.antennas() != nullptr;
    if (has_heading) bits |= compass_bit;
    const bool is_used = measures && s_.solution ? (s_.solution->used & aid::antennas_heading) != 0
                                                 : has_heading && (!is_filter_ || is_filters_place());
    if (is_used) bits |= heading_bit;
    return static_cast<std::uint16_t>(bits);
  }
  Vector3 position_errors_m() const noexcept {
    if (is_filters_place()) return if_fixed(s_.solution->position.cast<double>());
    return if_fixed(double{navigation_.accuracy_factor} *
                    figure_or(r_.figures.position, Vector3::Constant(position_error)));
  }
  double position_error_m() const noexcept {
    if (is_filters_place()) return has_fix() ? rms(s_.solution->position.cast<double>()) : 0;
    return has_fix() ? double{navigation_.accuracy_factor} * figure_or(rms(r_.figures.position), position_error) : 0;
  }
  double velocity_error_m_per_s() const noexcept {
    if (is_filters_place()) return has_fix() ? rms(s_.solution->velocity.cast<double>()) : 0;
    return has_fix() ? double{navigation_.accuracy_factor} * figure_or(rms(r_.figures.velocity), 0.05) : 0;
  }
  // Without an almanac all are 1.
  const Dilution& dilution() const noexcept {
    static constexpr Dilution ones = {1, 1, 1, 1, 1, 1, 1};
    return navigation_.dilution.known_or(ones);
  }
  double time_error_s() const noexcept { return knows_time() ? 2e-8 : 0; }
  double ins_attitude_error_deg() const noexcept {
    if (is_filter_) return has_fix() ? rms(s_.solution->attitude.cast<double>()) / units::degree : 0;
    return has_fix() ? figure_or(rms(r_.figures.attitude) / units::degree, attitude_error_deg) : 0;
  }

 private:
  Quantities(const Reading& reading, const Sums& sums, const Navigation& navigation, bool is_filter,
             Nanoseconds since_sample) noexcept
      : r_(reading),
        s_(reading.sample),
        navigation_(navigation),
        sums_(sums),
        since_sample_(since_sample),
        is_filter_(is_filter) {}

  bool is_filters_place() const noexcept { return is_filter_ && s_.navigation.is_known; }
  // Returns whether the time is known: from the receiver or, after its last fix, from the filter.
  bool knows_time() const noexcept { return r_.model.receivers > 0 && (navigation_.is_known || s_.fix().is_known); }
  InsMode mode() const noexcept {
    if (r_.model.receivers == 0 || !is_filter_) return has_fix() ? InsMode::tracking : InsMode::not_tracking;
    return ins_mode(*s_.solution, s_.fix().is_known);
  }

  static constexpr double attitude_error_deg = 0.5, position_error = 1;
  static constexpr auto week_ns = static_cast<std::uint64_t>(gps_week_ns);

  Vector3 if_fixed(const Vector3& v) const noexcept { return has_fix() ? v : Vector3(Vector3::Zero()); }
  Vector3 to_E(const Vector3& v_L) const noexcept {
    return has_fix() ? Vector3(dcm_EL(navigation_.latitude, navigation_.longitude) * v_L) : Vector3(Vector3::Zero());
  }

  const Reading& r_;
  const Sample& s_;
  const Navigation& navigation_;
  const Sums& sums_;
  Nanoseconds since_sample_;  // of the GPS time that is reported
  bool is_filter_;  // the attitude, its accuracy and the mode are the filter's, and the place once it is aligned
};

}  // namespace imud::vectornav
