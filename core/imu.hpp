// Imu: the sensor model of the Basilisk technical memorandum "Inertial Measurement Unit C++ Model", Rev 1.2.
#pragma once

#include <cstdint>

#include "core/earth.hpp"
#include "core/random.hpp"
#include "core/rest.hpp"
#include "core/sample.hpp"
#include "core/timeline.hpp"

namespace imud {

// How a value becomes a multiple of its LSB; `nearest` rounds halves away from zero.
enum class Rounding : std::uint8_t { toward_zero, nearest, away_from_zero };

// The errors of three gyros (unit rad/s), accelerometers (m/s^2) or magnetometers (T), one of a kind on each platform
// axis. They act on the true value m in this order, and on its integral over the step accordingly (core/README.md):
//   m = scale_factor * truth + bias + x,   x <- clamp(A x + P n, +-bound)     (memo Eq. 15, 16, and its section 2)
//   m <- lsb * round(m / lsb)                                                 (Eq. 19)
//   m <- max(-max, min(m, max))                                               (Eq. 20, 21)
struct TriadErrors {
  Vector3 scale_factor = Vector3::Ones();
  Vector3 bias = Vector3::Zero();
  Matrix3 walk_transition = Matrix3::Identity();  // A, per sample: 0 gives white noise, identity a random walk
  Matrix3 walk_sqrt_cov = Matrix3::Zero();        // P, per sample: P P^T is the covariance of one step
  Vector3 walk_bound = Vector3::Zero();           // limit of |x|, not negative; 0: none
  double lsb = 0.0;                               // not negative; 0: no rounding
  Rounding rounding = Rounding::toward_zero;
  bool carry = false;  // the remainder of the rounding is added to the next sample
  double max = 1e6;    // saturation, above 0

  // Returns errors that are only white noise of this density, unit/sqrt(Hz), at the sample rate `rate_hz`.
  static TriadErrors white(double density, double rate_hz, double max);
};

// The errors of a barometer: pressure = truth + bias + noise n, with n normal, N(0, 1); a result below 0 becomes 0.
struct BarometerErrors {
  double bias = 0;   // Pa
  double noise = 0;  // Pa, standard deviation of one sample
};

// The definition of the delta-angle over a step from t1 to t2.
enum class DeltaAngle : std::uint8_t {
  rotation_vector,  // the rotation vector from the platform at t1 to the platform at t2 (Eq. 2-4)
  integral,         // the integral of the rate in the moving platform axes
};

// The definition of the delta-velocity over a step from t1 to t2.
enum class DeltaVelocity : std::uint8_t {
  integral,  // the integral of the specific force in the moving platform axes, as a strapdown accelerometer has it
  memo,  // Eq. 10-14: the sum of each truth's increment in the body axes at its end, and the difference of omega x r
  end_frame,  // the change of the sensor point's velocity without gravity, resolved in the platform at t2
};

// Everything that makes one sensor differ from another. `dcm_PB` is a rotation.
struct ImuModel {
  Vector3 r_SB_B = Vector3::Zero();  // m, the lever arm
  Matrix3 dcm_PB = Matrix3::Identity();
  TriadErrors gyro;
  TriadErrors accelerometer;
  DeltaAngle delta_angle = DeltaAngle::rotation_vector;
  DeltaVelocity delta_velocity = DeltaVelocity::integral;
  double temperature_c = 25.0;
  EarthModel earth;
  TriadErrors magnetometer;
  BarometerErrors barometer;
};

// The Gauss-Markov process of TriadErrors: x <- clamp(A x + P n, +-bound), with n normal, N(0, I). x is 0 before
// sample 0. Does not allocate; not thread-safe.
class GaussMarkov {
 public:
  GaussMarkov(const TriadErrors& errors, Quantity quantity);
  // Returns the error x of sample k, until the next call. The last call was step(k - 1) or seek(k), or k is 0.
  // `normals` must be the same in all calls.
  const Vector3& step(const Normals& normals, std::uint64_t k) noexcept;
  // Makes step(k) return what it returns in the sequence from 0. The time it takes is proportional to k unless A is
  // 0.
  void seek(const Normals& normals, std::uint64_t k) noexcept;

 private:
  Matrix3 transition_;
  Matrix3 sqrt_cov_;
  Vector3 bound_;
  Quantity quantity_;
  bool off_;
  bool diagonal_;
  Normals::Block block_;
  Vector3 x_ = Vector3::Zero();
};

// One sensor: samples a Timeline, or a vehicle at rest, and adds the errors. Nothing here allocates, locks, throws or
// reads a clock. Not thread-safe.
//
// Samples belong to runs. The first sample of a run has no increments; each later one has those since the sample
// before. The counter and the errors continue from run to run, as in a real device.
class Imu {
 public:
  // All random numbers follow from `seed` and `stream`, which is different for every sensor: stream_id() of its name.
  Imu(const ImuModel& model, std::uint64_t seed, std::uint32_t stream);

  // Makes the next sample the first of a run. Must be called when the timeline has begun a new run.
  void begin_run() noexcept { run_ = Run::none; }

  // Integrates the truth up to `until`, so that the timeline may drop the truths before it; no later sample may
  // precede `until`. Needed only where more truths than the timeline keeps lie between two samples. Does nothing
  // outside a run, or if `until` is after the newest truth.
  void advance(const Timeline& timeline, TruthTime until) noexcept;

  // The time up to which truth is integrated: no truth before it is needed any more. It is Timeline::never outside a
  // run, and while the vehicle is at rest.
  TruthTime advanced_to() const noexcept { return run_ == Run::truth ? advanced_.time : Timeline::never; }

  // Returns the sample at `time`, with the device's own time `stamp`. `time` is later than the sample before in this
  // run; `timeline` is not empty.
  Sample sample(const Timeline& timeline, TruthTime time, DeviceTime stamp) noexcept;

  // Returns the sample of a vehicle at rest (core/rest.hpp), for a sensor that has power before the first truth; its
  // status is status::at_rest beside saturation. `since_power_on` is later than that of the sample before, and not
  // negative. The first sample at rest, and the first sample of a truth after it, begin a run: they have no
  // increments, while the counter and the errors continue. With DeltaVelocity::memo, the sensor's step counts as one
  // step of the truth.
  Sample sample_at_rest(Nanoseconds since_power_on, DeviceTime stamp) noexcept;

  // Makes the next sample number k, with the errors that it has in the sequence from 0, except for a carried
  // remainder of rounding. The time it takes is proportional to k where a walk has a memory.
  void seek(std::uint64_t k) noexcept;
  // The number of the next sample.
  std::uint64_t next() const noexcept { return counter_; }

 private:
  struct Triad {
    explicit Triad(const TriadErrors& errors_, Quantity quantity) : errors(errors_), walk(errors_, quantity) {}
    // Adds the errors of sample k to the true `value` and to its true integral over a step of dt s. Returns bit i set
    // if axis i has saturated.
    std::uint32_t apply(const Normals& normals, std::uint64_t k, double dt, Vector3& value,
                        Vector3& increment) noexcept;
    TriadErrors errors;
    GaussMarkov walk;
    Vector3 remainder = Vector3::Zero();
  };

  void accumulate(const Timeline& timeline, const MotionState& end) noexcept;
  void add_piece(const MotionState& end) noexcept;
  Sample sense(const MotionState& now, TruthTime time, bool is_first, DeviceTime stamp) noexcept;
  void sense_earth(const Earth& earth, PositionVelocity position, const MotionState& now, Sample& out) noexcept;
  Vector3 true_delta_angle_B(const MotionState& now) const noexcept;
  Vector3 true_delta_velocity_B(const MotionState& now) const noexcept;

  ImuModel model_;
  Quaternion q_BP_;
  Normals normals_;
  Triad gyro_;
  Triad accelerometer_;
  Earth earth_;
  Rest rest_;
  Triad magnetometer_;
  std::uint64_t counter_ = 0;
  enum class Run : std::uint8_t { none, rest, truth };  // the source of this run's samples; none before its first
  Run run_ = Run::none;
  MotionState last_;            // the state at the last sample, as it was then known
  TruthTime last_time_;         // the time of the last sample; last_'s own differs if the timeline began later
  MotionState advanced_;        // the state at the end of the sums below
  std::uint32_t revision_ = 0;  // Timeline::revision() when advanced_ was computed
  Vector3 angle_sum_B_;         // rad, integral of the rate since last_
  Vector3 velocity_sum_B_;      // m/s, of the specific force of B's origin, as model_.delta_velocity defines it
  Vector3 centripetal_sum_B_;   // m/s, of omega x (omega x r)
};

}  // namespace imud
