// Measurement CSV: one measurement as a row of text, the form that `protocol = "csv"` sends and imu-decode prints.
//
// rad/s, m/s^2, rad, m/s, degrees Celsius, ns; doubles in their shortest form that reads back as the same double; a
// field or a component of a vector that the measurement does not carry is empty. A table of a sensor with
// inclinometers has three more columns.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>

#include "protocols/protocol.hpp"
#include "protocols/wire/shortest_text.hpp"

namespace imud {

// The header row, with its LF.
inline constexpr std::string_view measurement_csv_header =
    "time_ns,counter,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z,dtheta_x,dtheta_y,dtheta_z,dvel_x,dvel_y,dvel_z,"
    "temperature,status\n";

// The same with the specific force by the inclinometers, m/s^2.
inline constexpr std::string_view measurement_csv_header_with_inclination =
    "time_ns,counter,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z,dtheta_x,dtheta_y,dtheta_z,dvel_x,dvel_y,dvel_z,"
    "temperature,status,incl_x,incl_y,incl_z\n";

// Longer than any row: 18 commas, LF, 16 doubles of at most 24 characters, integers of 20, 20 and 10.
inline constexpr std::size_t measurement_csv_row_max = 464;

// Writes a row with its LF; returns its length. `with_inclination`: with the columns of the inclinometers. `digits`:
// see write_rounded().
std::size_t write_measurement_csv(const Measurement& measurement, std::span<char, measurement_csv_row_max> row,
                                  bool with_inclination = false, int digits = all_digits) noexcept;

// Writes a row with all fields of a sample, and its LF; returns its length.
std::size_t write_measurement_csv(const Sample& sample, std::span<char, measurement_csv_row_max> row,
                                  bool with_inclination, int digits) noexcept;

// Reads a row; Sample::inclination is set if the row has it. Requires a row without its line end. Returns false, with
// `measurement` unspecified, if the row is malformed: the row has neither 16 nor 19 columns, a field is not a finite
// number, or only some components of the inclination are empty.
bool read_measurement_csv(std::string_view row, Measurement& measurement) noexcept;

}  // namespace imud
