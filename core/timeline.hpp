// Timeline: keeps the last truths in order and interpolates between them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "core/sample.hpp"
#include "core/truth.hpp"

namespace imud {

namespace status {                                    // beside the bits of sample.hpp
inline constexpr std::uint32_t truth_gap = 1U << 13;  // poses are missing around the sample: its motion is a guess
}

// The motion of the vehicle at one instant (frames: core/README.md).
struct MotionState {
  enum class Basis : std::uint8_t {
    interpolated,  // `time` is at a truth or between two
    extrapolated,  // `time` is after the newest truth, by at most Limits::extrapolate
    held,          // `time` is later still, or before the first truth of the run: the attitude and the specific force
                   // are constant, the rate is zero
  };
  TruthTime time;
  Basis basis = Basis::interpolated;
  Quaternion q_NB = Quaternion::Identity();    // unit; v_N = q_NB * v_B
  Vector3 omega_BN_B = Vector3::Zero();        // rad/s
  Vector3 omegaDot_BN_B = Vector3::Zero();     // rad/s^2
  Vector3 specific_force_B = Vector3::Zero();  // m/s^2, of B's origin
  Vector3 dv_N = Vector3::Zero();              // m/s, integral of the specific force in inertial axes, from an
                                               // arbitrary origin in each run
  // status::rate_derived and status::force_derived of the later truth beside `time`; status::truth_gap between two
  // truths if the later one follows a gap.
  std::uint32_t derived = 0;
};

// The part of a motion state from which increments begin.
struct MotionBegin {
  Quaternion q_NB;
  Vector3 omega_BN_B;  // rad/s
  Vector3 dv_N;        // m/s
};

// Position and velocity of a point in N.
struct PositionVelocity {
  bool is_known = false;
  TruthTime time;  // the instant of r_N and v_N; while motion is held, the last instant before the hold
  Vector3 r_N = Vector3::Zero();  // m
  Vector3 v_N = Vector3::Zero();  // m/s
  // Truth::earth_angle of the truth at `time` or before it; nullopt: the truth does not relate N to the Earth.
  std::optional<double> earth_angle = std::nullopt;
};

// The result of Timeline::push().
enum class Admission : std::uint8_t {
  accepted,   // the truth is now the newest
  inserted,   // accepted: the truth arrived after one of a later time, but its time is after the watermark
  new_run,    // accepted: the timeline has discarded all other truths, and the truth begins a run
  duplicate,  // refused: there is a truth of this instant
  reordered,  // refused: the truth arrived after one of a later time, and its time is not after the watermark
  time_back,  // refused: the truth was sent after the newest, but its time is earlier
  time_jump,  // refused: the truth's time is further ahead of the newest than Limits::max_gap
};

// Between two truths the attitude is q_0 * exp(phi), phi being the cubic Hermite curve on the rotation vector whose
// end slopes are the truths' rates (the second through the inverse right Jacobian); the accumulated velocity is the
// cubic Hermite curve whose end slopes are the specific forces in inertial axes. So attitude, rate and increments
// agree with one another at any truth rate, and sums of increments telescope to the truth's own. The vehicle must
// turn by less than 180 deg between two truths.
//
// Where the rates of both truths are derived from attitudes, and no gap is between them, the curve of the attitude is
// the quintic one that has their angular accelerations as well, so that a derived rate is as exact between two truths
// as at them. (Simulators' own angular accelerations do not always fit their rates.)
//
// Where the truth carries no accumulated velocity, the specific force (linear in body axes) is integrated along the
// attitude curve; where it carries no specific force, the accumulated velocity is linear; with neither, both are 0.
// The angular acceleration is linear between the truths' own; where they carry none, it is linear through the
// differences of their rates.
//
// The constructor allocates all memory; nothing else here allocates, locks or throws. Not thread-safe.
class Timeline {
 public:
  struct Limits {
    // For this long after the newest truth, motion continues with constant angular acceleration and specific force;
    // then it is held. Not negative.
    Nanoseconds extrapolate = std::chrono::milliseconds(100);
    // A truth further ahead of the newest than this is refused as time_jump, unless it completes a restart (below) or
    // gap_begins_run is true.
    // Above 0.
    Nanoseconds max_gap = std::chrono::seconds(60);
    // If true, a truth further ahead than max_gap is not refused but begins a new run: in a capture such a gap is no
    // error of a network.
    bool gap_begins_run = false;
    // If this many truths in a row are refused, each later than the one before by at most max_gap, the simulator was
    // restarted: the last of them begins a new run. The number for truths within 1 s of the newest is higher, because
    // a network may repeat or delay a burst by that much.
    int restart_after_near = 20;
    int restart_after_far = 3;
  };

  explicit Timeline(const Limits& limits);
  Timeline() : Timeline(Limits{}) {}

  const Limits& limits() const noexcept { return limits_; }
  // Replaces Limits::extrapolate.
  void set_extrapolate(Nanoseconds extrapolate) noexcept { limits_.extrapolate = extrapolate; }

  // Adds a truth, which must pass is_finite() and is_in_range(), or refuses it and leaves the timeline as it was. A
  // truth with `new_run` set begins a run, unless it repeats the run's first (the same time and sequence) within a
  // second of it. The motion up to `watermark` has been used and is fixed: a reordered truth is inserted if it is
  // later than the watermark and later than the oldest truth kept (than the second oldest if the timeline is full).
  Admission push(const Truth& truth, TruthTime watermark = never) noexcept;

  // Discards all truths but the newest, which becomes the first of a run. Must not be called if empty().
  void forget_past() noexcept;

  // Returns whether the next truth would displace a truth that at(`time`) needs.
  bool is_full_for(TruthTime time) const noexcept { return count_ == capacity && knot(1).state.time > time; }

  bool empty() const noexcept { return count_ == 0; }
  // Return the times of the run's newest truth, and of its first, which may have been dropped. Must not be called if
  // empty().
  TruthTime newest() const noexcept { return knot(count_ - 1).state.time; }
  TruthTime run_start() const noexcept { return run_start_; }
  // Returns a number that changes with every inserted truth, because at() then changes between the truths beside it.
  std::uint32_t revision() const noexcept { return revision_; }

  // Returns the state at `time`, which may be any. Before the oldest truth kept it is the state at that truth (its
  // `time` as well), or held if that truth is the run's first. Must not be called if empty().
  MotionState at(TruthTime time) const noexcept {
    MotionState other;
    return at(time, other);
  }
  // Returns the same state without a copy where a truth has this `time`: a reference to the kept state, valid until
  // the next push(). Otherwise assigns the state to `other`, and returns `other`.
  const MotionState& at(TruthTime time, MotionState& other) const noexcept;

  // Returns position and velocity of B's origin at `time`: between two truths that carry them, the cubic Hermite
  // curve; unknown if one of the two does not; before the oldest truth, that truth's own. After the newest truth,
  // until motion is held, the velocity changes by the specific force of at(), and by gravitation and the effects of a
  // rotating N, which the last two truths show beside their specific forces. It is constant where these are more than
  // 20 m/s^2, or not known. Must not be called if empty().
  PositionVelocity position(TruthTime time) const noexcept;

  // Return the temperature of the surroundings at `time`, degrees Celsius, a state of the vehicle, in SI, and all
  // that acts on the surroundings beside the temperature: linear between two truths that carry it, after the newest
  // truth and before the oldest one that truth's own; nullopt if the truth there has none. Must not be called if
  // empty().
  std::optional<double> temperature_c(TruthTime time) const noexcept;
  std::optional<double> vehicle(VehicleState state, TruthTime time) const noexcept;
  struct Surroundings {
    std::optional<Vector3> magnetic_field_B;  // T
    std::optional<double> pressure;           // Pa, static
    VehicleStates vehicle;
  };
  Surroundings surroundings(TruthTime time) const noexcept;
  // Return whether any truth of the run carries one of the Surroundings, and whether any relates N to the
  // Earth.
  bool has_surroundings() const noexcept { return has_surroundings_; }
  bool has_earth_angle() const noexcept { return has_earth_angle_; }

  // Returns the time of the first truth after `time`, or `never` if there is none. at() is smooth from `time` to that
  // truth.
  TruthTime next_truth(TruthTime time) const noexcept;

  static constexpr TruthTime never{std::numeric_limits<std::int64_t>::max()};
  static constexpr std::size_t capacity = 1024;  // the number of truths kept

 private:
  struct Knot {
    MotionState state;  // at this truth
    PositionVelocity position;
    std::optional<double> temperature_c, pressure;
    std::optional<Vector3> magnetic_field_B;
    AccumulatedDv accumulated_dv = AccumulatedDv::none;
    Vector3 accumulated_dv_B = Vector3::Zero();
    bool has_specific_force = false;
    bool has_angular_acceleration = false;
    bool is_rate_derived = false, follows_gap = false;
    Vector3 specific_force_N = Vector3::Zero();
    // The curve from the truth before to this one.
    double h_s = 0;                        // the length of the curve; 0 for the first truth of a run
    Vector3 phi = Vector3::Zero();         // rad, whole rotation vector
    Vector3 phi_slope = Vector3::Zero();   // rad/s, d phi/dt at this end
    bool is_quintic = false;               // the curve has the angular accelerations
    Vector3 phi_second = Vector3::Zero();  // rad/s^2, its second derivative at this end
    Vector3 rate_slope = Vector3::Zero();  // rad/s^2, mean; only where the truths give no angular acceleration
    Vector3 omegaDot_begin = Vector3::Zero();
    Vector3 omegaDot_end = Vector3::Zero();
    bool linear_dv = false;
    Vector3 dv_origin_N = Vector3::Zero();  // the accumulated velocity (if inertial) where dv_N is 0
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
  void take_surroundings(const Truth& truth) noexcept;
  static void link(const Knot& before, Knot& knot) noexcept;
  struct Turn;
  static Turn turn(const Knot& begin, const Knot& end, double s) noexcept;
  std::size_t segment_end(TruthTime time) const noexcept;
  static void interpolate(const Knot& begin, const Knot& end, double s, MotionState& state) noexcept;
  MotionState extrapolate(TruthTime time) const noexcept;
  PositionVelocity extrapolate_position(TruthTime time) const noexcept;
  MotionState before_run(TruthTime time) const noexcept;
  // `member` returns an optional value of knot i.
  template <class Member>
  auto linear(Member member, TruthTime time) const noexcept -> decltype(member(0));

  Limits limits_;
  std::vector<Knot> knots_;  // ring
  // The vehicle's states that came with a knot's truth. If `time` is not the knot's, that truth had no states.
  struct VehicleAt {
    TruthTime time = never;
    VehicleStates states;
  };
  std::vector<VehicleAt> vehicles_;  // ring, as the knots
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  bool has_surroundings_ = false;
  bool has_vehicle_ = false;  // any truth so far has a state of the vehicle
  bool has_earth_angle_ = false;
  TruthTime run_start_;
  std::uint32_t run_start_sequence_ = 0;
  std::uint32_t newest_sequence_ = 0;
  std::uint32_t revision_ = 0;
  int refused_in_row_ = 0;
  TruthTime last_refused_;
};

}  // namespace imud
