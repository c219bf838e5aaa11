// Trajectories of the TUM RGB-D benchmark: rows "timestamp tx ty tz qx qy qz qw", separated by blanks; a row that
// begins with '#' is a remark. s, m, and the rotation from body to world axes.
//
// The recording defines the world. The z axis of the world is assumed to point up, as in the benchmark and in most
// halls with motion capture; x and y count as east and north. `level = "ned"` is for a world whose z axis points
// down, or whose axes are N's. The body axes are used unchanged, unless `body` is given. If the world is a camera's
// first image, the vertical is unknown: rotate such a table first.
#include "protocols/quantities/pose_table.hpp"

namespace imud {
namespace {

constexpr std::string_view columns[] = {"time_s", "r_BN_N_x_m", "r_BN_N_y_m", "r_BN_N_z_m",
                                        "q_NB_x", "q_NB_y",     "q_NB_z",     "q_NB_w"};
constexpr Setting settings[] = {column_order_setting, world_setting, body_setting, accumulated_dv_setting};

}  // namespace

extern constexpr TruthFormat tum_truth_format = {
    .name = "tum",
    .summary = "poses in rows: timestamp tx ty tz qx qy qz qw",
    .document = "TUM RGB-D benchmark, file formats: ground-truth trajectories",
    .delimits_itself = true,
    .settings = settings,
    .make = [](const Settings& chosen) { return make_pose_table(chosen, columns); },
    .force_from = "the columns specific_force_x_m_per_s2 to _z_m_per_s2, by truth.columns",
    .derives = true,
    .way = TruthFormat::Way::file,
    .example_port = "poses.txt",
};

}  // namespace imud
