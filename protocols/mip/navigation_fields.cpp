// The fields of the filter and of the receivers. They report the truth with the errors of the sample; their
// accuracies are the standard deviations of these errors. If the unit has its own filter, the fields of the filter
// report its solution, and the fields of the receivers the receiver's fix.
#include <array>
#include <chrono>
#include <cmath>
#include <span>

#include "core/attitude.hpp"
#include "core/earth/earth.hpp"
#include "core/gps_time.hpp"
#include "core/numbers/elementary.hpp"
#include "core/units.hpp"
#include "protocols/mip/mip.hpp"

namespace imud::mip {
namespace {

constexpr double heading_uncertainty = 0.5 * units::degree;

void put_utc(Packet& packet, std::int64_t gps_ns, std::uint16_t flags) noexcept {
  const auto utc = std::chrono::floor<std::chrono::milliseconds>(utc_from_gps(gps_ns));
  const auto day = std::chrono::floor<std::chrono::days>(utc);
  const std::int64_t of_day = (utc - day).count();
  const std::chrono::year_month_day date(day);
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

// The states last for these times from the first sample with a valid pulse per second on (an assumption: the manual
// of the GQ7, "Filter States" and "PPS", states only their order and their conditions). The unit's own filter is in
// the initialization, on a GQ7 also a vertical gyro, until it is aligned. Without a fix it goes on by dead reckoning.
Fields::FilterState Fields::filter_state() const noexcept {
  constexpr Nanoseconds initialization = std::chrono::seconds(1), alignment = std::chrono::seconds(3);
  const Model& model = memory_.model();
  const bool is_aligning = is_in(Solution::State::aligning);
  if (model.is(cv7) && is_aligning) return FilterState::initialization;
  if (model.is(cv7)) return model.is(ins) && is_known() ? FilterState::full_navigation : FilterState::ahrs;
  const bool waits = model.is(ins) ? !is_known() : is_aligning;
  if (model.is(gx5)) return waits ? FilterState::initialization : FilterState::vertical_gyro;
  const Nanoseconds age = filter_began_ ? sample_.time - *filter_began_ : Nanoseconds(0);
  if (age < initialization) return FilterState::initialization;
  if (is_aligning) return FilterState::vertical_gyro;
  const Kept& setting = *memory_.active().find_kept(model, filter_command, 0x52);
  enum HeadingSource : std::uint8_t { antennas = 1, motion = 2, magnetometer = 4 };
  const unsigned manual = setting.bytes[1], sources = setting.bytes[2];
  const bool from_receivers = (sources & (antennas | motion)) != 0 && is_known() && age >= alignment;
  if (manual == 0 && (sources & magnetometer) == 0 && !from_receivers) return FilterState::vertical_gyro;
  return is_known() ? FilterState::full_navigation : FilterState::ahrs;
}

// A filter that reports the truth finds no biases, and its uncertainty is as under an open sky.
void Fields::put_filter(Packet& packet, std::uint8_t descriptor, DeviceTime at) const noexcept {
  const Navigation& navigation = sample_.navigation;
  const FilterState state = filter_state();
  const bool navigates = is_known() && (!memory_.model().is(gq7) || state == FilterState::full_navigation);
  const std::optional<Solution>& solution = sample_.solution;
  const bool is_stable =
      !is_in(Solution::State::aligning) && (!memory_.model().is(gq7) || state != FilterState::initialization);
  const auto of_filter = [&](Eigen::Vector3f Solution::*member) {
    return Vector3(((*solution).*member).cast<double>());
  };
  const auto uncertainty = [&](Eigen::Vector3f Solution::*member, const Vector3& otherwise) {
    return solution ? of_filter(member) : otherwise;
  };
  // The filter integrates the uncorrected measurements of the sensors: its biases include the biases that the host
  // has set, which are subtracted already. The filter has no biases while it aligns, and only the gyros' if it
  // estimates the attitude alone.
  const auto more_gyro_bias = [&]() -> Vector3 {
    if (!solution || is_in(Solution::State::aligning)) return Vector3::Zero();
    return of_filter(&Solution::gyro_bias) - memory_.active().gyro_bias;
  };
  const auto more_accelerometer_bias = [&]() -> Vector3 {
    if (!is_in(Solution::State::aided) && !is_in(Solution::State::coasting)) return Vector3::Zero();
    return of_filter(&Solution::accelerometer_bias) - memory_.active().accelerometer_bias;
  };
  const auto without = [&](const Vector3& bias_P, Eigen::Vector3f Solution::*scale,
                           const Vector3& sensed) -> Vector3 {
    if (!solution) return sensed;
    const Quaternion& q_PV = memory_.active().q_PV;
    const Vector3 unbiased = sensed - q_PV.conjugate() * bias_P;
    if (((*solution).*scale).isZero(0.0F)) return unbiased;
    return q_PV.conjugate() * Vector3((q_PV * unbiased).array() / (1 + of_filter(scale).array()).max(0.5));
  };
  // A filter that does not estimate scale factors reports none. That the fields report them less 1 is an assumption.
  const auto put_scale = [&](Eigen::Vector3f Solution::*member, Eigen::Vector3f Solution::*sigma) {
    packet.put_floats(solution ? of_filter(member) : Vector3(Vector3::Zero()));
    return navigates && solution && !((*solution).*sigma).isZero(0.0F);
  };
  std::uint16_t valid = is_stable;
  switch (descriptor) {
    case 0x01:
      put_position(packet, sample_.timed());
      valid = navigates;
      break;
    case 0x02:
      packet.put_floats(sample_.timed().v_L);
      valid = navigates;
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
    case 0x06:
      packet.put_floats(more_gyro_bias());  // in P, without the host's bias
      break;
    case 0x07:
      packet.put_floats(more_accelerometer_bias());  // in P, without the host's bias
      valid = navigates;
      break;
    case 0x08:
      packet.put_floats(uncertainty(&Solution::position,
                                    double{navigation.accuracy_factor} *
                                        figure_or(figures_.position, {0.5, 0.5, 0.8})));  // m: north, east, down
      valid = navigates;
      break;
    case 0x09:
      packet.put_floats(
          uncertainty(&Solution::velocity,
                      double{navigation.accuracy_factor} * figure_or(figures_.velocity, {0.03, 0.03, 0.05})));  // m/s
      valid = navigates;
      break;
    case 0x0A:
      packet.put_floats(
          solution ? roll_pitch_yaw_deviations(sample_.q_LP, of_filter(&Solution::attitude))
                   : figure_or(figures_.attitude, {0.25 * units::degree, 0.25 * units::degree, heading_uncertainty}));
      break;
    case 0x0B:
      packet.put_floats(uncertainty(&Solution::gyro_bias_sigma, Vector3::Constant(1e-4)));  // rad/s
      break;
    case 0x0C:
      packet.put_floats(uncertainty(&Solution::accelerometer_bias_sigma, Vector3::Constant(1e-2)));  // m/s^2
      valid = navigates;
      break;
    case 0x0D:
      packet.put_floats(without(more_accelerometer_bias(), &Solution::accelerometer_scale, sample_.specific_force) +
                        gravity());
      break;
    case 0x0E:
      packet.put_floats(without(more_gyro_bias(), &Solution::gyro_scale, sample_.rate));
      break;
    case 0x10:
      return put_filter_status(packet, at);
    case 0x11:
      put_gps_time(packet, gps_ns(at));
      valid = has_time_of_week() && has_week();
      break;
    case 0x12:
      for (int i = 0; i < 4; ++i)  // an error of the quaternion is half of the angle's
        packet.put_float(solution ? 0.5 * static_cast<double>(solution->attitude.norm()) / std::sqrt(3.0)
                                  : figure_or(0.5 * figures_.attitude.norm() / std::sqrt(3.0), 0.004));
      break;
    case 0x13:
      packet.put_floats(gravity());
      break;
    case 0x16:
      valid = put_scale(&Solution::gyro_scale, &Solution::gyro_scale_sigma);
      break;
    case 0x17:
      valid = put_scale(&Solution::accelerometer_scale, &Solution::accelerometer_scale_sigma);
      break;
    case 0x18:
      valid = put_scale(&Solution::gyro_scale_sigma, &Solution::gyro_scale_sigma);
      break;
    case 0x19:
      valid = put_scale(&Solution::accelerometer_scale_sigma, &Solution::accelerometer_scale_sigma);
      break;
    case 0x1C:
      packet.put_floats(without(more_accelerometer_bias(), &Solution::accelerometer_scale, sample_.specific_force));
      break;
    case 0x49:
      return put_dual_antenna(packet, at);
    default:
      packet.put_doubles(sample_.timed().r_E);
      valid = navigates;
      break;
  }
  packet.put(valid);
}

// Tells which of the filter's standard deviations are high. No document states MicroStrain's limits. These limits are
// chosen: they are the limits of SBG's valid solution (sbgECom 05c19cd, sbgEComLogEkf.h).
struct Fields::Warnings {
  bool tilt = false, heading = false, velocity = false, position = false;

  Warnings(const std::optional<Solution>& solution, bool has_place) noexcept {
    if (!solution) return;
    constexpr auto high_tilt = static_cast<float>(0.5 * units::degree),
                   high_heading = static_cast<float>(1.0 * units::degree);
    constexpr float high_velocity = 1.5F, high_position = 10;
    tilt = solution->attitude.head<2>().maxCoeff() > high_tilt;
    heading = solution->attitude.z() > high_heading;
    velocity = has_place && solution->velocity.maxCoeff() > high_velocity;
    position = has_place && solution->position.maxCoeff() > high_position;
  }
  bool is_any() const noexcept { return tilt || heading || velocity || position; }
};

// Writes state, dynamics mode and flags (mip_sdk, mip_filter_status_flags; manuals of GQ7 and CV7, "Filter Status
// Flags").
void Fields::put_filter_status(Packet& packet, DeviceTime at) const noexcept {
  const Model& model = memory_.model();
  const FilterState state = filter_state();
  const Kept* dynamics = memory_.active().find_kept(model, filter_command, 0x10);
  packet.put(static_cast<std::uint16_t>(state));
  packet.put(static_cast<std::uint16_t>(dynamics != nullptr ? dynamics->bytes[0] : 1));
  const Warnings warnings(sample_.solution, is_known());
  packet.put(static_cast<std::uint16_t>(model.is(gx5) ? flags_of_gx5(state, warnings)
                                                      : flags_of_series_7(state, warnings, has_pulse(at))));
}

// Returns the flags. In state 1 (initializing): 0x1000: no attitude; 0x2000: no position and velocity. In state 2
// (running): 0x02: no GNSS; 0x10, 0x20, 0x40: the covariance of position, velocity or attitude is high.
unsigned Fields::flags_of_gx5(FilterState state, const Warnings& high) const noexcept {
  const bool is_aligning = is_in(Solution::State::aligning), is_ins = memory_.model().is(ins);
  if (state == FilterState::initialization) return (is_aligning ? 0x1000U : 0U) | (is_ins ? 0x2000U : 0U);
  const bool has_lost = sample_.solution && is_ins && !sample_.fix().is_known;
  return (has_lost ? 0x02U : 0U) | (high.position ? 0x10U : 0U) | (high.velocity ? 0x20U : 0U) |
         (high.tilt || high.heading ? 0x40U : 0U);
}

// Returns the flags. Condition 1: stable, 2: converging; 0x04, 0x08, 0x10, 0x20: tilt, heading, position or velocity
// is uncertain; 0x400: no pulse per second. The filter is stable while its deviations are small and it has aids.
unsigned Fields::flags_of_series_7(FilterState state, const Warnings& high, bool has_pulse) const noexcept {
  const bool is_gq7 = memory_.model().is(gq7);
  const bool is_settled = !high.is_any() && !is_in(Solution::State::aligning) && !is_in(Solution::State::coasting);
  const bool is_stable = is_settled && (!is_gq7 || state == FilterState::full_navigation);
  return (is_stable ? 1U : 2U) | (high.tilt ? 0x04U : 0U) | (high.heading ? 0x08U : 0U) |
         (high.position ? 0x10U : 0U) | (high.velocity ? 0x20U : 0U) | (is_gq7 && !has_pulse ? 0x400U : 0U);
}

// Writes a field for each aid: the second of the week, the source, the type, and bits: the aid is enabled (1), was
// used (2) or had a high residual (4) when it was last due (mip_sdk, data_filter.hpp; files.microstrain.com, GQ7 User
// Manual, 0x82,0x46). For a CV7, fixes count as if its host had sent them (set 0x13). If the solution is the truth,
// the fixes are reported as used.
void Fields::put_aiding_summaries(Packet& packet, DeviceTime at) const noexcept {
  struct Aid {
    std::uint8_t source, type;
    unsigned bits;  // of namespace aid
  };
  enum : std::uint8_t { of_receiver = 1, two_antennas, heading, pressure, magnetometer, llh = 34, ned = 41 };
  static constexpr std::array<Aid, most_aids> of_gq7 = {Aid{1, of_receiver, aid::position | aid::velocity},
                                                        {2, of_receiver, aid::position | aid::velocity},
                                                        {0, two_antennas, aid::antennas_heading},
                                                        {0, pressure, aid::pressure},
                                                        {0, magnetometer, aid::magnetic_heading}};
  static constexpr std::array<Aid, 4> of_cv7 = {Aid{1, llh, aid::position},
                                                {1, ned, aid::velocity},
                                                {0, pressure, aid::pressure},
                                                {0, magnetometer, aid::magnetic_heading}};
  const std::optional<Solution>& solution = sample_.solution;
  const unsigned fixes = (is_known() ? aid::position | aid::velocity : 0U) |
                         (sample_.antennas() != nullptr ? aid::antennas_heading : 0U);
  const unsigned withheld = requests_.aids.withheld;
  const unsigned used = (solution ? solution->used : fixes) & ~withheld,
                 rejected = solution ? solution->rejected & ~withheld : 0U;
  const double second = knows_time() ? 1e-9 * static_cast<double>(true_gps_ns(at) % gps_week_ns) : 0;
  for (const Aid& one : memory_.model().is(gq7) ? std::span<const Aid>(of_gq7) : std::span<const Aid>(of_cv7)) {
    if (!packet.has_room_for(sizeof(float) + 3)) return;
    packet.begin(aiding_summary);
    packet.put_float(second);
    packet.put(one.source);
    packet.put(one.type);
    packet.put(static_cast<std::uint8_t>(((withheld & one.bits) == 0 ? 1U : 0U) | ((used & one.bits) != 0 ? 2U : 0U) |
                                         ((rejected & one.bits) != 0 ? 4U : 0U)));
    packet.end();
  }
}

// Writes the second of the week of the last measurement (mip_sdk, data_filter.hpp), the heading, its uncertainty, and
// flags: integers fixed, both receivers and the offsets of their antennas valid. All are data of the receivers: they
// are valid with a fix, also while the filter aligns, and zero without a fix, also while the filter navigates. Where
// the receivers measure a heading (Sample::antennas()), the vehicle's heading is by it. Otherwise the heading is the
// unit's at the receivers' last epoch.
void Fields::put_dual_antenna(Packet& packet, DeviceTime at) const noexcept {
  const Vector3 ypr = yaw_pitch_roll_from_dcm(antennas_q_LV_.conjugate().toRotationMatrix());
  const AntennaLine* const line = sample_.antennas();
  const bool is_fixed = line != nullptr || (sample_.fix().is_known && sample_.fix().antennas.sigma == 0);
  const std::int64_t gps_ns = line != nullptr ? true_gps_ns(sample_.time) - line->age.count() : fix_gps_ns(at);
  packet.put_float(is_fixed ? 1e-9 * static_cast<double>(gps_ns % gps_week_ns) : 0.0);
  packet.put_float(is_fixed ? ypr[0] : 0.0);
  packet.put_float(!is_fixed         ? 0.0
                   : line != nullptr ? line->sigma
                                     : figure_or(figures_.attitude.z(), heading_uncertainty));
  packet.put(static_cast<std::uint8_t>(is_fixed ? 2 : 0));
  packet.put(static_cast<std::uint16_t>(is_fixed ? 0x07 : 0));
  packet.put(std::uint16_t{is_fixed});
}

// If the receiver reports the truth, its accuracies are as under an open sky. A receiver that has lost its fix goes
// on reporting the last place, flagged as invalid. (u-blox, ANTARIS 4 System Integration Manual, 4.6.5.2: the
// position is extrapolated and indicated as no fix. Here it is not extrapolated.)
void Fields::put_gnss(Packet& packet, std::uint8_t descriptor, DeviceTime at) const noexcept {
  const Navigation& navigation = sample_.fix();
  const bool is_fixed = navigation.is_known;
  const Navigation& place = !is_fixed && last_fix_ ? *last_fix_ : navigation;
  const Vector3& v = navigation.v_L;
  const auto if_known = [&](int flags) { return static_cast<std::uint16_t>(is_fixed ? flags : 0); };
  const auto put_accuracy = [&](double figure, double otherwise) {
    packet.put_float(is_fixed ? double{navigation.accuracy_factor} * figure_or(figure, otherwise) : 0.0);
  };
  switch (descriptor) {
    case 0x03:
      put_position(packet, place);
      packet.put(place.height);  // in place of the height above mean sea level, which is flagged as invalid
      put_accuracy(figures_.position.head<2>().norm(), 1.2);  // m, horizontal
      put_accuracy(figures_.position.z(), 1.8);               // m, vertical
      packet.put(if_known(0x1B));
      break;
    case 0x04:
      packet.put_doubles(place.r_E);
      put_accuracy(figures_.position.norm(), 2.2);  // m
      packet.put(if_known(0x03));
      break;
    case 0x05: {
      const double course = elementary::atan2(v.y(), v.x()) / units::degree;
      packet.put_floats(v);
      packet.put_float(v.norm());
      packet.put_float(v.head<2>().norm());
      packet.put_float(course < 0 ? course + 360 : course);
      put_accuracy(figures_.velocity.norm(), 0.05);  // m/s
      put_accuracy(elementary::atan2(figures_.velocity.head<2>().norm(), v.head<2>().norm()) / units::degree, 0.5);
      packet.put(if_known(0x3F));
      break;
    }
    case 0x07: {
      const Dilution& of = navigation.dilution.known_or(open_sky);
      for (const float dop : {of.geometric, of.position, of.horizontal, of.vertical, of.time, of.north, of.east})
        packet.put(is_fixed ? dop : 99.99F);
      packet.put(if_known(0x7F));
      break;
    }
    case 0x08:
      put_utc(packet, fix_gps_ns(at), if_known(0x03));
      break;
    case 0x09:
      put_gps_time(packet, fix_gps_ns(at));
      packet.put(if_known(0x03));
      break;
    case 0x0B:  // 3D or none
      packet.put(static_cast<std::uint8_t>(is_fixed ? 0 : 3));
      packet.put(static_cast<std::uint8_t>(is_fixed ? navigation.satellites : 0));
      packet.put(std::uint16_t{0});
      packet.put(std::uint16_t{0x07});
      break;
    case 0x11:
      packet.put(static_cast<std::uint8_t>(gps_leap_s));
      packet.put(if_known(0x02));
      break;
    default:  // on; antenna good, powered
      for (const int state : {1, 4, 1}) packet.put(static_cast<std::uint8_t>(state));
      packet.put(std::uint16_t{0x07});
      break;
  }
}

void Fields::put_position(Packet& packet, const Navigation& navigation) noexcept {
  packet.put(navigation.latitude / units::degree);
  packet.put(navigation.longitude / units::degree);
  packet.put(navigation.height);
}

Vector3 Fields::gravity() const noexcept {
  const double g =
      is_known() ? normal_gravity(sample_.navigation.latitude, sample_.navigation.height) : units::standard_gravity;
  return sample_.q_LP.conjugate() * Vector3(0, 0, g);
}

}  // namespace imud::mip
