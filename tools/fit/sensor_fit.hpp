// fit_sensor: bias, scale factor, misalignment, acceleration sensitivity and their change with temperature, from the
// means of three sensors in dwells.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "core/allan_terms.hpp"
#include "core/vector.hpp"

namespace imud {

// u is rad/s or m/s^2. The mean of a sensor in a dwell, and the true input, force and temperature in this dwell.
struct DwellMean {
  double middle_s = 0, length_s = 0;
  Vector3 input = Vector3::Zero();  // u, in the axes of the fixture
  Vector3 force = Vector3::Zero();  // m/s^2; of gyros
  double temperature = 0;           // degrees from the reference
  Vector3 mean = Vector3::Zero();   // u
  Vector3 white =
      Vector3::Zero();  // u^2, the variance of the mean by the scatter within the dwells, and by its digits
};

// The standard deviations of the fixture.
struct FixtureErrors {
  double scale = 0;      // relative, of all inputs together
  double angle_rad = 0;  // of the attitude in each dwell
};

// Row i of  m = b + M x + G f + b1 T + s1 T (M x)_i  (IEEE Std 952-1997, IEEE Std 1293-2018, without the terms of
// higher order).
enum class FitTerm : std::uint8_t { bias, x, y, z, g_x, g_y, g_z, bias_by_temperature, scale_by_temperature };
inline constexpr std::size_t fit_terms = 9;

struct AxisFit {
  struct Parameter {
    double value = 0;             // in SI; the nominal value if it is unobservable
    std::optional<double> sigma;  // nullopt: the dwells do not determine the term
  };
  std::array<Parameter, fit_terms> parameters;
  std::size_t wanted = 0, rank = 0;  // the numbers of terms that the dwells vary, and of independent terms
  double condition = 0;              // of the fitted terms, each scaled to length 1; 0: none was fitted
  double chi_square = 0;             // of the residuals
  std::size_t degrees = 0;           // of freedom
  double error_factor = 1;  // by which the standard errors were enlarged; 1: the noise explains the residuals

  const Parameter& operator[](FitTerm term) const noexcept { return parameters[static_cast<std::size_t>(term)]; }
};

// Fits each axis by generalised least squares, first with the nominal M and then with the fitted one in the last
// term: the dwells' means share the flicker noise and the random walk of `noise`, whose covariance follows from their
// times. A term that a combination of other terms hides, or that no dwell varies, is not fitted; a change with
// temperature that would hide a term without temperature is not fitted, and taken as 0. If the residuals are larger
// than the standard errors explain, with a probability below 1e-3, the standard errors are enlarged accordingly.
std::array<AxisFit, 3> fit_sensor(const std::vector<DwellMean>& dwells, const std::array<AllanTerms, 3>& noise,
                                  const FixtureErrors& fixture, bool has_g_sensitivity);

}  // namespace imud
