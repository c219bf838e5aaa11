// The errors of an imu's sensors for people: their Allan parameters in the units of data sheets.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "core/allan_terms.hpp"
#include "core/imu.hpp"

namespace imud {

// A triad and the factors from SI to the units in which data sheets give its terms.
struct TriadTerms {
  struct Unit {
    double si;
    const char* name;
  };
  const char* name;
  std::array<AllanTerms, 3> axes;
  Unit N, B, K, Q, R;

  // Returns for example "N 0.15 deg/sqrt(h), B 0.5 deg/h"; each axis where they differ; empty if all are 0.
  std::string text() const;
};

// Returns those of the gyros and the accelerometers.
std::vector<TriadTerms> triad_terms(const ImuModel& model);

}  // namespace imud
