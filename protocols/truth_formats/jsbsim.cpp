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
// The specific force is taken at the pilot's eye point, which is B's origin: r_SB_B is measured from there. JSBSim's
// `eci-*` are of the centre of gravity.
#include "protocols/quantities/columns.hpp"

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
constexpr std::string_view quantities[] = {
    "time_s", "latitude_rad", "longitude_rad", "earth_angle_rad", "roll_rad", "pitch_rad", "yaw_rad",
    "p_rad_per_s", "q_rad_per_s", "r_rad_per_s",
    "p_BE_rad_per_s", "q_BE_rad_per_s", "r_BE_rad_per_s",
    "r_BN_N_x_ft", "r_BN_N_y_ft", "r_BN_N_z_ft",
    "v_BN_N_x_ft_per_s", "v_BN_N_y_ft_per_s", "v_BN_N_z_ft_per_s",
    "p_dot_rad_per_s2", "q_dot_rad_per_s2", "r_dot_rad_per_s2",
    "specific_force_x_ft_per_s2", "specific_force_y_ft_per_s2", "specific_force_z_ft_per_s2",
};
static_assert(std::size(quantities) == std::size(names));
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
    group(position_ft, 3,
          "position of the centre of gravity, ft; needed, with the velocity, for place, magnetic field, pressure and "
          "GNSS",
          ColumnGroup::optional),
    group(velocity_fps, 3,
          "velocity of the centre of gravity, ft/s; needed, with the position, for place, magnetic field, pressure "
          "and GNSS",
          ColumnGroup::optional),
    group(angular_acceleration, 3, "angular acceleration, rad/s^2", ColumnGroup::optional),
    group(specific_force_ft, 3, "specific force at the pilot's eye point, ft/s^2", ColumnGroup::optional),
};
constexpr ColumnNames column_names = {
    names, quantities, column_groups,
    "Time, lat-geod-rad, long-gc-rad, epa-rad, phi-rad, theta-rad, psi-rad, pi-rad_sec "
    "to ri-rad_sec, each a <property> "
    "of the <output>"};

bool same_label(std::string_view given, std::string_view wanted) {
  given.remove_prefix(given.rfind('/') + 1);
  if (given.size() != wanted.size()) return false;
  for (std::size_t i = 0; i < given.size(); ++i)
    if ((given[i] == '_' ? ' ' : given[i]) != wanted[i]) return false;
  return true;
}

class JsbsimTruthDecoder final : public ColumnTruthDecoder {
 public:
  explicit JsbsimTruthDecoder(const Settings& settings) : ColumnTruthDecoder(column_names, same_label) {
    configure(settings);
  }
  TruthFrame frame() const noexcept override { return {.kind = TruthFrame::Kind::earth}; }

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
};

constexpr Setting settings[] = {columns_setting};

}  // namespace

extern constexpr TruthFormat jsbsim_truth_format = {
    .name = "jsbsim",
    .summary =
        "JSBSim <output type=\"SOCKET\"> rows: inertial rate, attitude, specific force at the pilot's eye point",
    .document = "JSBSim 1.3.2, FGOutputSocket",
    .delimits_itself = true,
    .settings = settings,
    .columns = column_groups,
    .make = make_as<TruthDecoder, JsbsimTruthDecoder>,
    .force_from = "the properties accelerations/a-pilot-x-ft_sec2 to a-pilot-z-ft_sec2",
    .position_from = "position/eci-x-ft, eci-y-ft, eci-z-ft",
    .velocity_from = "velocities/eci-x-fps, eci-y-fps, eci-z-fps",
};

}  // namespace imud
