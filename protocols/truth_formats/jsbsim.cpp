// JSBSim's `<output type="SOCKET" protocol="UDP">`: each datagram is a row of padded numbers. A row of labels
// (`<LABELS> ,Time,...`) is sent once, before them; a listener that joins later needs the setting `columns`. Set the
// output's `precision` to 16.
//
// A label is the last part of a property's name, with spaces for its underscores; both spellings are accepted.
// Required are the simulation time `Time` (s), `lat-geod-rad`, `long-gc-rad`, `epa-rad` (Earth position angle),
// `phi-rad`, `theta-rad`, `psi-rad` (front-right-down relative to local north-east-down) and the rate: `pi-rad_sec`
// to `ri-rad_sec` (relative to inertial space), or else `p-rad_sec` to `r-rad_sec` (relative to the Earth, whose
// rotation is added). Optional, and used if all three components are present, are the vectors of `eci-x-ft`,
// `eci-x-fps`, `pidot-rad_sec2` and `a-pilot-x-ft_sec2`. Feet are converted to metres. The labels of `<rates>`,
// `<propagate>` and the like are not used: their latitude is geocentric, and the Earth position angle is missing.
//
// A file of `<output type="CSV">` or `type="TABULAR">` has the same columns by the whole names of the properties, and
// begins with `Time` in place of `<LABELS>`; its precision is ten digits.
//
// The specific force is that of the pilot's eye point, which therefore is B's origin: r_SB_B is measured from there.
// JSBSim's `eci-*` are those of the centre of gravity.
#include <cmath>

#include "core/elementary.hpp"
#include "protocols/columns.hpp"

namespace imud {

namespace {

// clang-format off
enum Column : std::size_t {
  time_s = 0, latitude = 1, longitude = 2, earth_angle = 3, roll = 4, pitch = 5, yaw = 6, inertial_rate = 7,
  earth_relative_rate = 10, position_ft = 13, velocity_fps = 16, angular_acceleration = 19, specific_force_ft = 22,
};

constexpr std::string_view names[] = {
    "Time", "lat-geod-rad", "long-gc-rad", "epa-rad", "phi-rad", "theta-rad", "psi-rad",
    "pi-rad sec", "qi-rad sec", "ri-rad sec",
    "p-rad sec", "q-rad sec", "r-rad sec",
    "eci-x-ft", "eci-y-ft", "eci-z-ft",
    "eci-x-fps", "eci-y-fps", "eci-z-fps",
    "pidot-rad sec2", "qidot-rad sec2", "ridot-rad sec2",
    "a-pilot-x-ft sec2", "a-pilot-y-ft sec2", "a-pilot-z-ft sec2",
};
// clang-format on
constexpr ColumnGroup group(Column first, std::size_t size, std::string_view help, ColumnGroup::Need need) {
  return {std::span(names).subspan(first, size), help, need};
}

constexpr ColumnGroup column_groups[] = {
    group(time_s, 1, "simulation time, s", ColumnGroup::required),
    group(latitude, 1, "geodetic latitude, rad", ColumnGroup::required),
    group(longitude, 1, "longitude, rad", ColumnGroup::required),
    group(earth_angle, 1, "Earth position angle, rad", ColumnGroup::required),
    group(roll, 3, "attitude of B relative to local north-east-down, rad", ColumnGroup::required),
    group(inertial_rate, 3, "rate of B relative to inertial space, rad/s", ColumnGroup::one_of),
    group(earth_relative_rate, 3, "rate of B relative to the Earth, whose rotation is added, rad/s",
          ColumnGroup::one_of),
    group(position_ft, 3, "position of the centre of gravity, ft", ColumnGroup::optional),
    group(velocity_fps, 3, "velocity of the centre of gravity, ft/s", ColumnGroup::optional),
    group(angular_acceleration, 3, "angular acceleration, rad/s^2", ColumnGroup::optional),
    group(specific_force_ft, 3, "specific force at the pilot's eye point, ft/s^2", ColumnGroup::optional),
};
constexpr std::size_t required_columns =
    column_count(column_groups, ColumnGroup::required);  // and one of the two rates
constexpr ColumnNames column_names = {
    names, required_columns,
    "Time, lat-geod-rad, long-gc-rad, epa-rad, phi-rad, theta-rad, psi-rad, pi-rad_sec "
    "to ri-rad_sec, each a <property> "
    "of the <output>"};

constexpr double metres_per_foot = 0.3048;
constexpr double earth_rate = 7.292115e-5;  // rad/s; the rate of epa-rad
constexpr double half_pi = 0x1.921fb54442d18p0;
constexpr double largest_angle = 1e5;    // rad; the limit of elementary::sincos
constexpr double longest_time = 0x1p32;  // s
// By vectors, from inertial_rate on.
constexpr ColumnLimit limits[] = {{truth_limit::rate, "rad/s"},
                                  {truth_limit::rate, "rad/s"},
                                  {truth_limit::position / metres_per_foot, "ft"},
                                  {truth_limit::velocity / metres_per_foot, "ft/s"},
                                  {truth_limit::angular_acceleration, "rad/s^2"},
                                  {truth_limit::specific_force / metres_per_foot, "ft/s^2"}};

bool same_label(std::string_view given, std::string_view wanted) {
  given.remove_prefix(given.rfind('/') + 1);
  if (given.size() != wanted.size()) return false;
  for (std::size_t i = 0; i < given.size(); ++i)
    if ((given[i] == '_' ? ' ' : given[i]) != wanted[i]) return false;
  return true;
}

Quaternion about(const Vector3& axis, double angle) {
  const auto [sin, cos] = elementary::sincos(0.5 * angle);
  return {cos, sin * axis.x(), sin * axis.y(), sin * axis.z()};
}

// E is N turned by the Earth position angle, L is north-east-down at geodetic latitude, B is L turned by psi, theta,
// phi.
Quaternion attitude(double epa, double lat, double lon, double psi, double theta, double phi) {
  const Vector3 x = Vector3::UnitX(), y = Vector3::UnitY(), z = Vector3::UnitZ();
  const Quaternion q_NL = about(z, epa + lon) * about(y, -half_pi - lat);
  const Quaternion q_LB = about(z, psi) * about(y, theta) * about(x, phi);
  return q_NL * q_LB;
}

class JsbsimTruthDecoder final : public ColumnTruthDecoder {
 public:
  explicit JsbsimTruthDecoder(const Settings& settings) : ColumnTruthDecoder(column_names, same_label) {
    configure(settings);
  }

 private:
  Kind kind(std::string_view& row) const noexcept override {
    if (row.starts_with("<STATUS>")) return Kind::remark;
    if (row.starts_with("<LABELS>")) {
      take_field(row);
      return Kind::header;
    }
    if (row.find(names[time_s]) == row.npos) return Kind::state;
    std::string_view rest = row;
    return unquoted(take_field(rest, delimiter_of(row))) == names[time_s] ? Kind::header : Kind::state;
  }

  bool enough() const noexcept override {
    return columns().has(0, required_columns) &&
           (columns().has(inertial_rate, 3) || columns().has(earth_relative_rate, 3));
  }

  TruthResult convert(Truth& truth) const noexcept override {
    double scalars[required_columns];
    for (std::size_t i = 0; i < required_columns; ++i) {
      const auto result = columns().read(i, scalars[i]);
      if (result != TruthResult::ok) return result;
    }
    const bool inertial = columns().has(inertial_rate, 3);
    truth.has_angular_acceleration = columns().has(angular_acceleration, 3);
    truth.has_position = columns().has(position_ft, 3);
    truth.has_velocity = columns().has(velocity_fps, 3);
    truth.has_specific_force = columns().has(specific_force_ft, 3);
    struct {
      bool given;
      Column column;
      Vector3& vector;
      double unit;
    } const groups[] = {
        {true, inertial ? inertial_rate : earth_relative_rate, truth.omega_BN_B, 1.0},
        {truth.has_position, position_ft, truth.r_BN_N, metres_per_foot},
        {truth.has_velocity, velocity_fps, truth.v_BN_N, metres_per_foot},
        {truth.has_angular_acceleration, angular_acceleration, truth.omegaDot_BN_B, 1.0},
        {truth.has_specific_force, specific_force_ft, truth.specific_force_B, metres_per_foot},
    };
    for (const auto& group : groups) {
      if (!group.given) continue;
      const auto result = columns().read(group.column, group.vector);
      if (result != TruthResult::ok) return result;
      group.vector *= group.unit;
    }
    for (const double scalar : scalars)
      if (!std::isfinite(scalar)) return TruthResult::not_finite;
    if (std::abs(scalars[time_s]) > longest_time) return TruthResult::out_of_range;
    for (std::size_t i = latitude; i <= yaw; ++i)
      if (std::abs(scalars[i]) > largest_angle) return TruthResult::out_of_range;

    truth.time.ns = std::llround(scalars[time_s] * 1e9);
    truth.q_NB = attitude(scalars[earth_angle], scalars[latitude], scalars[longitude], scalars[yaw], scalars[pitch],
                          scalars[roll]);
    if (!inertial) truth.omega_BN_B += truth.q_NB.conjugate() * Vector3(0, 0, earth_rate);
    return TruthResult::ok;
  }

  bool reads(std::size_t wanted) const noexcept override {
    if (wanted < required_columns) return true;
    if (wanted >= earth_relative_rate && wanted < position_ft && columns().has(inertial_rate, 3)) return false;
    return columns().has(wanted - (wanted - inertial_rate) % 3, 3);
  }

  ColumnLimit limit(std::size_t wanted) const noexcept override {
    if (wanted == time_s) return {longest_time, "s"};
    return wanted < inertial_rate ? ColumnLimit{largest_angle, "rad"} : limits[(wanted - inertial_rate) / 3];
  }
};

constexpr Setting settings[] = {columns_setting};

}  // namespace

extern const TruthFormat jsbsim_truth_format;
constexpr TruthFormat jsbsim_truth_format = {
    .name = "jsbsim",
    .summary =
        "JSBSim <output type=\"SOCKET\"> rows: inertial rate, attitude, specific force at the pilot's eye point",
    .document = "JSBSim 1.3.2, FGOutputSocket",
    .delimits_itself = true,
    .acknowledges = false,
    .settings = settings,
    .columns = column_groups,
    .make = [](const Settings& chosen) -> std::unique_ptr<TruthDecoder> {
      return std::make_unique<JsbsimTruthDecoder>(chosen);
    },
    .force_from = "the properties accelerations/a-pilot-x-ft_sec2 to a-pilot-z-ft_sec2",
};

}  // namespace imud
