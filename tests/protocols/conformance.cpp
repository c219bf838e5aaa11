#include "tests/protocols/conformance.hpp"

namespace imud {
namespace {

constexpr ConformanceSettings bosch_mm7_settings[] = {{}, {"axes=right_handed"}};
const Conformance bosch_mm7("bosch-mm7", {.settings = bosch_mm7_settings});

constexpr double temperature_lsb = 0x1p-8;
// FD: the LSB of a float32 is 2^-24 of the number; the test uses numbers up to 1.
constexpr ConformanceSettings native_can_settings[] = {
    {""},
    {"extended=true can_id=419419136"},
    {"fd=true",
     [](Protocol& entry) {
       entry.resolution = {.rate = 0x1p-24,
                           .specific_force = 0x1p-24,
                           .delta_angle = 0x1p-24,
                           .delta_velocity = 0x1p-24,
                           .temperature_c = temperature_lsb};
       entry.range = {.rate = 1,
                      .specific_force = 1,
                      .delta_angle = 1,
                      .delta_velocity = 1,
                      .temperature_c = 0x1p7 - temperature_lsb};
       entry.time_period_ns = 0;
       entry.counter_bits = 32;
       entry.status_bits = 0xFFFF;
     }},
};
const Conformance native_can("native-can", {.settings = native_can_settings});

constexpr ConformanceSettings nos3_imu_settings[] = {{"with_requests=true"}};
constexpr std::string_view nos3_imu_bodies[] = {"00F#8000", "00F#8001", "00F#8002", "00F#8003",
                                                "00F#8004", "00F#80FF", "00F#R"};
const Conformance nos3_imu("nos3-imu", {.settings = nos3_imu_settings,
                                        .host = {.frame = [](std::string_view body) { return std::string(body); },
                                                 .bodies = nos3_imu_bodies,
                                                 .last = "00F#8002",
                                                 .answer = "000#7FFFFFF87FFFFFD0"}});

constexpr ConformanceSettings sbg_can_settings[] = {
    {""},
    {"messages=imu_gyro,imu_info,imu_accel,status_01,status_02,status_03,utc_0,utc_1,ekf_quat,ekf_euler,"
     "ekf_orientation_acc,ekf_pos,ekf_altitude,ekf_pos_acc,ekf_vel_ned,ekf_vel_ned_acc,ekf_vel_body,mag_0,mag_1,"
     "air_data_info,air_data_altitude,gps1_vel_info,gps1_vel,gps1_vel_acc,gps1_course,gps1_pos_info,gps1_pos,"
     "gps1_pos_alt,gps1_pos_acc "
     "output_rate_hz=50"},
    {"extended=true id_offset=419430400 identifiers=imu_accel=0x711"},
};
const Conformance sbg_can("sbg-can", {.settings = sbg_can_settings});

constexpr ConformanceSettings xsens_can_settings[] = {
    {""},
    {"messages=sample_time,group_counter,status_word,quaternion_ned,euler_ned,delta_v,delta_q,rate_of_turn_hr,"
     "acceleration_hr,free_acceleration,magnetic_field,temperature,pressure,position,altitude,velocity "
     "extended=true",
     [](Protocol& entry) {
       entry.fields |= Measurement::delta_velocity;
       entry.resolution.delta_velocity = 0x1p-17;
       entry.range.delta_velocity = 0.249;
     }},
};
const Conformance xsens_can("xsens-can", {.settings = xsens_can_settings});

}  // namespace
}  // namespace imud
