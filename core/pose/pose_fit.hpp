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

// Fits a polynomial of up to the eighth degree (PolynomialFit) to the truths within +-delay of each truth: to the
// rotation vector relative to its attitude, and to the position, or the velocity where that is given, relative to its
// own. The values and derivatives of the polynomials at that truth are its new state:
//   q_NB = q_NB exp(phi), omega = J_r(phi) phi', omega' = J_r(phi) phi'' (phi is the remainder of the fit, near 0)
//   specific force = q_NB^-1 (a - gravitation),   accumulated velocity = q_NB^-1 (v - v_0 - integral of gravitation)
// Noise of the input, such as its resolution, is averaged over the window. The angular acceleration comes with the
// rate; position and velocity with the specific force.
//
// With Options::widest the window is chosen: `delay` times a power of the square root of 2, for the rate and for the
// force apart, once in each half of `delay`. A wider window has less noise, and follows the motion less well: it is
// taken if that reduces the estimated mean squared error of the derived quantity, over the 16 delays before and as
// much after the truth as the widest window has on a side. Noise alone, of variance s^2, changes the quantity by a
// mean square of s^2 (g - g'), the difference of the two fits' noise gains (J. A. Hausman, Specification tests in
// econometrics, Econometrica 46(6), 1978: the covariance of a fit and a more efficient one is the latter's variance).
// Any excess is an error of the wider window. This window is better while the mean square change is below twice
// that value. It is taken up to four times the value, as the estimates scatter. s^2 is measured from the poses
// (pose_noise.hpp). Coefficients within the noise are reduced then. So windows are wide at rest, and short
// where a motion is fast, or free of noise. Motion faster than a quarter of the rate of the poses counts as
// noise: give a delay for that.
//
// Up to three truths in a row that are off by more than any noise are refused. Each of them is compared with the
// quartic through nine neighbours, 6 before and 3 after them, near an end of the segment as many as there are. Its
// distance is more than 10 times its expected root mean square, by the noise of about the last 100 truths, and also
// its squared distance more than 150 times that by the misfit of the neighbours (1500 times, while fewer than 20
// truths have shown the noise), and it is above 2 mrad or 2 mm (2 mm/s) and above 2^-21 of the position. For normal
// noise in three axes the second condition alone has a probability of 9e-10 (F distribution, 3 and 12 degrees of
// freedom), so that one of the three tests of a truth, alone and as the last of two and three, fails falsely with
// 3e-9 at most; at 1500 times with 4e-15. A kink of the motion (a step of position, velocity or acceleration) has a
// ratio of at most 48, and 81 with two neighbours on one side. With one neighbour or none on a side it must be 1500,
// the steps to and from the truths more than three times those between the neighbours, and the distance more than 200
// m/s^2 or 1000 rad/s^2 explain in the time from the nearest of the many neighbours: a pose at another place is then
// refused, also if the vehicle has leapt there with its last three. There the expected distance is larger: the rms of
// a component is 4, 10 and 23 times the noise for one to three truths beyond the last neighbour, 1.2 to 2.2
// elsewhere. A segment of fewer than ten truths is not tested. Truths of such a group that
// next() has taken before the group's last truth came are not refused.
//
// A window has at least 3 truths on either side, if need be of more than the delay, and at most 256. Near the ends of
// a segment a window has the length of the other windows, or 13 truths, and lies to one side of the truth. There the
// degree depends on the noise and the motion. So the first truths of a segment have more delay. A segment ends with a
// run, a gap (a step longer than the delay and four mean steps), a change of the derived quantities, and at finish().
// The vehicle must turn by less than 180 deg between two truths; a window in which it turns by more than 143 deg (2.5
// rad) is shortened.
//
// The constructor allocates all memory; nothing else here allocates, locks or throws. The same bits on every machine.
// Not thread-safe.
class PoseFit {
 public:
  enum class Source : std::uint8_t {
    given,      // from the truth, or not at all
    automatic,  // derived if the truth does not have it
    derived,
  };
  struct Options {
    Source rate = Source::automatic;
    // The specific force and the accumulated velocity together. A derived one needs a velocity or a position; a
    // position if the gravitation depends on it. Truths without are left as they are.
    Source specific_force = Source::automatic;
    Nanoseconds delay = std::chrono::milliseconds(30);  // above 0; the shortest that may be chosen
    // The exponent of the longest delay that may be chosen, `delay` 2^(widest/2): up to 8, 16 delays; 0: none is
    // chosen. Truths leave after twice that time.
    int widest = 0;
    GravitationModel gravitation = {};
  };

  explicit PoseFit(const Options& options);

  // Adds a truth. Its time must be after the time of the truth before, unless `new_run` is set. next() must have
  // returned false.
  void push(const Truth& truth) noexcept;
  // Ends the segment: no truth is waited for any more.
  void finish() noexcept;
  // Takes the next truth with its derived values, in the order of push(). Returns false if it has to wait for later
  // truths. A truth without derived values does not wait, and is not changed. From positions that no vehicle has, the
  // derived state may fail is_finite() or is_in_range().
  bool next(Truth& truth) noexcept;

  // The noise of the truths since the constructor, and what was chosen, of the rate from attitudes, or of the force
  // from positions or velocities.
  struct Quality {
    std::uint64_t count = 0;   // of the truths that it was derived for
    double noise = 0;          // rms of a component: rad; m, or m/s of velocities
    double derived_noise = 0;  // the same of the derived quantity, if no coefficient is reduced: rad/s; m/s^2
    double shortest_s = 0, mean_s = 0, longest_s = 0;  // delay
  };
  Quality rate_quality() const noexcept { return quality(attitude); }
  Quality force_quality() const noexcept { return quality(place); }

  // Truths that were refused, and the last of them.
  struct Outliers {
    std::uint64_t count = 0;
    TruthTime time;
    double angle = 0, distance = 0;              // from the neighbours, of a run the least clear: rad; m, or m/s
    double angle_bound = 0, distance_bound = 0;  // beyond which it is refused
  };
  const Outliers& outliers() const noexcept { return outliers_; }

  // Returns the frequency, Hz, up to which derived rates and specific forces are less than 3 dB below the true ones,
  // where three truths or more are within `delay`.
  static double bandwidth_hz(Nanoseconds delay) noexcept;
  // Returns 2^(widest/2), the longest delay that may be chosen in shortest ones.
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
    std::size_t known = 0;     // levels, from the first
    bool is_rejected = false;  // by the level after those, beyond doubt
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
  std::size_t next_ = 0;                          // the one that next() takes
  std::size_t segment_ = 0, newest_segment_ = 0;  // the first kept of its segment, and of the newest's
  bool ended_ = false;                            // finish() was called after the newest
  std::vector<Vector3> phi_;                      // rad, of the window's attitudes
  PolynomialFit fit_;
  std::array<std::vector<Probe>, 2> probes_;  // of each quantity, beside items_; empty if none is chosen
  std::size_t probed_ = 0;                    // the first that was not probed yet
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
