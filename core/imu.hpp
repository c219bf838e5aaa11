// Imu: the sensor model of the Basilisk technical memorandum "Inertial Measurement Unit C++ Model", Rev 1.2.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "core/clock/oscillator.hpp"
#include "core/clock/stamp_error.hpp"
#include "core/earth/earth.hpp"
#include "core/environment/barometer.hpp"
#include "core/environment/temperature.hpp"
#include "core/environment/vibration.hpp"
#include "core/navigation_errors.hpp"
#include "core/numbers/lanes.hpp"
#include "core/numbers/normal_stock.hpp"
#include "core/numbers/random.hpp"
#include "core/rest.hpp"
#include "core/sample.hpp"
#include "core/size_effect.hpp"
#include "core/timeline.hpp"
#include "core/triad.hpp"

namespace imud {

// The definition of the delta-angle over a step from t1 to t2.
enum class DeltaAngle : std::uint8_t {
  rotation_vector,  // the rotation vector from the platform at t1 to the platform at t2 (Eq. 2-4)
  integral,         // the integral of the rate in the moving platform axes
};

// The definition of the delta-velocity over a step from t1 to t2.
enum class DeltaVelocity : std::uint8_t {
  integral,  // the integral of the specific force in the moving platform axes, as a strapdown accelerometer measures
             // it
  memo,  // Eq. 10-14: the sum of each truth's increment in the body axes at its end, and the difference of omega x r
  end_frame,  // the change of the sensor point's velocity without gravity, resolved in the platform at t2
};

// Everything that makes one sensor differ from another. `dcm_PB` is a rotation.
struct ImuModel {
  double rate_hz = 100;  // the nominal sample rate, above 0
  // Gyros, accelerometers and inclinometers are sampled this many times as often, at least 1, at equal intervals: a
  // sample has the value of the last of these internal samples, and the sum of their increments. Densities of noise
  // are sampled at the internal rate, and filters run at it; the parameters of GaussMarkov are per internal sample.
  int internal_samples = 1;
  Vector3 r_SB_B = Vector3::Zero();  // m, the lever arm
  Matrix3 dcm_PB = Matrix3::Identity();
  // rad, standard deviations of a rotation phi of the platform from dcm_PB, about each of the platform's axes. The
  // rotation is drawn once for the unit: v_P = exp(-phi) dcm_PB v_B.
  Vector3 alignment_sigma = Vector3::Zero();
  TriadErrors gyro;
  TriadErrors accelerometer;
  Matrix3 accelerometer_positions = Matrix3::Zero();  // m, row i: from S to accelerometer i, in platform axes
  DeltaAngle delta_angle = DeltaAngle::rotation_vector;
  DeltaVelocity delta_velocity = DeltaVelocity::integral;
  // The most by which a sample is taken before its nominal instant; not negative, below the sample period.
  Nanoseconds sampling_jitter{0};
  // The time from the truth that a sample measures to the instant and the stamp of the sample; not negative. Before
  // the first truth of a run the vehicle stands still in this truth's attitude, with its specific force: the
  // delta-velocity over the first truth has the begin of the rotation, omega x r, of a sensor with a lever arm.
  Nanoseconds sampling_delay{0};
  // Imu does not use these two. The owner of the clock applies them to the instants and stamps that it passes to
  // Imu::sample().
  OscillatorModel oscillator;
  StampErrorModel stamp_error;
  VibrationModel vibration;
  double temperature_c = 25.0;  // of the sensor, unless the temperature model has another
  TemperatureModel temperature;
  EarthModel earth;
  TriadErrors magnetometer;
  std::optional<TriadErrors> inclinometer;        // m/s^2; nullopt: the sensor has no inclinometers
  Vector3 current_field = Vector3::Zero();        // T/A, platform axes: the field of the vehicle's electric current
  Vector3 current_field_sigma = Vector3::Zero();  // T/A, standard deviation from unit to unit, not negative
  BarometerErrors barometer;
  NavigationErrors navigation;
  std::vector<Cause> causes;  // of correlations between the drawn errors of the triads; of different names
};

// Returns the period of the internal samples, s.
inline double internal_period_s(const ImuModel& model) noexcept {
  return 1.0 / (model.internal_samples * model.rate_hz);
}

// Returns the rotation vector by which the unit's platform differs from dcm_PB, rad.
Vector3 drawn_alignment(const ImuModel& model, const Normals& normals) noexcept;
// Returns the difference of the unit's field of a current from current_field, T/A.
Vector3 drawn_current_field(const ImuModel& model, const Normals& normals) noexcept;

// One sensor: samples a Timeline, or a vehicle at rest, and adds the errors. Nothing here allocates, locks, throws or
// reads a clock. Not thread-safe.
//
// With a sampling jitter J, sample k is taken at the instant time - u J, u uniform in (0, 1). It is never later, and
// needs no truth that has not arrived. Its increments begin at the true instant of the sample before. The first
// sample of a run, and samples at rest, are not moved.
//
// The internal samples lie at multiples of the nominal internal period after the last sample; any beyond the next
// sample are taken at its time. In the first sample of a run they all have its time. The sum of the true increments
// is the increment as ImuModel defines it over the whole step, except that the memo's DeltaVelocity also has a piece
// for each internal sample.
//
// Samples belong to runs. The first sample of a run has no increments. Each later sample has the increments since the
// last. The counter and the errors continue from run to run, as in a real device.
//
// A sample at the time of the sample before is held: the simulator stands still, and the sensor goes on. Its attitude
// and its specific force are constant, its rate and its delta-angle are zero, its delta-velocity covers a nominal
// period. When time goes on, the next sample has the whole rotation since the first held sample. Its delta-velocity
// leaves out the part of the held samples, as far as time has caught up. The sum is the vehicle's own, plus the force
// for as long as the simulator stood still.
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
  TruthTime advanced_to() const noexcept {
    if (run_ != Run::truth) return Timeline::never;
    return is_held() ? sampled_ : advanced_.time;
  }

  // Draws the errors that differ from one power on to the next (TriadErrors::turn_on_bias and turn_on_sigma).
  // `number` counts the power ons; an Imu begins with number 0. The other errors continue.
  void power_on(std::uint64_t number) noexcept;
  // The supply goes off: the sensor cools down until power_on(). Samples may go on.
  void power_off() noexcept { temperature_.power_off(time_since_power_on()); }

  // Allocates memory for set_filters(): boxcars of one stage and at most this length.
  void reserve_filters(int length);
  // Replaces the model's filters; each settles on its next value.
  void set_filters(const SensorFilters& filters) noexcept;

  // Replace TriadErrors::bias of a quantity (rate, specific force or magnetic field) from the next sample on.
  void set_bias(Quantity quantity, const Vector3& bias) noexcept;
  const Vector3& bias(Quantity quantity) const noexcept;
  // Replaces the seed: each sample from the next one on has the random numbers of `seed` for it. Errors with a memory
  // continue from their values. Numbers drawn once, for the unit, at power on or for the vibration, stay.
  void set_seed(std::uint64_t seed) noexcept;

  // Adds stocks of random numbers for `samples` samples, from which the coming samples take their numbers as far as
  // another thread has filled them. The stocks must outlive the last sample. Allocates; where there is no memory,
  // the program ends.
  void take_numbers_from(std::deque<NormalStock>& stocks, std::size_t samples);

  // Replaces `before` between two samples. The run, the counter, the increments since the last sample and the random
  // numbers continue, and so do the errors with a memory, as far as their parameters allow (triad_step.hpp). Both
  // must have the same definitions of the increments. A bias that set_bias() has replaced is not kept.
  void continue_from(const Imu& before) noexcept;

  // Returns the sample at `time`, with the device's own time `stamp`. `time` must not be before the last sample
  // of this run; a sample at the same time is held. `timeline` must not be empty.
  Sample sample(const Timeline& timeline, TruthTime time, DeviceTime stamp) noexcept {
    time = time - model_.sampling_delay;
    const bool is_around_hold = time <= sampled_ || (held_.count() | may_catch_up_.count()) != 0;
    if (is_around_hold && run_ == Run::truth) [[unlikely]]
      return sample_around_hold(timeline, time, stamp);
    return sample_moving(timeline, time, stamp);
  }

  // Returns the sample of a vehicle at rest (core/rest.hpp), for a sensor that has power before the first truth; its
  // status is status::at_rest beside saturation. `since_power_on` increases from sample to sample, and is not
  // negative. The first sample at rest, and the first sample of a truth after it, begin a run: they have no
  // increments, while the counter and the errors continue. With DeltaVelocity::memo, the sensor's step counts
  // as one step of the truth.
  Sample sample_at_rest(Nanoseconds since_power_on, DeviceTime stamp) noexcept;

  // Makes the next sample number k, with the errors that sample k has in the sequence from sample 0, except for a
  // carried remainder of rounding. The run time is proportional to k where a walk has a memory.
  void seek(std::uint64_t k) noexcept;
  // The motion of the last sample, without any error, in platform axes: rad/s and m/s^2. Zero before the first one.
  const Vector3& true_rate() const noexcept { return true_rate_; }
  const Vector3& true_specific_force() const noexcept { return true_specific_force_; }
  // The nominal rate of the samples.
  double rate_hz() const noexcept { return model_.rate_hz; }
  // The number of the next sample.
  std::uint64_t next() const noexcept { return counter_; }

 private:
  [[gnu::noinline]] Nanoseconds jitter() const noexcept;
  // The output of gyros and accelerometers.
  struct Measured {
    Vector3 rate, specific_force, delta_angle, delta_velocity;
    std::uint32_t status = 0;
  };
  // The internal samples since the last sample, where there is more than one to a sample.
  struct Internal {
    int taken = 0;
    TruthTime time;             // of the newest of them, or of the last sample
    double since_power_on = 0;  // s, of the last sample
    // The sums of the increments in platform axes, true and measured, and the saturation.
    Vector3 true_delta_angle = Vector3::Zero(), true_delta_velocity = Vector3::Zero();
    Vector3 delta_angle = Vector3::Zero(), delta_velocity = Vector3::Zero();
    std::uint32_t status = 0;
  };
  bool has_internal() const noexcept { return model_.internal_samples > 1; }
  bool has_internal_left() const noexcept { return internal_.taken + 1 < model_.internal_samples; }
  double time_since_power_on() const noexcept {
    return static_cast<double>(static_cast<std::int64_t>(counter_ - powered_on_)) * period_s_;
  }
  std::uint64_t internal_number() const noexcept {
    return counter_ * static_cast<std::uint64_t>(model_.internal_samples) +
           static_cast<std::uint64_t>(internal_.taken);
  }
  TruthTime next_internal() const noexcept;
  void take_internal(const Timeline& timeline, TruthTime until) noexcept;
  void take_internal(const MotionState& now, TruthTime time) noexcept;
  void measure_last(const MotionState& now, TruthTime time, bool is_first, Vector3 delta_angle,
                    Vector3 delta_velocity, Sample& out) noexcept;
  std::uint32_t incline(TriadStep step) noexcept;
  template <bool Rare, class Out>
  void measure(const MotionState& now, TruthTime time, std::uint64_t k, double dt, double since_power_on,
               bool begins_run, Lanes delta_angle, Lanes delta_velocity, Out& out) noexcept;
  struct Disturbed {
    Vector3 rate, delta_angle, specific_force, delta_velocity;
  };
  [[gnu::noinline]] void disturb(const MotionState& now, TruthTime time, double dt, Disturbed& input) noexcept;
  Lanes true_delta_angle(const MotionState& now) const noexcept;
  Lanes true_delta_velocity(const MotionState& now) const noexcept;
  bool is_held() const noexcept { return held_.count() > 0; }
  Sample sample_held(const Timeline& timeline, DeviceTime stamp) noexcept;
  Sample sample_moving(const Timeline& timeline, TruthTime time, DeviceTime stamp) noexcept;
  Sample sample_around_hold(const Timeline& timeline, TruthTime time, DeviceTime stamp) noexcept;
  void finish_slowly(const Timeline& timeline, const MotionState& now, Sample& out) noexcept;
  void end_hold() noexcept;
  void catch_up(TruthTime time) noexcept;
  void finish(const Timeline& timeline, const MotionState& now, TruthTime time, Sample& out) noexcept;
  Sample sense_slowly(const MotionState& now, TruthTime time, bool is_first, DeviceTime stamp) noexcept;
  void accumulate(const Timeline& timeline, const MotionState& end) noexcept;
  void add_piece(const MotionState& end) noexcept;
  Sample sense(const MotionState& now, TruthTime time, bool is_first, DeviceTime stamp) noexcept;
  void sense_surroundings(const Timeline& timeline, const MotionState& now, TruthTime time, Sample& out) noexcept;
  // `given` takes the place of the models of the Earth.
  void sense_earth(const Earth& earth, PositionVelocity position, const Timeline::Surroundings& given,
                   const MotionState& now, Sample& out) noexcept;
  void delay(const Timeline& timeline, const MotionState& now, Navigation& navigation) const noexcept;
  void move_to_sensor(const MotionState& state, PositionVelocity& position) const noexcept;
  void draw_constants() noexcept;
  template <class Visit>
  void each_sequence(Visit visit) noexcept;  // Triad::each_sequence()
  void follow_truth(const Timeline& timeline, TruthTime time) noexcept;
  void update_surroundings() noexcept;
  Lanes true_delta_angle_B(const MotionState& now) const noexcept;
  Lanes true_delta_velocity_B(const MotionState& now) const noexcept;

  ImuModel model_;
  LaneMatrix dcm_PB_;
  Quaternion q_BP_;
  Normals normals_;
  Normals unit_normals_;         // of the errors that were drawn once for the unit
  Normals power_on_normals_;     // of the errors that were drawn at the last power on
  std::uint64_t power_ons_ = 0;  // before the present one
  Vibration vibration_;
  Triad gyro_;
  Triad accelerometer_;
  SizeEffect size_effect_;
  Earth earth_;
  Rest rest_;
  Triad magnetometer_;
  std::optional<Triad> inclinometer_;
  Vector3 inclination_ = Vector3::Zero();  // m/s^2, the last value of inclinometer_
  Temperature temperature_;
  std::optional<double> surroundings_c_;  // by the truth of the current sample
  Surroundings surroundings_;
  Barometer barometer_;
  NavigationError navigation_;
  // Navigation::origin in this run.
  std::optional<Geodetic> origin_;
  bool is_disturbed_;             // disturb() does something
  bool measures_slowly_;          // the sensor has internal samples or rare effects
  bool follows_truth_;            // follow_truth() does something
  bool has_surroundings_;         // update_surroundings() does something
  bool had_field_ = false;        // the last sample of this run had a magnetic field
  double period_s_;               // of the samples, nominal
  std::uint64_t powered_on_ = 0;  // the number of the first sample since power on
  std::uint64_t counter_ = 0;
  enum class Run : std::uint8_t { none, rest, truth };  // the source of this run's samples; none before its first
  Run run_ = Run::none;
  MotionBegin last_;     // the state at the last sample, as it was then known
  TruthTime last_time_;  // the time of the last sample; last_'s own differs if the timeline began later
  TruthTime sampled_;    // the time that the last sample was asked for, without jitter; stands still in a hold
  Vector3 last_force_B_ = Vector3::Zero();  // m/s^2, of the last sample
  Nanoseconds held_{0};                     // how far last_time_ has gone on while sampled_ stood still
  Nanoseconds may_catch_up_{0};             // of a hold that has ended: its length, until the next sample
  MotionState advanced_;                    // the state at the end of the sums below
  std::uint32_t revision_ = 0;              // Timeline::revision() when advanced_ was computed
  Internal internal_;
  Vector3 true_rate_ = Vector3::Zero(), true_specific_force_ = Vector3::Zero();  // of the last sample
  LaneVector angle_sum_B_;        // rad, integral of the rate since last_
  LaneVector velocity_sum_B_;     // m/s, of the specific force of B's origin, as model_.delta_velocity defines it
  LaneVector centripetal_sum_B_;  // m/s, of omega x (omega x r)
};

}  // namespace imud
