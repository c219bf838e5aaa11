// truth_csv: truth as rows of text, which the truth format "csv" reads.
#pragma once

#include <string>
#include <string_view>

#include "core/truth.hpp"

namespace imud {

// The header row, with its LF.
inline constexpr std::string_view truth_csv_header =
    "time_ns,r_BN_N_x,r_BN_N_y,r_BN_N_z,v_BN_N_x,v_BN_N_y,v_BN_N_z,sigma_BN_1,sigma_BN_2,sigma_BN_3,"
    "omega_BN_B_x,omega_BN_B_y,omega_BN_B_z,omegaDot_BN_B_x,omegaDot_BN_B_y,omegaDot_BN_B_z,"
    "nonConservativeAccelpntB_B_x,nonConservativeAccelpntB_B_y,nonConservativeAccelpntB_B_z,"
    "TotalAccumDV_BN_B_x,TotalAccumDV_BN_B_y,TotalAccumDV_BN_B_z\n";

// Returns a row, with its LF. Each double has the shortest text that is read back as the same double.
std::string truth_csv_row(const Truth& truth);

}  // namespace imud
