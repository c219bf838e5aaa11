// TruthAssembly: assembles a Truth from the quantities that a simulator gives.
#pragma once

#include <array>
#include <boost/container/static_vector.hpp>
#include <cstdint>
#include <optional>
#include <string_view>

#include "protocols/quantities/remark_writer.hpp"
#include "protocols/quantities/truth_quantities.hpp"
#include "protocols/wire/wrapping_time.hpp"

namespace imud {

// Settings of formats whose truths a TruthAssembly makes. A format has a setting where its data leave the choice
// open. `level` chooses a local level of north-east-down or east-north-up, `body` body axes of front-right-down or
// front-left-up, and `accumulated_dv` the axes in which the accumulated velocity was summed.
inline constexpr std::string_view level_choices[] = {"ned", "enu"};
inline constexpr std::string_view body_choices[] = {"frd", "flu"};
inline constexpr Setting level_setting = text_setting(
    "level",
    "axes of the local level, and of N where there is no place on the Earth: north-east-down or east-north-up", "ned",
    level_choices);
inline constexpr Setting body_setting =
    text_setting("body", "body axes: front-right-down or front-left-up", "frd", body_choices);
inline constexpr std::string_view accumulation_choices[] = {"inertial", "body_sum", "none"};
inline constexpr Setting accumulated_dv_setting = text_setting(
    "accumulated_dv",
    "how the accumulated velocity was accumulated: in inertial space, or each step in its own body axes; none: "
    "not used",
    "inertial", accumulation_choices);

// Returns the largest magnitude of the numbers of a field, in its unit.
double largest_of(const TruthField& field) noexcept;

// Makes Truths, in B front-right-down. N is inertial if the quantities include a place on the Earth, an attitude
// relative to the Earth, or `earth_angle`. The origin of an inertial N is the Earth's centre, and its z axis is
// the axis of rotation; unless `earth_angle` is given, N coincides with E at truth time 0. Otherwise N is the
// local level, north-east-down, the Earth does not turn, and gravity is 9.80665 m/s^2.
//
// Time: where N is inertial, a time since 1970, 1980 or the begin of a day is counted from the first truth. A time
// of day without a date continues past midnight. Attitude: where only the rate is given, the rate is integrated,
// starting from the axes of N.
//
// The constructor may throw; convert() allocates nothing. One thread.
class TruthAssembly {
 public:
  struct Axes {
    bool is_enu = false;  // the local level is east-north-up, and so is N where N is the local level
    bool is_flu = false;  // the body axes are front-left-up
    AccumulatedDv accumulated_dv = AccumulatedDv::inertial;
  };
  static Axes axes(const Settings& settings);
  // Returns the value of accumulated_dv_setting.
  static AccumulatedDv accumulation(const Settings& settings);

  TruthAssembly() = default;  // no other function may be called on such an object
  // `given`: the quantities that every reading has. Throws std::invalid_argument, whose message names repeated or
  // missing quantities. Incomplete groups of quantities are errors, too.
  TruthAssembly(const QuantitySet& given, const Axes& axes);
  // Does the constructor's work without exception and allocation. On a fault, returns false and writes the message
  // to `fault`; convert() must not be called afterwards. Requires an empty `fault`.
  bool choose(const QuantitySet& given, const Axes& axes, RemarkWriter& fault) noexcept;
  // Returns the quantities that are given.
  const QuantitySet& given() const noexcept { return given_; }
  // Returns the frame N of the truths.
  TruthFrame frame() const noexcept;

  // Converts the quantities of a record. Returns ok, not_finite or out_of_range.
  TruthResult convert(const TruthReading& in, Truth& truth) noexcept;
  // Writes which number of the last record was refused, and its limit.
  void describe(const TruthReading& in, RemarkWriter& out) const noexcept;
  // Restarts with the next record: the record's absolute time becomes the new origin of time, and an integration
  // of attitude starts again from the axes of N.
  void begin() noexcept;

 private:
  bool has(TruthGroup group) const noexcept { return has_[static_cast<std::size_t>(group)]; }
  std::optional<TruthGroup> only(std::initializer_list<TruthGroup> groups, std::string_view what,
                                 RemarkWriter& fault) const noexcept;
  bool check_groups(RemarkWriter& fault) noexcept;
  bool choose_groups(RemarkWriter& fault) noexcept;
  void set_limits() noexcept;

  double number(const TruthReading& in, TruthGroup group, std::size_t i = 0) const noexcept {
    return in[quantity_group(group).first + i];
  }
  Vector3 vector(const TruthReading& in, TruthGroup group) const noexcept;
  Vector3 body(const Vector3& given) const noexcept;
  Vector3 level(const TruthReading& in, TruthGroup horizontal, TruthGroup down, TruthGroup up) const noexcept;
  bool convert_time(const TruthReading& in, Truth& truth) noexcept;
  Quaternion attitude(const TruthReading& in, TruthGroup group) const noexcept;
  bool is_rotation(const TruthReading& in, TruthGroup group) const noexcept;
  Matrix3 matrix(const TruthReading& in, TruthGroup group) const noexcept;
  bool convert_place(const TruthReading& in, Truth& truth) noexcept;
  void convert_attitude(const TruthReading& in, Truth& truth) noexcept;
  void convert_rate(const TruthReading& in, Truth& truth) noexcept;
  bool is_about_earth(const Truth& truth) const noexcept;
  void convert_force(const TruthReading& in, Truth& truth) noexcept;
  void convert_vehicle(const TruthReading& in, Truth& truth) const noexcept;
  void integrate_attitude(Truth& truth) noexcept;

  struct Limit {
    std::uint32_t quantity = 0;
    double largest = 0;  // magnitude, SI
  };

  QuantitySet given_;
  boost::container::static_vector<Limit, quantity_count> limits_;  // of the given quantities
  std::array<bool, truth_group_count> has_ = {};
  Axes axes_;
  bool is_inertial_ = false;  // N
  std::optional<TruthGroup> time_, attitude_, rate_, position_, velocity_, force_;

  // Members of the record that is being converted.
  double angle_ = 0;                                                          // rad, from N to E about z
  Quaternion q_NE_ = Quaternion::Identity(), q_NL_ = Quaternion::Identity();  // L: north, east, down
  double gravity_ = 0;                                                        // m/s^2, along L's z
  Vector3 r_E_ = Vector3::Zero();                                             // m; where the place is known
  Vector3 v_L_ = Vector3::Zero();                                             // m/s, relative to the Earth
  std::size_t refused_ = quantity_count;

  std::optional<std::int64_t> origin_ns_;    // of an absolute time
  std::optional<WrappingTime> time_of_day_;  // without a day
  std::optional<Truth> before_;              // the truth before, with the integrated attitude
};

}  // namespace imud
