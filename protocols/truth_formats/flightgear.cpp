// FlightGear's generic protocol as text, --generic=socket,out,HZ,ADDR,PORT,udp,NAME, or a file of it: rows of numbers
// in the order of the chunks in Protocol/NAME.xml. Two files are shipped (FGDATA, read at 0508a7a0):
//
// insgns-imu: time (s), p, q, r (JSBSim's pi, qi, ri: relative to inertial space, rad/s, 6 decimals), x, y, z of the
//   pilot's acceleration (specific force at the eye point, m/s^2, 5 decimals). There is no attitude: it is
//   integrated.
// insgns-truth: time, latitude, longitude (rad), altitude (m, negative), velocity north, east, down (m/s), and yaw,
//   pitch, roll (rad, 5 decimals). There is no rate: it is derived, with the accuracy that steps of 1e-5 rad permit.
//
// Chunks of type float are read as float32. The time of both files has 4 decimals; from 2048 s on, the steps of a
// float32 are coarser: 0.24 ms.
//
// The setting `columns` gives the chunks of another protocol in their order. Rows leave with FlightGear's frames.
#include "protocols/quantities/pose_table.hpp"

namespace imud {
namespace {

constexpr std::string_view protocols[] = {"insgns-imu", "insgns-truth"};
constexpr std::string_view imu_columns[] = {"time_s",
                                            "p_rad_per_s",
                                            "q_rad_per_s",
                                            "r_rad_per_s",
                                            "specific_force_x_m_per_s2",
                                            "specific_force_y_m_per_s2",
                                            "specific_force_z_m_per_s2"};
constexpr std::string_view truth_columns[] = {"time_s",          "latitude_rad",   "longitude_rad",  "-height_m",
                                              "v_north_m_per_s", "v_east_m_per_s", "v_down_m_per_s", "yaw_rad",
                                              "pitch_rad",       "roll_rad"};

constexpr Setting settings[] = {
    text_setting("protocol", "the protocol that is shipped with FlightGear; `columns` takes its place", protocols[0],
                 protocols),
    column_order_setting,
    level_setting,
    body_setting,
    accumulated_dv_setting,
};

std::unique_ptr<TruthDecoder> make(const Settings& chosen) {
  if (chosen.text("protocol") == protocols[0]) return make_pose_table(chosen, imu_columns);
  return make_pose_table(chosen, truth_columns);
}

}  // namespace

extern constexpr TruthFormat flightgear_truth_format = {
    .name = "flightgear",
    .summary = "rows of FlightGear's generic protocol: insgns-imu, insgns-truth, or any by its columns",
    .document = "FlightGear, Docs/README.protocol; FGDATA Protocol/insgns-imu.xml and insgns-truth.xml",
    .delimits_itself = true,
    .settings = settings,
    .make = make,
    .force_from = "insgns-imu, or columns specific_force_x_m_per_s2 to _z",
    .derives = true,
};

}  // namespace imud
