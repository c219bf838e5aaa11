// The errors of an imu's sensors for people: their Allan parameters in the units of data sheets.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "core/allan_terms.hpp"
#include "core/imu.hpp"

namespace imud {

// The unit in which data sheets give a term.
struct AllanUnit {
  double si;
  const char* name;
};

// The words and units of one member of AllanTerms.
struct AllanWords {
  char letter;
  const char* name;
  double AllanTerms::*value;
  AllanUnit gyro, accelerometer;
};
// Returns the rows of all terms, in the order of AllanTerms.
std::span<const AllanWords> allan_words() noexcept;

// The terms of a triad.
struct TriadTerms {
  const char* name;
  std::array<AllanTerms, 3> axes;
  AllanUnit AllanWords::*units;            // the units of the triad's quantity
  Vector3 turn_on_bias = Vector3::Zero();  // in SI
  Matrix3 g_sensitivity = Matrix3::Zero();
  ConstantErrors unit_sigma = {}, turn_on_sigma = {};

  // Returns for example "random walk N 0.15 deg/sqrt(h), bias instability B 0.753 deg/h, minimum 0.5 deg/h"; each
  // axis where they differ; empty if all are 0. The minimum is told beside B: AllanTerms::minimum().
  std::string text() const;
  // Returns the terms that are constant while power is on, such as "turn-on bias 1800 deg/h, 7 deg/h/g by
  // acceleration, drawn for the unit: scale factor 500 ppm", as the largest of the axes; empty if there is none.
  std::string bias_text() const;
};

// Returns the terms of the gyros, the accelerometers, and the inclinometers, if there are any.
std::vector<TriadTerms> triad_terms(const ImuModel& model);

// The filters of a triad, and the rate at which they run, Hz.
struct TriadFilter {
  const char* name;
  SensorFilter filter;
  FirTaps taps;
  double rate_hz;

  // Returns the group delay of axis 0 to 2, of both, s.
  double delay_s(int axis) const;
  // Returns for example "low-pass of order 2 at 262 Hz, group delay 0.859 ms"; each axis where they differ; "none".
  std::string text() const;
};

// Returns the filters of the gyros, the accelerometers, the magnetometers, and the inclinometers, if there are any.
std::vector<TriadFilter> triad_filters(const ImuModel& model);

}  // namespace imud
