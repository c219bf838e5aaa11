#include "tools/truth/truth_csv.hpp"

#include <fmt/format.h>

#include <iterator>
#include <string_view>

#include "core/attitude.hpp"

namespace imud {
namespace {

struct Columns {
  std::string_view names;
  unsigned part;  // none: always present
  Vector3 (*value)(const Truth& truth);
};

constexpr Columns columns[] = {
    {"r_BN_N_x,r_BN_N_y,r_BN_N_z", TruthParts::position, [](const Truth& t) { return t.r_BN_N; }},
    {"v_BN_N_x,v_BN_N_y,v_BN_N_z", TruthParts::position, [](const Truth& t) { return t.v_BN_N; }},
    {"sigma_BN_1,sigma_BN_2,sigma_BN_3", TruthParts::none,
     [](const Truth& t) { return mrp_from_quaternion(t.q_NB); }},
    {"omega_BN_B_x,omega_BN_B_y,omega_BN_B_z", TruthParts::none, [](const Truth& t) { return t.omega_BN_B; }},
    {"omegaDot_BN_B_x,omegaDot_BN_B_y,omegaDot_BN_B_z", TruthParts::angular_acceleration,
     [](const Truth& t) { return t.omegaDot_BN_B; }},
    {"nonConservativeAccelpntB_B_x,nonConservativeAccelpntB_B_y,nonConservativeAccelpntB_B_z",
     TruthParts::specific_force, [](const Truth& t) { return t.specific_force_B; }},
    {"TotalAccumDV_BN_B_x,TotalAccumDV_BN_B_y,TotalAccumDV_BN_B_z", TruthParts::accumulated_dv,
     [](const Truth& t) { return t.accumulated_dv_B; }},
};

}  // namespace

unsigned parts_of(const Truth& truth) {
  return (truth.has_position && truth.has_velocity ? TruthParts::position : TruthParts::none) |
         (truth.has_angular_acceleration ? TruthParts::angular_acceleration : TruthParts::none) |
         (truth.has_specific_force ? TruthParts::specific_force : TruthParts::none) |
         (truth.accumulated_dv != AccumulatedDv::none ? TruthParts::accumulated_dv : TruthParts::none) |
         (truth.has_temperature ? TruthParts::temperature : TruthParts::none);
}

std::string truth_csv_header(unsigned parts) {
  std::string row = "time_ns";
  for (const Columns& group : columns)
    if ((group.part & ~parts) == 0) row.append(",").append(group.names);
  if ((parts & TruthParts::temperature) != 0) row.append(",temperature_c");
  return row + "\n";
}

std::string truth_csv_row(const Truth& truth, unsigned parts) {
  std::string row = fmt::format("{}", truth.time.ns);
  for (const Columns& group : columns) {
    if ((group.part & ~parts) != 0) continue;
    for (const double component : group.value(truth)) fmt::format_to(std::back_inserter(row), ",{}", component);
  }
  if ((parts & TruthParts::temperature) != 0) fmt::format_to(std::back_inserter(row), ",{}", truth.temperature_c);
  return row + "\n";
}

}  // namespace imud
