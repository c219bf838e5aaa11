// PoseFit: derives the rate and the specific force of truths that lack them, from attitudes, positions and
// velocities.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/gravitation.hpp"
#include "core/polynomial_fit.hpp"
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
// A window has at least 3 truths on either side, if need be of more than the delay, and at most 256. Near the ends of
// a segment it has the length of the others, or 13 truths, and lies to one side; there the degree depends on the
// noise and the motion. So the first truths of a segment have more delay. A segment ends with a run, a gap (a step
// longer than the delay and four mean steps), a change of what is derived, and at finish(). The vehicle must turn by
// less than 180 deg between two truths; where it turns by more than 143 deg (2.5 rad) within a window, that is
// shortened.
//
// The constructor allocates all memory; nothing else here allocates, locks or throws. The same bits on every machine.
// Not thread-safe.
class PoseFit {
 public:
  enum class Source : std::uint8_t {
    given,      // as the truth has it, or not at all
    automatic,  // derived if the truth does not have it
    derived,
  };
  struct Options {
    Source rate = Source::automatic;
    // The specific force and the accumulated velocity together. A derived one needs a velocity or a position; a
    // position if the gravitation depends on it. Truths without are left as they are.
    Source specific_force = Source::automatic;
    Nanoseconds delay = std::chrono::milliseconds(30);  // above 0
    GravitationModel gravitation = {};
  };

  explicit PoseFit(const Options& options);

  // Adds a truth, which is later than the one before unless it has `new_run` set. next() must have returned false.
  void push(const Truth& truth) noexcept;
  // Ends the segment: no truth is waited for any more.
  void finish() noexcept { ended_ = true; }
  // Takes the next truth with what is derived, in the order of push(). Returns false if it has to wait for further
  // ones; a truth of which nothing is derived does not wait, and is not changed. From positions that no vehicle has,
  // the derived state may fail is_finite() or is_in_range().
  bool next(Truth& truth) noexcept;

  // Returns the frequency, Hz, up to which derived rates and specific forces are less than 3 dB below the true ones,
  // where three truths or more are within `delay`.
  static double bandwidth_hz(Nanoseconds delay) noexcept;

 private:
  static constexpr std::size_t least = 3, most = 256;  // truths on one side
  static constexpr std::size_t least_at_end = 12;      // beside the truth, near the ends of a segment
  static constexpr std::size_t capacity = 1024;
  struct Item {
    Truth truth;
    bool begins_segment = false;
    bool derives_rate = false, derives_force = false;
  };
  struct Window {
    std::size_t first, last;
  };

  const Item& item(std::size_t i) const noexcept { return items_[(oldest_ + i) % capacity]; }
  double since_s(std::size_t i) const noexcept { return seconds(item(i).truth.time - item(next_).truth.time); }
  bool begins_segment(const Item& newest) const noexcept;
  bool find_window(Window& window) const noexcept;
  template <class Value>
  PolynomialFit::Derivatives fit(const Window& window, Value value) noexcept;
  void derive_rate(Window window, Truth& truth) noexcept;
  void derive_force(const Window& window, Truth& truth) noexcept;
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

  // The last truth of the run whose specific force was derived.
  bool has_last_ = false;
  TruthTime last_time_;
  Vector3 last_r_N_, last_v_N_;
  Vector3 dv_N_ = Vector3::Zero();  // m/s, accumulated since the first of the run
};

}  // namespace imud
