// The table of all data fields (mip_sdk e5a847d, data_sensor.h, data_gnss.h, data_filter.h, data_system.h,
// data_shared.h), and their names in the configuration.
#pragma once

#include <algorithm>
#include <array>
#include <string_view>

#include "protocols/mip/mip.hpp"

namespace imud::mip {

// The shared fields 0xD0 and above belong to the 7 series: the manual of the 3DM-GX5-45 (8500-0064 C) does not list
// them, and imu_3dm_gx4 rejects a packet that has one. ArduPilot's driver of the GX5-45 nevertheless takes the GPS
// time of filter and receiver from 0xD3 (MicroStrain_common.cpp, and its own simulation, SIM_MicroStrain.cpp).
// The scale factors belong to the GX5-45: MSCL bc6d5bf, MipNodeFeatures.cpp, lets it estimate them, and not a GX5-25.
// Whether a device of the 7 series has them was not found.
inline constexpr DataField field_table[] = {
    {"acceleration", sensor, 0x04, 12, all},
    {"rate", sensor, 0x05, 12, all},
    {"magnetic_field", sensor, 0x06, 12, all},
    {"delta_angle", sensor, 0x07, 12, all},
    {"delta_velocity", sensor, 0x08, 12, all},
    {"quaternion", sensor, 0x0A, 16, all},
    {"euler", sensor, 0x0C, 12, all},
    {"gps_time", sensor, 0x12, 12, all},
    {"temperature", sensor, 0x14, 12, all},
    {"pressure", sensor, 0x17, 4, all},
    {"overrange", sensor, 0x18, 2, all},
    {"event_source", sensor, 0xD0, 1, series_7},
    {"ticks", sensor, 0xD1, 4, series_7},
    {"delta_ticks", sensor, 0xD2, 4, series_7},
    {"shared_gps_time", sensor, 0xD3, 12, series_7},
    {"delta_time", sensor, 0xD4, 8, series_7},
    {"reference_time", sensor, 0xD5, 8, series_7},
    {"reference_delta", sensor, 0xD6, 8, series_7},
    {"external_time", sensor, 0xD7, 10, series_7},
    {"external_delta", sensor, 0xD8, 10, series_7},

    {"gnss_position", gnss, 0x03, 42, with_receiver},
    {"gnss_position_ecef", gnss, 0x04, 30, with_receiver},
    {"gnss_velocity", gnss, 0x05, 34, with_receiver},
    {"gnss_dop", gnss, 0x07, 30, with_receiver},
    {"gnss_utc", gnss, 0x08, 13, with_receiver},
    {"gnss_gps_time", gnss, 0x09, 12, with_receiver},
    {"gnss_fix", gnss, 0x0B, 6, with_receiver},
    {"gnss_hardware", gnss, 0x0D, 5, gx5_45},
    {"gnss_leap_seconds", gnss, 0x11, 3, gq7},
    {"gnss_shared_gps_time", gnss, 0xD3, 12, with_receiver},
    {"gnss_reference_time", gnss, 0xD5, 8, gq7},
    {"gnss_reference_delta", gnss, 0xD6, 8, gq7},

    {"filter_position", filter, 0x01, 26, ins},
    {"filter_velocity", filter, 0x02, 14, ins},
    {"filter_quaternion", filter, 0x03, 18, all},
    {"filter_matrix", filter, 0x04, 38, all},
    {"filter_euler", filter, 0x05, 14, all},
    {"filter_gyro_bias", filter, 0x06, 14, all},
    {"filter_accelerometer_bias", filter, 0x07, 14, ins},
    {"filter_position_uncertainty", filter, 0x08, 14, ins},
    {"filter_velocity_uncertainty", filter, 0x09, 14, ins},
    {"filter_euler_uncertainty", filter, 0x0A, 14, all},
    {"filter_gyro_bias_uncertainty", filter, 0x0B, 14, all},
    {"filter_accelerometer_bias_uncertainty", filter, 0x0C, 14, ins},
    {"filter_linear_acceleration", filter, 0x0D, 14, all},
    {"filter_rate", filter, 0x0E, 14, all},
    {"filter_status", filter, 0x10, 6, all},
    {"filter_gps_time", filter, 0x11, 12, all},
    {"filter_quaternion_uncertainty", filter, 0x12, 18, all},
    {"filter_gravity", filter, 0x13, 14, all},
    {"filter_gyro_scale", filter, 0x16, 14, gx5_45},
    {"filter_accelerometer_scale", filter, 0x17, 14, gx5_45},
    {"filter_gyro_scale_uncertainty", filter, 0x18, 14, gx5_45},
    {"filter_accelerometer_scale_uncertainty", filter, 0x19, 14, gx5_45},
    {"filter_acceleration", filter, 0x1C, 14, all},
    {"filter_position_ecef", filter, 0x40, 26, ins},
    {"filter_aiding_summary", filter, aiding_summary, 7, cv7_ins | gq7},  // one of each aid
    {"filter_dual_antenna", filter, 0x49, 17, gq7},
    {"filter_shared_gps_time", filter, 0xD3, 12, series_7 | gx5_45},
    {"filter_reference_time", filter, 0xD5, 8, series_7},
    {"filter_reference_delta", filter, 0xD6, 8, series_7},
    {"filter_event_source", filter, 0xD0, 1, series_7},
    {"filter_external_time", filter, 0xD7, 10, series_7},

    {"", system, 0x02, 2, series_7},
    {"", system, 0x03, 1, series_7},
    {"", system, 0xD0, 1, series_7},
    {"", system, 0xD3, 12, series_7},
    {"", system, 0xD5, 8, series_7},
    {"", system, 0xD6, 8, series_7},
    {"", system, 0xD7, 10, series_7},
};

// The names of a set's fields in the configuration: "default", then the fields in the order of the table.
inline constexpr std::string_view default_name = "default";
template <std::uint8_t set>
inline constexpr auto field_names = [] {
  constexpr auto is_named = [](const DataField& field) { return field.set == set && !field.name.empty(); };
  constexpr auto count = static_cast<std::size_t>(std::ranges::count_if(field_table, is_named));
  std::array<std::string_view, count + 1> names = {default_name};
  std::size_t next = 1;
  for (const DataField& field : field_table)
    if (is_named(field)) names[next++] = field.name;
  return names;
}();

}  // namespace imud::mip
