// PoseFit: derives the rate and the specific force of truths that lack them, from attitudes, positions and
// velocities.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/earth/gravitation.hpp"
#include "core/pose/polynomial_fit.hpp"
#include "core/truth.hpp"

namespace imud {

// For each truth, fits polynomials in time (PolynomialFit) to the truths within +-delay of this truth. One polynomial
// fits the rotation vectors relative to the attitude of this truth. Another fits the velocities relative to its
// velocity, or the positions relative to its position where no velocity is given. The values and derivatives of the
// polynomials at the truth's time are the new state of the truth:
//   q_NB = q_NB exp(phi), omega = J_r(phi) phi', omega' = J_r(phi) phi'' (phi is the remainder of the fit, near 0)
//   specific force = q_NB^-1 (a - gravitation),   accumulated velocity = q_NB^-1 (v - v_0 - integral of gravitation)
// Noise of the input, such as its resolution, is averaged over the window. The fit gives the angular acceleration
// together with the rate, and position and velocity together with the specific force.
//
// The choice of the window: with Options::widest above 0, the half width of a window is `delay` times a power of the
// square root of 2. The power is chosen for the rate and for the force separately, once in each half of `delay`. A
// wider window has less noise, and follows the motion less well. It is taken if it reduces the estimated mean squared
// error of the derived quantity. The estimate covers the 16 delays before the truth, and after the truth as much as
// the widest window has on a side. With noise alone, of variance s^2, the mean square of the difference between the
// results of two windows is s^2 (g - g'), where g and g' are the noise gains of the two fits (J. A. Hausman,
// Specification tests in econometrics, Econometrica 46(6), 1978: the covariance of a fit and a more efficient fit is
// the variance of the latter). Any excess is an error of the wider window. The wider window is better while the mean
// square of the difference is below 2 s^2 (g - g'). It is taken up to 4 s^2 (g - g'), because the estimates scatter.
// s^2 is measured from the poses (pose_noise.hpp). With a chosen window, coefficients within the noise are reduced,
// too. As a result, windows are wide at rest, and short where the motion is fast, or the poses free of noise. Motion
// faster than a quarter of the rate of the poses counts as noise: for such motion, set `delay` and leave `widest` 0.
//
// Outliers: a group of up to three truths in a row is refused if its distance from the motion of its neighbours is
// larger than noise explains. The motion is the quartic polynomial that fits nine neighbours: 6 before and 3 after
// the group; near an end of the segment, fewer on this side and more on the other. All these conditions must hold,
// for the truth of the group with the smallest ratio (DeletedResidual):
// - The distance is more than 10 times its expected root mean square, by the noise of about the last 100 truths.
// - The ratio of the squared distance to its expected square, by the misfit of the neighbours, is above 150, or above
//   1500 while fewer than 20 truths have shown the noise.
// - The distance is above 2 mrad, 2 mm or 2 mm/s, and above 2^-21 of the position or velocity.
// Normal noise in three axes meets the second condition with a probability of 9e-10 (F distribution, 3 and 12 degrees
// of freedom), or 4e-15 at a ratio of 1500. A truth is tested three times: alone, as the last of two, and as the last
// of three. Noise alone thus refuses a truth with a probability of at most 3e-9. A kink of the motion (a step of
// position, velocity or acceleration) has a ratio of at most 48, or 81 with two neighbours on one side.
// A group with fewer than two neighbours on a side must meet further conditions. The ratio is above 1500. The steps
// to and from the group are more than three times the steps between the neighbours. The distance is larger than 200
// m/s^2 or 1000 rad/s^2 explain in the time between the outermost truth of the group and the nearest neighbour on the
// other side. Up to three last poses at another place are thus refused, even if the vehicle really leapt there. The
// expected distance is larger near an end: the rms of a component is 4, 10 and 23 times the noise for one, two and
// three truths beyond the last neighbour, and 1.2 to 2.2 times the noise elsewhere.
// A segment of fewer than ten truths is not tested. Truths of a group that next() took before the last truth of the
// group came are not refused.
//
// A window has at least 3 truths on either side, even if these are further away than the delay, and at most 256. Near
// the ends of a segment a window has the length of the other windows, or 13 truths, and lies to one side of the
// truth. There the degree of the polynomial depends on the noise and the motion. The first truths of a segment thus
// wait longer. A segment ends with a run, at a gap (a step longer than the delay and four mean steps), at a change of
// the derived quantities, and at finish(). The vehicle must turn by less than 180 deg between two truths; a window in
// which the vehicle turns by more than 143 deg (2.5 rad) is shortened.
//
// The constructor allocates all memory; no other function allocates, locks or throws. The results have the same bits
// on every machine. Not thread-safe.
class PoseFit {
 public:
  enum class Source : std::uint8_t {
    given,      // from the truth, or not at all
    automatic,  // derived if the truth does not have it
    derived,
  };
  struct Options {
    Source rate = Source::automatic;
    // The specific force and the accumulated velocity together. A derived force needs a velocity or a position, and
    // needs a position if the gravitation depends on the position. Truths without these are not changed.
    Source specific_force = Source::automatic;
    Nanoseconds delay = std::chrono::milliseconds(30);  // above 0; the shortest that may be chosen
    // The longest delay that may be chosen is `delay` 2^(widest/2). 0 to 8 (16 delays); with 0 no delay is chosen.
    // Truths leave after twice the longest delay.
    int widest = 0;
    GravitationModel gravitation = {};
  };

  explicit PoseFit(const Options& options);

  // Adds a truth. Its time must be after the time of the truth before, unless `new_run` is set. next() must have
  // returned false.
  void push(const Truth& truth) noexcept;
  // Ends the segment: next() then waits for no further truth.
  void finish() noexcept;
  // Takes the next truth with its derived values, in the order of push(). Returns false if it has to wait for later
  // truths. A truth without derived values does not wait, and is not changed. From positions that no vehicle has, the
  // derived state may fail is_finite() or is_in_range().
  bool next(Truth& truth) noexcept;

  // The noise of the truths and the chosen delays since the constructor: for the rate from attitudes, or for the
  // force from positions or velocities.
  struct Quality {
    std::uint64_t count = 0;  // truths for which the quantity was derived
    double noise = 0;         // rms of a component: rad; m, or m/s of velocities
    // rms of a component of the derived quantity, if no coefficient is reduced: rad/s; m/s^2
    double derived_noise = 0;
    double shortest_s = 0, mean_s = 0, longest_s = 0;  // delay
  };
  Quality rate_quality() const noexcept { return quality(attitude); }
  Quality force_quality() const noexcept { return quality(place); }

  // The number of refused truths, and the figures of the last refused group.
  struct Outliers {
    std::uint64_t count = 0;
    TruthTime time;
    // Distance from the motion of the neighbours: rad; m, or m/s. In a group, the distance of the truth that is the
    // least clear outlier.
    double angle = 0, distance = 0;
    double angle_bound = 0, distance_bound = 0;  // larger distances are refused
  };
  const Outliers& outliers() const noexcept { return outliers_; }

  // Returns the frequency, Hz, up to which derived rates and specific forces are less than 3 dB below the true ones,
  // where three truths or more are within `delay`.
  static double bandwidth_hz(Nanoseconds delay) noexcept;
  // Returns 2^(widest/2): the longest delay that may be chosen, relative to the shortest.
  static double widest_factor(int widest) noexcept;

 private:
  static constexpr std::size_t least = 3, most = 256;  // truths on one side
  static constexpr std::size_t least_at_end = 12;      // beside the truth, near the ends of a segment
  static constexpr std::size_t capacity = 2048;
  static constexpr std::size_t longest_run = 3;  // of outliers
  static constexpr std::size_t levels = 9;       // of the delay; number k is `delay` 2^(k/2)
  enum Quantity : std::uint8_t { attitude, place };
  static constexpr std::array<Quantity, 2> quantities = {attitude, place};
  struct Item {
    Truth truth;
    bool begins_segment = false;
    bool derives_rate = false, derives_force = false;
    std::array<double, 2> noise = {-1.0, -1.0};  // noise_energy() around it, of each quantity; negative: not known

    bool derives(Quantity quantity) const noexcept { return quantity == attitude ? derives_rate : derives_force; }
  };
  // The derived quantity at a truth by the windows of each level, not reduced.
  struct Probe {
    std::size_t known = 0;     // number of levels that have been fitted, from the first
    bool is_rejected = false;  // the next level is beyond doubt wrong
    std::array<Vector3, levels> value;
    std::array<double, levels> gain{};
  };
  struct Tally {
    double noise = 0, derived = 0, delay_s = 0, shortest_s = 0, longest_s = 0;
    std::uint64_t noises = 0, count = 0;
    double recent = 0;  // noise energy, exponential mean
  };
  struct Window {
    std::size_t first, last;
  };
  // Truths in a row that may be outliers.
  struct Group {
    std::size_t first = 0, count = 0;
  };
  struct Suspect {
    double ratio = 0, distance = 0, bound = 0;
    Quantity quantity = attitude;
    Group group = {};
  };

  const Item& item(std::size_t i) const noexcept { return items_[(oldest_ + i) % capacity]; }
  double since_s(std::size_t i) const noexcept { return seconds(item(i).truth.time - item(next_).truth.time); }
  bool begins_segment(Item& newest) const noexcept;
  bool find_window(double delay_s, Window& window) const noexcept;
  template <class Value>
  PolynomialFit::Derivatives fit(const Window& window, Value value) noexcept;
  void derive_rate(Window window, Truth& truth) noexcept;
  void derive_force(const Window& window, Truth& truth) noexcept;
  void count_derived(Quantity quantity, double gain) noexcept;
  Quality quality(Quantity quantity) const noexcept;

  // pose_fit_noise.cpp
  Vector3 value_of(Quantity quantity, std::size_t origin, std::size_t i) const noexcept;
  double size_of(Quantity quantity, std::size_t i) const noexcept;
  bool refuse_outliers() noexcept;
  void refuse_outliers_at_end() noexcept;
  bool refuse_outliers(std::size_t begin, std::size_t end, std::size_t from, std::size_t to) noexcept;
  void test(Quantity quantity, const Group& group, std::size_t begin, std::size_t end,
            Suspect& suspect) const noexcept;
  static double explained(Quantity quantity, bool is_velocity, double span_s) noexcept;
  void estimate_noise() noexcept;
  // pose_fit_choice.cpp
  std::size_t segment_end() const noexcept;
  double shortest_s() const noexcept;
  bool has_all_ahead() const noexcept;
  void choose() noexcept;
  void probe(Quantity quantity, std::size_t i, std::size_t end, double delay_s) noexcept;
  std::size_t choose(Quantity quantity, std::size_t end, double delay_s) const noexcept;
  void advance() noexcept;
  void drop_oldest() noexcept;

  Options options_;
  double delay_s_;
  std::vector<Item> items_;  // ring
  std::size_t oldest_ = 0, count_ = 0;
  std::size_t next_ = 0;  // the truth that next() takes
  // The first kept truth of the segment of next_, and of the segment of the newest truth.
  std::size_t segment_ = 0, newest_segment_ = 0;
  bool ended_ = false;        // finish() was called after the newest truth
  std::vector<Vector3> phi_;  // rad, of the window's attitudes
  PolynomialFit fit_;
  std::array<std::vector<Probe>, 2> probes_;  // of each quantity, beside items_; empty if none is chosen
  std::size_t probed_ = 0;                    // the first truth that was not probed yet
  std::array<double, 2> chosen_s_ = {};       // delay
  std::array<Tally, 2> tallies_;
  Outliers outliers_;

  // The last truth of the run whose specific force was derived.
  bool has_last_ = false;
  TruthTime last_time_;
  Vector3 last_r_N_, last_v_N_;
  Vector3 dv_N_ = Vector3::Zero();  // m/s, accumulated since the first of the run
};

}  // namespace imud
