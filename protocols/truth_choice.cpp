// The configuration of a TruthAssembly: which quantities it uses.
#include <initializer_list>
#include <stdexcept>

#include "protocols/truth_assembly.hpp"

namespace imud {

namespace {

using Group = TruthGroup;

std::string names_of(Group group) {
  std::string text;
  for (const std::string_view name : quantity_group(group).names) text.append(text.empty() ? "" : ", ").append(name);
  return text;
}

}  // namespace

TruthAssembly::Axes TruthAssembly::axes(const Settings& settings) {
  const std::string& dv = settings.text(accumulated_dv_setting.key);
  return {.is_enu = settings.text(level_setting.key) == level_choices[1],
          .is_flu = settings.text(body_setting.key) == body_choices[1],
          .accumulated_dv = dv == accumulation_choices[0]   ? AccumulatedDv::inertial
                            : dv == accumulation_choices[1] ? AccumulatedDv::body_sum
                                                            : AccumulatedDv::none};
}

TruthAssembly::TruthAssembly(const QuantitySet& given, const Axes& axes) : given_(given), axes_(axes) {
  check_groups();
  choose();
}

// Sets which groups are given. Throws if one is given in part.
void TruthAssembly::check_groups() {
  for (std::size_t i = 0; i < truth_group_count; ++i) {
    const QuantityGroup& group = quantity_groups()[i];
    std::size_t count = 0;
    std::string missing;
    for (std::size_t j = 0; j < group.names.size(); ++j) {
      if (given_[group.first + j])
        ++count;
      else
        missing.append(missing.empty() ? "" : ", ").append(group.names[j]);
    }
    has_[i] = count == group.names.size();
    if (count > 0 && !has_[i])
      throw std::invalid_argument("with " + names_of(static_cast<Group>(i)) + " belong together, and missing are " +
                                  missing);
  }
}

// Returns which of the groups is given. Throws if more than one is.
std::optional<TruthGroup> TruthAssembly::only(std::initializer_list<TruthGroup> groups, std::string_view what) const {
  std::optional<TruthGroup> one;
  for (const Group group : groups) {
    if (!has(group)) continue;
    if (one)
      throw std::invalid_argument(std::string(what) + " is given twice, by " + names_of(*one) + " and by " +
                                  names_of(group) + "; give one of them");
    one = group;
  }
  return one;
}

void TruthAssembly::choose() {
  using enum TruthGroup;
  time_ = only({time, unix_time, gps_time_of_week, time_of_day, utc}, "the time");
  attitude_ = only({q_NB, q_BN, q_LB, q_BL, q_EB, q_BE, sigma_BN, sigma_BL, sigma_BE, dcm_BN, dcm_NB, dcm_BL, dcm_LB,
                    dcm_BE, dcm_EB, euler_L, euler_N, euler_E},
                   "the attitude");
  rate_ = only({rate_N, rate_E, euler_rate}, "the rate");
  position_ = only({r_BE_E, geodetic, horizontal}, "the position");
  if (has(r_BN_N)) position_ = r_BN_N;
  if (has(r_BN_N) && has(horizontal)) only({r_BN_N, horizontal}, "the position");
  velocity_ = only({v_BN_N, v_BE_E, v_BE_B, v_horizontal}, "the velocity");
  force_ = only({specific_force, acceleration_B, acceleration_N, acceleration_horizontal}, "the specific force");
  only({down, up}, "the vertical position");
  only({v_down, v_up}, "the vertical velocity");
  only({acceleration_down, acceleration_up}, "the vertical acceleration");

  const auto need = [](bool fulfilled, const std::string& text) {
    if (!fulfilled) throw std::invalid_argument(text);
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
}

}  // namespace imud
