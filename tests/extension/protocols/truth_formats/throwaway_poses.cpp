// A truth format of no simulator: rows of time, attitude, rate and specific force, with a semicolon between two
// numbers.
#include "protocols/quantities/pose_table.hpp"

namespace imud {
namespace {

constexpr std::string_view columns[] = {"time_s",
                                        "q_NB_w",
                                        "q_NB_x",
                                        "q_NB_y",
                                        "q_NB_z",
                                        "p_rad_per_s",
                                        "q_rad_per_s",
                                        "r_rad_per_s",
                                        "specific_force_x_m_per_s2",
                                        "specific_force_y_m_per_s2",
                                        "specific_force_z_m_per_s2"};
constexpr Setting settings[] = {column_order_setting, world_setting, body_setting, accumulated_dv_setting};

}  // namespace

extern constexpr TruthFormat throwaway_poses_truth_format = {
    .name = "throwaway-poses",
    .summary = "rows of a table, of a test",
    .document = "this file",
    .delimits_itself = true,
    .settings = settings,
    .make = [](const Settings& chosen) { return make_pose_table(chosen, columns); },
    .force_from = "the columns specific_force_x_m_per_s2 to _z, which every row has",
    .way = TruthFormat::Way::file,
    .example_port = "poses.txt",
};

}  // namespace imud
