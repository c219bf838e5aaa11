// Imu: the sensor model of the Basilisk technical memorandum "Inertial Measurement Unit C++ Model", Rev 1.2.
#pragma once

#include <cstdint>

#include "core/earth.hpp"
#include "core/random.hpp"
#include "core/rest.hpp"
#include "core/sample.hpp"
#include "core/timeline.hpp"

namespace imud {

enum class Rounding : std::uint8_t { toward_zero, nearest, away_from_zero };  // nearest: half away from zero

// Errors of a triad: three gyros in rad/s, accelerometers in m/s^2, or magnetometers in T. In the order in which they
// act:
//   m = scale_factor * truth + bias + x,   x <- clamp(A x + P n, +-bound)     (memo Eq. 15, 16, and its section 2)
//   m <- lsb * round(m / lsb)                                                 (Eq. 19)
//   m <- max(-max, min(m, max))                                               (Eq. 20, 21)
struct TriadErrors {
  Vector3 scale_factor = Vector3::Ones();
  Vector3 bias = Vector3::Zero();
  Matrix3 walk_transition = Matrix3::Identity();  // A, per sample: 0 gives white noise, identity a random walk
  Matrix3 walk_sqrt_cov = Matrix3::Zero();        // P, per sample: P P^T is the covariance of one step
  Vector3 walk_bound = Vector3::Zero();           // hard limit of |x|; 0: none
  double lsb = 0.0;                               // 0: no rounding
  Rounding rounding = Rounding::toward_zero;
  bool carry = false;  // the remainder of the rounding goes into the next sample
  double max = 1e6;    // above 0

  // White noise of this density, unit/sqrt(Hz), at `rate_hz`, and nothing else.
  static TriadErrors white(double density, double rate_hz, double max);
};

// pressure = truth + bias + noise n.
struct BarometerErrors {
  double bias = 0;   // Pa
  double noise = 0;  // Pa, standard deviation of one sample
};

enum class DeltaAngle : std::uint8_t {
  rotation_vector,  // of the rotation from the platform at t1 to the platform at t2 (Eq. 2-4)
  integral,         // of the rate
};

enum class DeltaVelocity : std::uint8_t {
  integral,   // of the specific force in the moving platform axes
  memo,       // Eq. 10-14: each truth's increment in the body axes at its end, and the difference of omega x r
  end_frame,  // change of the sensor point's velocity without gravity, resolved in the platform at t2
};

struct ImuModel {
  Vector3 r_SB_B = Vector3::Zero();  // m
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

// x <- clamp(A x + P n).
class GaussMarkov {
 public:
  GaussMarkov(const TriadErrors& errors, Quantity quantity);
  // The error of sample k, given that of sample k - 1 was the last one asked for (or seek(k) was called). `normals`
  // is always the same.
  const Vector3& step(const Normals& normals, std::uint64_t k) noexcept;
  // Makes step(k) give what it gives in the sequence from 0. Time grows with k unless A is 0.
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

// One sensor. Nothing here allocates, locks, throws or reads a clock. One thread.
class Imu {
 public:
  // `stream` tells this imu's random numbers from another's: stream_id() of its name.
  Imu(const ImuModel& model, std::uint64_t seed, std::uint32_t stream);

  // The next sample begins a run: it has no increments. Counter and errors go on as in a real device.
  void begin_run() noexcept { run_ = Run::none; }

  // Takes in the truth up to `until`, which is not after the newest truth nor after the next sample. Needed only if
  // more truths than the timeline keeps lie between two samples.
  void advance(const Timeline& timeline, TruthTime until) noexcept;

  // No truth before this time is needed any more; Timeline::never before the first sample of a run.
  TruthTime advanced_to() const noexcept { return run_ == Run::truth ? advanced_.time : Timeline::never; }

  // The sample at `time`, which is after the sample before; `timeline` is not empty.
  Sample sample(const Timeline& timeline, TruthTime time, DeviceTime stamp) noexcept;

  // The sample of a vehicle at rest (core/rest.hpp), for a sensor that has power before the first truth; its status
  // is status::at_rest beside saturation. `since_power_on` is later than that of the sample before, and not negative.
  // The first sample at rest, and the first sample of a truth after it, begin a run: they have no increments, while
  // the counter and the errors continue. With DeltaVelocity::memo the sensor's step stands for the truth's.
  Sample sample_at_rest(Nanoseconds since_power_on, DeviceTime stamp) noexcept;

  // The next sample is number k, with the errors it has in the sequence from 0 (save a carried rounding remainder).
  void seek(std::uint64_t k) noexcept;
  std::uint64_t next() const noexcept { return counter_; }

 private:
  struct Triad {
    explicit Triad(const TriadErrors& errors_, Quantity quantity) : errors(errors_), walk(errors_, quantity) {}
    // Adds the errors to the true `value` and to its true integral over the step; returns a bit per saturated axis.
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
  enum class Run : std::uint8_t { none, rest, truth };  // what the last sample of this run was taken from
  Run run_ = Run::none;
  MotionState last_;            // at the last sample, as it was output
  TruthTime last_time_;         // which is not last_'s if that truth is kept no longer
  MotionState advanced_;        // how far the sums below go
  std::uint32_t revision_ = 0;  // of the timeline that said so
  Vector3 angle_sum_B_;         // integral of the rate since last_
  Vector3 velocity_sum_B_;      // of the specific force of B's origin, by model_.delta_velocity
  Vector3 centripetal_sum_B_;   // of omega x (omega x r)
};

}  // namespace imud
