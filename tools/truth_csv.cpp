#include "tools/truth_csv.hpp"

#include <fmt/format.h>

#include <iterator>

#include "core/attitude.hpp"

namespace imud {

std::string truth_csv_row(const Truth& truth) {
  std::string row = fmt::format("{}", truth.time.ns);
  for (const Vector3& vector : {truth.r_BN_N, truth.v_BN_N, mrp_from_quaternion(truth.q_NB), truth.omega_BN_B,
                                truth.omegaDot_BN_B, truth.specific_force_B, truth.accumulated_dv_B})
    for (const double component : vector) fmt::format_to(std::back_inserter(row), ",{}", component);
  row += '\n';
  return row;
}

}  // namespace imud
