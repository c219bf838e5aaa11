// Samples of a unit whose own navigation filter aligns, is aided by fixes, and coasts without them.
#pragma once

#include <cmath>

#include "core/sample.hpp"
#include "core/units.hpp"

namespace imud {

// The deviations of a solution: of tilt and heading, deg; of velocity, m/s; of position, m.
struct PhaseSigmas {
  double tilt_deg = 0.2, heading_deg = 0.8, velocity = 0.1, position = 1;
};

// Gives a known place the line of two antennas with this azimuth, rad, level.
inline Sample with_antennas(const Sample& known, double azimuth, double sigma) {
  Sample sample = known;
  sample.navigation.antennas = {.direction_L = {std::cos(azimuth), std::sin(azimuth), 0}, .sigma = sigma};
  return sample;
}

// All functions take a sample whose place is known and true.
inline Sample aligning(const Sample& known, bool has_fix = true) {
  Sample sample = known;
  Solution& solution = sample.solution.emplace();
  solution.attitude.setConstant(static_cast<float>(units::pi));
  solution.receiver = has_fix ? known.navigation : Navigation{};
  sample.navigation = {};
  return sample;
}

inline Sample navigating(const Sample& known, Solution::State state, const PhaseSigmas& sigmas) {
  Sample sample = known;
  const auto of_axes = [](double horizontal, double down) {
    return Eigen::Vector3f(static_cast<float>(horizontal), static_cast<float>(horizontal), static_cast<float>(down));
  };
  Solution& solution = sample.solution.emplace();
  solution.state = state;
  solution.attitude = of_axes(sigmas.tilt_deg * units::degree, sigmas.heading_deg * units::degree);
  solution.velocity = of_axes(sigmas.velocity, sigmas.velocity);
  solution.position = of_axes(sigmas.position, sigmas.position);
  return sample;
}
inline Sample aided(const Sample& known, const PhaseSigmas& sigmas = {}) {
  Sample sample = navigating(known, Solution::State::aided, sigmas);
  sample.solution->receiver = known.navigation;
  return sample;
}
// The same between two epochs of a receiver, whose last fix is so old, and was made so many samples ago.
inline Sample between_fixes(const Sample& known, Nanoseconds age, std::uint32_t since_epoch = 30) {
  Sample sample = aided(known);
  sample.solution->has_epochs = true;
  sample.solution->receiver.age = age;
  sample.solution->since_epoch = since_epoch;
  return sample;
}
inline Sample coasting(const Sample& known, double since_fix_s, const PhaseSigmas& sigmas = {}) {
  Sample sample = navigating(known, Solution::State::coasting, sigmas);
  sample.solution->since_fix_s = static_cast<float>(since_fix_s);
  return sample;
}

}  // namespace imud
