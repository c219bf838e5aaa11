// Ground truth of the EuRoC micro aerial vehicle datasets, state_groundtruth_estimate0/data.csv: rows of a time stamp
// (ns), position p_RS_R (m), quaternion q_RS (w first; from body to world axes) and velocity v_RS_R (m/s); further
// columns, the biases of the dataset's own sensor, are not used. A row that begins with '#' is a remark.
//
// The world and the body are as in tum.cpp: the dataset's world, from a Leica or Vicon system, has its z axis up. A
// table of poses alone (leica0, vicon0) needs `columns`.
#include "protocols/quantities/pose_table.hpp"

namespace imud {
namespace {

constexpr std::string_view columns[] = {"time_ns",          "r_BN_N_x_m",       "r_BN_N_y_m",      "r_BN_N_z_m",
                                        "q_NB_w",           "q_NB_x",           "q_NB_y",          "q_NB_z",
                                        "v_BN_N_x_m_per_s", "v_BN_N_y_m_per_s", "v_BN_N_z_m_per_s"};
constexpr Setting settings[] = {column_order_setting, world_setting, body_setting, accumulated_dv_setting};

}  // namespace

extern constexpr TruthFormat euroc_truth_format = {
    .name = "euroc",
    .summary = "poses and velocities in rows: EuRoC's ground truth",
    .document = "Burri et al., The EuRoC micro aerial vehicle datasets, IJRR 2016; state_groundtruth_estimate0",
    .delimits_itself = true,
    .settings = settings,
    .make = [](const Settings& chosen) { return make_pose_table(chosen, columns); },
    .force_from = "the columns specific_force_x_m_per_s2 to _z_m_per_s2, by truth.columns",
    .derives = true,
    .way = TruthFormat::Way::file,
    .example_port = "data.csv",
};

}  // namespace imud
