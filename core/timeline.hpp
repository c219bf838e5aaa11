// Timeline: the last few truths in order, and what was true at any instant between them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/truth.hpp"

namespace imud {

// The vehicle at one instant.
struct MotionState {
  enum class Basis : std::uint8_t {
    interpolated,  // between two truths, or at one
    extrapolated,  // after the newest truth
    held,          // so long after it, or before a run's first, that motion is frozen: attitude constant, rate zero,
                   // specific force constant
  };
  TruthTime time;
  Basis basis = Basis::interpolated;
  Quaternion q_NB = Quaternion::Identity();
  Vector3 omega_BN_B = Vector3::Zero();        // rad/s
  Vector3 omegaDot_BN_B = Vector3::Zero();     // rad/s^2
  Vector3 specific_force_B = Vector3::Zero();  // m/s^2, of B's origin
  Vector3 dv_N = Vector3::Zero();              // m/s, accumulated specific force of B's origin, in inertial axes
};

// Where a point is, and how fast.
struct PositionVelocity {
  bool is_known = false;
  TruthTime time;                 // of these; while motion is held, of its last moment
  Vector3 r_N = Vector3::Zero();  // m
  Vector3 v_N = Vector3::Zero();  // m/s
};

// What the timeline made of a truth.
enum class Admission : std::uint8_t {
  accepted,
  inserted,   // accepted: it was overtaken on its way, but nobody has looked yet at where it belongs
  new_run,    // accepted, and the timeline begins anew with it
  duplicate,  // this instant is there already
  reordered,  // older than the newest: it was overtaken on its way, and is too late
  time_back,  // sent later than the newest, but its time is earlier
  time_jump,  // further ahead of the newest than `max_gap`
};

// Between two truths the attitude is q_0 * exp(phi), phi being the cubic Hermite curve on the rotation vector whose
// end slopes are the truths' rates (the second through the inverse right Jacobian); the accumulated velocity is the
// cubic Hermite curve whose end slopes are the specific forces in inertial axes. So attitude, rate and increments
// agree with one another at any truth rate, and sums of increments telescope to the truth's own. Between two truths
// the vehicle turns by less than 180 deg.
//
// Where the truth carries no accumulated velocity, the specific force (linear in body axes) is integrated along the
// attitude curve; where it carries no specific force, the accumulated velocity is linear; with neither, both are 0.
// Angular acceleration is linear between the truths' own; where they give none, it follows from their rates.
//
// All memory is taken by the constructor. One thread.
class Timeline {
 public:
  struct Limits {
    // After the newest truth: constant angular acceleration and specific force for so long, then held.
    Nanoseconds extrapolate = std::chrono::milliseconds(100);
    // A truth further ahead than this is refused as time_jump (but see `restart_after`). Above 0.
    Nanoseconds max_gap = std::chrono::seconds(60);
    // So many truths in a row that are refused as duplicate, reordered, time_back or time_jump, each later than the
    // one before, are a simulator that was restarted: the last of them begins a new run. The network alone may
    // repeat or delay a burst, but not by more than a second.
    int restart_after_near = 20;  // within 1 s of the newest
    int restart_after_far = 3;
  };

  explicit Timeline(const Limits& limits);
  Timeline() : Timeline(Limits{}) {}

  // `truth` must pass is_finite() and is_in_range(). A truth with `new_run` begins anew, unless it repeats the run's
  // first one (its time and sequence) within a second of it. `watermark`: what was true up to then is in use already
  // and does not change any more; a truth that was overtaken is taken in if it is later.
  Admission push(const Truth& truth, TruthTime watermark = never) noexcept;

  // Forgets all but the newest truth: the simulator's time has leapt, and a run begins with it.
  void forget_past() noexcept;

  // Whether the next truth would push out one that at(`time`) still needs.
  bool is_full_for(TruthTime time) const noexcept { return count_ == capacity && knot(1).state.time > time; }

  bool empty() const noexcept { return count_ == 0; }
  // Of the run's newest truth and of its very first; only if not empty().
  TruthTime newest() const noexcept { return knot(count_ - 1).state.time; }
  TruthTime run_start() const noexcept { return run_start_; }
  // Changes when what at() gives between the oldest and the newest truth does.
  std::uint32_t revision() const noexcept { return revision_; }

  // The state at `time`, however late or early: held where there is no truth. What was forgotten for want of room is
  // the state at the oldest truth kept. Not if empty().
  MotionState at(TruthTime time) const noexcept;

  // Of B's origin at `time`: between two truths that know it the cubic Hermite curve on position and velocity; after
  // the newest with its velocity, until motion is held. Unknown between a truth that knows it and one that does not.
  // Not if empty().
  PositionVelocity position(TruthTime time) const noexcept;

  // The first truth after `time`, or `never` if there is none: what at() gives is smooth up to there.
  TruthTime next_truth(TruthTime time) const noexcept;

  static constexpr TruthTime never{std::numeric_limits<std::int64_t>::max()};
  static constexpr std::size_t capacity = 1024;  // truths kept

 private:
  struct Knot {
    MotionState state;  // at this truth
    PositionVelocity position;
    AccumulatedDv accumulated_dv = AccumulatedDv::none;
    Vector3 accumulated_dv_B = Vector3::Zero();
    bool has_specific_force = false;
    bool has_angular_acceleration = false;
    Vector3 specific_force_N = Vector3::Zero();
    // The curve from the truth before to this one; h_s = 0 for the first of a run.
    double h_s = 0;
    Vector3 phi = Vector3::Zero();         // rad, whole rotation vector
    Vector3 phi_slope = Vector3::Zero();   // rad/s, of the curve at this end
    Vector3 rate_slope = Vector3::Zero();  // rad/s^2, mean; only where the truths give no angular acceleration
    Vector3 omegaDot_begin = Vector3::Zero();
    Vector3 omegaDot_end = Vector3::Zero();
    bool linear_dv = false;
    Vector3 dv_origin_N = Vector3::Zero();  // what an inertial accumulated velocity counts from
  };

  const Knot& knot(std::size_t i) const noexcept { return knots_[(first_ + i) % capacity]; }
  Knot& knot(std::size_t i) noexcept { return knots_[(first_ + i) % capacity]; }
  bool is_whole() const noexcept { return knot(0).state.time == run_start_; }
  Admission classify(const Truth& truth) const noexcept;
  void begin_run(const Truth& truth) noexcept;
  void append(const Truth& truth) noexcept;
  void insert(const Truth& truth) noexcept;
  Knot& make_room(std::size_t i) noexcept;
  static void place(const Truth& truth, Knot& knot) noexcept;
  static void link(const Knot& before, Knot& knot) noexcept;
  std::size_t segment_end(TruthTime time) const noexcept;
  static MotionState interpolate(const Knot& begin, const Knot& end, double s) noexcept;
  MotionState extrapolate(TruthTime time) const noexcept;
  MotionState before_run(TruthTime time) const noexcept;

  Limits limits_;
  std::vector<Knot> knots_;  // ring
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  TruthTime run_start_;
  std::uint32_t run_start_sequence_ = 0;
  std::uint32_t newest_sequence_ = 0;
  std::uint32_t revision_ = 0;
  int refused_in_row_ = 0;
  TruthTime last_refused_;
};

}  // namespace imud
