// AllanSolver: least squares of the terms of an Allan deviation.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "tools/allan/allan_curve.hpp"
#include "tools/allan/allan_term_list.hpp"

namespace imud {

using TermSet = unsigned;  // a set of terms: bits in the order of allan_term_list
inline constexpr TermSet all_terms = (1U << allan_term_count) - 1;
inline constexpr Eigen::Index flicker_column = 2;
inline constexpr TermSet quantization_bit = 1U << 0U;
inline constexpr TermSet ramp_bit = 1U << 4U;

constexpr bool contains(TermSet set, std::size_t term) noexcept { return ((set >> term) & 1U) != 0; }

// A solution: the squares of the coefficients, the resulting variances, and the variances' uncertainty.
struct AllanSolution {
  TermSet active = 0;
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(allan_term_count);
  Eigen::VectorXd noise;        // expected variance at each point, without the ramp
  Eigen::VectorXd model;        // with the ramp
  Eigen::VectorXd uncertainty;  // variance of the measured variance
};

class AllanSolver {
 public:
  AllanSolver(const AllanCurve& curve, double from_s, double to_s);

  bool is_possible() const noexcept { return measured_.size() >= 2 && measured_.minCoeff() > 0; }
  AllanSolution solve(TermSet allowed) const;
  // Chooses the misfit for which the residuals of the solution have the expected size.
  void choose_misfit();
  double misfit() const noexcept { return misfit_; }
  // Chooses the averaging time from which on flicker is flat: the time for which the solution with these terms is
  // closest to the points. Chooses 0, flat at all times, if no other time is clearly closer.
  void choose_flicker_band(TermSet allowed);
  double flicker_from_s() const noexcept { return flicker_from_; }

  struct Estimate {
    double square = 0;    // of the coefficient; may be negative
    double variance = 0;  // of `square`
    double skewness = 0;  // of its distribution
  };
  // Estimates a term together with the solution's terms. The estimate's distribution is computed from the
  // solution's noise alone.
  Estimate estimate(std::size_t term, const AllanSolution& solution) const;

 private:
  Eigen::VectorXd weighted_squares(TermSet set, const Eigen::VectorXd& weights) const;
  Eigen::ArrayXd density(const AllanSolution& solution) const;
  double deviance(const AllanSolution& solution) const;
  void set_flicker_band(double from_s);
  Eigen::ArrayXd flicker_densities(double from_s) const;
  double distance_with_band(double from_s, TermSet allowed);

  AllanKind kind_;
  double period_;
  double length_;
  double misfit_ = 0;
  Eigen::VectorXd measured_;  // the variance of each point
  Eigen::VectorXd degrees_;   // the degrees of freedom of each point, by the identified noise
  Eigen::MatrixXd spread_;    // sqrt(2/degrees) of each point, for each term as the only noise
  Eigen::MatrixXd unit_;      // a row for each point, a column for each term
  Eigen::ArrayXd frequency_;  // Hz, in equal steps of the logarithm
  Eigen::ArrayXd step_;       // Hz, of the integral over the frequency
  Eigen::MatrixXd gain_;      // a column for each point: its response to the density
  // s, the shortest and longest averaging time that choose_flicker_band() tries as the start of the flat part
  double first_band_, last_band_;
  double flicker_from_ = 0;
  Eigen::ArrayXd flicker_density_;                 // relative to B^2/(2 pi f)
  Eigen::VectorXd flicker_unit_, flicker_spread_;  // the columns of unit_ and spread_, without a band
  // The derivative of the flicker column of unit_ by the logarithm of the band; empty before a band is chosen.
  Eigen::VectorXd flicker_change_;
};

}  // namespace imud
