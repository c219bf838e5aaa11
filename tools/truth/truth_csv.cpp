#include "tools/truth/truth_csv.hpp"

#include <fmt/format.h>

#include <cstddef>
#include <iterator>
#include <string_view>
#include <vector>

#include "core/attitude.hpp"
#include "core/earth/earth.hpp"
#include "core/gps_time.hpp"

namespace imud {
namespace {

struct Columns {
  std::string_view names;       // by Basilisk; empty: it has none
  std::string_view quantities;  // the same by the vocabulary of truth
  unsigned part;                // none: always present
  std::string_view words;
  Eigen::Index size;  // 3, or 1: the first component of the value alone
  Vector3 (*value)(const Truth& truth);
};

constexpr unsigned part_of(VehicleState state) { return TruthParts::states << static_cast<unsigned>(state); }

template <VehicleState state>
Vector3 state_of(const Truth& truth) {
  return {truth.vehicle[state].value_or(0.0), 0, 0};
}

constexpr Columns columns[] = {
    {"r_BN_N_x,r_BN_N_y,r_BN_N_z", "r_BN_N_x_m,r_BN_N_y_m,r_BN_N_z_m", TruthParts::position, "position", 3,
     [](const Truth& t) { return t.r_BN_N; }},
    {"v_BN_N_x,v_BN_N_y,v_BN_N_z", "v_BN_N_x_m_per_s,v_BN_N_y_m_per_s,v_BN_N_z_m_per_s", TruthParts::velocity,
     "velocity", 3, [](const Truth& t) { return t.v_BN_N; }},
    {"sigma_BN_1,sigma_BN_2,sigma_BN_3", "sigma_BN_1,sigma_BN_2,sigma_BN_3", TruthParts::none, "", 3,
     [](const Truth& t) { return mrp_from_quaternion(t.q_NB); }},
    {"omega_BN_B_x,omega_BN_B_y,omega_BN_B_z", "p_rad_per_s,q_rad_per_s,r_rad_per_s", TruthParts::none, "", 3,
     [](const Truth& t) { return t.omega_BN_B; }},
    {"omegaDot_BN_B_x,omegaDot_BN_B_y,omegaDot_BN_B_z", "p_dot_rad_per_s2,q_dot_rad_per_s2,r_dot_rad_per_s2",
     TruthParts::angular_acceleration, "angular acceleration", 3, [](const Truth& t) { return t.omegaDot_BN_B; }},
    {"nonConservativeAccelpntB_B_x,nonConservativeAccelpntB_B_y,nonConservativeAccelpntB_B_z",
     "specific_force_x_m_per_s2,specific_force_y_m_per_s2,specific_force_z_m_per_s2", TruthParts::specific_force,
     "specific force", 3, [](const Truth& t) { return t.specific_force_B; }},
    {"TotalAccumDV_BN_B_x,TotalAccumDV_BN_B_y,TotalAccumDV_BN_B_z",
     "accumulated_dv_x_m_per_s,accumulated_dv_y_m_per_s,accumulated_dv_z_m_per_s", TruthParts::accumulated_dv,
     "accumulated velocity", 3, [](const Truth& t) { return t.accumulated_dv_B; }},
    {"temperature_c", "temperature_c", TruthParts::temperature, "temperature", 1,
     [](const Truth& t) { return Vector3(t.temperature_c, 0, 0); }},
    {"", "earth_angle_rad", TruthParts::earth_angle, "place on the Earth", 1,
     [](const Truth& t) { return Vector3(earth_angle_at(t), 0, 0); }},
    {"", "magnetic_field_x_t,magnetic_field_y_t,magnetic_field_z_t", TruthParts::magnetic_field, "magnetic field", 3,
     [](const Truth& t) { return t.magnetic_field_B; }},
    {"", "pressure_pa", TruthParts::pressure, "pressure", 1,
     [](const Truth& t) { return Vector3(t.pressure, 0, 0); }},
    {"", "rotor_speed_rad_per_s", part_of(VehicleState::rotor_speed), "rotor speed", 1,
     state_of<VehicleState::rotor_speed>},
    {"", "throttle", part_of(VehicleState::throttle), "throttle", 1, state_of<VehicleState::throttle>},
    {"", "airspeed_m_per_s", part_of(VehicleState::airspeed), "airspeed", 1, state_of<VehicleState::airspeed>},
    {"", "dynamic_pressure_pa", part_of(VehicleState::dynamic_pressure), "dynamic pressure", 1,
     state_of<VehicleState::dynamic_pressure>},
    {"", "current_a", part_of(VehicleState::current), "current", 1, state_of<VehicleState::current>},
};

// Returns whether all columns have names of Basilisk.
constexpr bool is_of_basilisk(unsigned parts) {
  return (parts & ~(TruthParts::motion | TruthParts::temperature)) == 0;
}

}  // namespace

unsigned parts_of(const Truth& truth) {
  unsigned parts = (truth.has_position ? TruthParts::position : 0U) |
                   (truth.has_velocity ? TruthParts::velocity : 0U) |
                   (truth.has_angular_acceleration ? TruthParts::angular_acceleration : 0U) |
                   (truth.has_specific_force ? TruthParts::specific_force : 0U) |
                   (truth.accumulated_dv != AccumulatedDv::none ? TruthParts::accumulated_dv : 0U) |
                   (truth.has_temperature ? TruthParts::temperature : 0U) |
                   (truth.has_earth_angle ? TruthParts::earth_angle : 0U) |
                   (truth.has_magnetic_field ? TruthParts::magnetic_field : 0U) |
                   (truth.has_pressure ? TruthParts::pressure : 0U) | (truth.has_date ? TruthParts::date : 0U) |
                   (truth.stamp.clock != SharedClock::none ? TruthParts::stamp : 0U);
  for (std::size_t i = 0; i < vehicle_state_count; ++i)
    if (const auto state = static_cast<VehicleState>(i); truth.vehicle[state]) parts |= part_of(state);
  return parts;
}

unsigned writable_parts_of(const Truth& first) {
  const unsigned never = first.time != TruthTime{} ? TruthParts::stamp | TruthParts::date : TruthParts::stamp;
  return parts_of(first) & ~never;
}

std::string names_of_parts(unsigned parts) {
  std::vector<std::string_view> names;
  if ((parts & TruthParts::date) != 0) names.push_back("date");
  if ((parts & TruthParts::stamp) != 0) names.push_back("stamp");
  for (const Columns& group : columns)
    if ((group.part & parts) != 0) names.push_back(group.words);
  return fmt::format("{}", fmt::join(names, ", "));
}

std::string truth_csv_header(unsigned parts) {
  std::string row = (parts & TruthParts::date) != 0 ? "gps_week,gps_time_of_week_ns" : "time_ns";
  for (const Columns& group : columns)
    if ((group.part & ~parts) == 0) row.append(",").append(is_of_basilisk(parts) ? group.names : group.quantities);
  return row + "\n";
}

std::string truth_csv_row(const Truth& truth, unsigned parts) {
  std::string row;
  if ((parts & TruthParts::date) != 0) {
    const std::int64_t gps_ns = truth.start_gps_ns + truth.time.ns;
    row = fmt::format("{},{}", gps_ns / gps_week_ns, gps_ns % gps_week_ns);
  } else {
    row = fmt::format("{}", truth.time.ns);
  }
  for (const Columns& group : columns) {
    if ((group.part & ~parts) != 0) continue;
    const Vector3 value = group.value(truth);
    for (Eigen::Index i = 0; i < group.size; ++i) fmt::format_to(std::back_inserter(row), ",{}", value[i]);
  }
  return row + "\n";
}

}  // namespace imud
