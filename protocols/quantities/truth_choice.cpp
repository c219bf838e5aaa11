// The configuration of a TruthAssembly: the choice of the quantities that are used.
#include <array>
#include <initializer_list>
#include <stdexcept>
#include <utility>

#include "protocols/quantities/truth_assembly.hpp"

namespace imud {
namespace {

using Group = TruthGroup;

RemarkWriter& operator<<(RemarkWriter& out, Group group) noexcept {
  const char* separator = "";
  for (const std::string_view name : quantity_group(group).names) out << std::exchange(separator, ", ") << name;
  return out;
}

}  // namespace

AccumulatedDv TruthAssembly::accumulation(const Settings& settings) {
  const std::string& dv = settings.text(accumulated_dv_setting.key);
  return dv == accumulation_choices[0]   ? AccumulatedDv::inertial
         : dv == accumulation_choices[1] ? AccumulatedDv::body_sum
                                         : AccumulatedDv::none;
}

TruthAssembly::Axes TruthAssembly::axes(const Settings& settings) {
  return {.is_enu = settings.text(level_setting.key) == level_choices[1],
          .is_flu = settings.text(body_setting.key) == body_choices[1],
          .accumulated_dv = accumulation(settings)};
}

TruthAssembly::TruthAssembly(const QuantitySet& given, const Axes& axes) {
  std::array<char, 600> room;
  RemarkWriter fault(room);
  if (!choose(given, axes, fault)) throw std::invalid_argument(std::string(room.data(), fault.size()));
}

// Finds the groups that are given. Returns false if a group is incomplete.
bool TruthAssembly::check_groups(RemarkWriter& fault) noexcept {
  for (std::size_t i = 0; i < truth_group_count; ++i) {
    const QuantityGroup& group = quantity_groups()[i];
    std::size_t count = 0;
    for (std::size_t j = 0; j < group.names.size(); ++j) count += given_[group.first + j] ? 1U : 0U;
    has_[i] = count == group.names.size();
    if (count == 0 || has_[i]) continue;
    fault << "with " << static_cast<Group>(i) << " belong together, and missing are ";
    const char* separator = "";
    for (std::size_t j = 0; j < group.names.size(); ++j)
      if (!given_[group.first + j]) fault << std::exchange(separator, ", ") << group.names[j];
    return false;
  }
  return true;
}

// Returns the group among `groups` that is given; nullopt if none is. Writes a fault if several are given.
std::optional<TruthGroup> TruthAssembly::only(std::initializer_list<TruthGroup> groups, std::string_view what,
                                              RemarkWriter& fault) const noexcept {
  std::optional<TruthGroup> one;
  for (const Group group : groups) {
    if (!has(group)) continue;
    if (one && fault.size() == 0)
      fault << what << " is given twice, by " << *one << " and by " << group << "; give one of them";
    one = group;
  }
  return one;
}

bool TruthAssembly::choose(const QuantitySet& given, const Axes& axes, RemarkWriter& fault) noexcept {
  *this = {};
  given_ = given;
  axes_ = axes;
  set_limits();
  return check_groups(fault) && choose_groups(fault);
}

bool TruthAssembly::choose_groups(RemarkWriter& fault) noexcept {
  using enum TruthGroup;
  time_ = only({time, unix_time, gps_time_of_week, time_of_day, utc}, "the time", fault);
  attitude_ = only({q_NB, q_BN, q_LB, q_BL, q_EB, q_BE, sigma_BN, sigma_BL, sigma_BE, dcm_BN, dcm_NB, dcm_BL, dcm_LB,
                    dcm_BE, dcm_EB, euler_L, euler_N, euler_E},
                   "the attitude", fault);
  rate_ = only({rate_N, rate_E, euler_rate}, "the rate", fault);
  position_ = only({r_BE_E, geodetic, horizontal}, "the position", fault);
  if (has(r_BN_N)) position_ = r_BN_N;
  if (has(r_BN_N) && has(horizontal)) only({r_BN_N, horizontal}, "the position", fault);
  velocity_ = only({v_BN_N, v_BE_E, v_BE_B, v_horizontal}, "the velocity", fault);
  force_ =
      only({specific_force, acceleration_B, acceleration_N, acceleration_horizontal}, "the specific force", fault);
  only({down, up}, "the vertical position", fault);
  only({v_down, v_up}, "the vertical velocity", fault);
  only({acceleration_down, acceleration_up}, "the vertical acceleration", fault);

  const auto need = [&](bool fulfilled, std::string_view text) {
    if (!fulfilled && fault.size() == 0) fault << text;
  };
  need(time_.has_value(), "the time is missing; give time_s, unix_time_s, utc or another");
  need(time_ != gps_time_of_week || has(gps_week), "gps_time_of_week needs gps_week");
  need(attitude_ || rate_, "the attitude is missing; give q_NB_w to _z, yaw, pitch and roll, or another");
  need(rate_ != euler_rate || (attitude_ && is_euler(*attitude_)),
       "yaw_rate, pitch_rate and roll_rate need yaw, pitch and roll");
  need(!has(horizontal) || has(down) || has(up), "north and east need down or up");
  need(!has(v_horizontal) || has(v_down) || has(v_up), "v_north and v_east need v_down or v_up");
  need(!has(acceleration_horizontal) || has(acceleration_down) || has(acceleration_up),
       "acceleration_north and acceleration_east need acceleration_down or acceleration_up");
  need(!has(height) || has(geodetic), "height needs latitude and longitude");

  is_inertial_ = has(geodetic) || has(r_BE_E) || has(v_BE_E) || has(earth_angle) ||
                 (attitude_ && is_relative_to_earth(*attitude_));
  const bool has_place = has(geodetic) || has(r_BE_E) || (has(r_BN_N) && is_inertial_);
  const bool needs_place = (attitude_ && is_relative_to_level(*attitude_)) || has(v_horizontal) ||
                           has(acceleration_horizontal) || has(acceleration_B) || has(acceleration_N);
  need(!is_inertial_ || has_place || !needs_place,
       "a quantity relative to the local level, or an acceleration, needs the place: give latitude and longitude");
  need(attitude_ || !is_inertial_ || !rate_ || rate_ == rate_N,
       "a rate relative to the Earth needs an attitude, which is missing");
  return fault.size() == 0;
}

// Returns the frame of the truth. A pose relative to N alone may be in an inertial frame or in a hall. Axes
// east-north-up mean a locally level frame.
TruthFrame TruthAssembly::frame() const noexcept {
  using enum TruthGroup;
  using Kind = TruthFrame::Kind;
  const bool has_rate = rate_.has_value();
  if (is_inertial_) return {Kind::earth, has_rate, has(earth_angle) ? std::nullopt : std::optional(0.0)};
  const bool has_level = (attitude_ && is_relative_to_level(*attitude_)) || has(horizontal) || has(v_horizontal) ||
                         has(acceleration_horizontal);
  return {has_level || (axes_.is_enu && attitude_) ? Kind::local : Kind::unknown, has_rate, std::nullopt};
}

}  // namespace imud
