// Vibration: an oscillation of the sensor that the truth does not contain.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/numbers/lanes.hpp"
#include "core/numbers/random.hpp"
#include "core/time.hpp"
#include "core/truth.hpp"
#include "core/vector.hpp"

namespace imud {

// Sines, harmonics of a rotor, and random vibration by its spectrum, in platform axes. Empty: none.
struct VibrationModel {
  struct Sine {
    double frequency_hz;              // above 0, at most 1e6
    Vector3 force = Vector3::Zero();  // m/s^2, amplitude
    Vector3 rate = Vector3::Zero();   // rad/s, amplitude
    double phase = 0;                 // rad, at truth time 0
  };
  std::vector<Sine> sines;

  // A sine whose frequency is a multiple of the rotor's.
  struct Harmonic {
    double order;                     // above 0: that multiple
    Vector3 force = Vector3::Zero();  // m/s^2, amplitude
    Vector3 rate = Vector3::Zero();   // rad/s, amplitude
    double phase = 0;                 // rad, at the first sample
  };
  std::vector<Harmonic> harmonics;

  // One-sided spectral densities at breakpoints, between which their logarithm is linear in the logarithm of the
  // frequency, as in environmental standards (MIL-STD-810, method 514). Frequencies ascend, in the range of
  // Sine::frequency_hz. Densities are above 0; each list is as long as the list of frequencies, or empty.
  struct Spectrum {
    std::vector<double> frequency_hz;
    std::vector<double> force;       // (m/s^2)^2/Hz
    std::vector<double> rate;        // (rad/s)^2/Hz
    Vector3 axes = Vector3::Ones();  // factors of the amplitude, not negative
    std::size_t lines = 64;          // sines that stand for it; 0: no random vibration
  };
  Spectrum spectrum;

  // The factor on all amplitudes: the curve through the points (at, factor) of a state of the vehicle, in SI, or of
  // the truth's time, s. `at` ascends; as many factors, not negative. Empty: 1.
  struct Envelope {
    std::optional<VehicleState> of;  // nullopt: of the time
    std::vector<double> at, factor;
  };
  Envelope envelope;
};

// The true values of the sensors at S, in SI, platform axes, to which vibration is added.
struct SensorInput {
  Vector3 &rate, &delta_angle, &specific_force, &delta_velocity;
};

// Adds the vibration to the truth: a sum of sines
//   v(t) = sum of s_j sin(w_j t) + c_j cos(w_j t),  w_j = 2 pi f_j,  t the truth's time
// whose integral over a step is exact in the increments. The delta-angle of motion and the one of vibration are
// added, without the coning of both together.
//
// Random vibration is a sum of sines of random phases, which are independent for each axis (M. Shinozuka and
// C.-M. Jan, "Digital simulation of random processes and its applications", J. Sound and Vibration 25(1), 1972): one
// in the middle of each of `lines` bands between the first and the last breakpoint, whose widths are in proportion to
// their frequencies. Each has the power of its band, exactly. The vibration depends on seed, imu and time alone.
//
// A harmonic has the phase that its frequency accumulates from sample to sample. Its integral over a step is exact
// for a constant speed. With an envelope, the integrals are multiplied by the mean of the factors at both ends of the
// step.
//
// The constructor allocates; nothing else allocates, locks or throws. Not thread-safe.
class Vibration {
 public:
  Vibration(const VibrationModel& model, const Normals& normals);
  bool is_on() const noexcept { return !lines_.empty(); }

  // Returns whether the amplitude or a frequency follows the truth.
  bool follows() const noexcept { return has_harmonics_ || !envelope_.at.empty(); }
  // Sets the truth that the next add_to() follows: the state of the envelope, in SI, and the speed of the rotor,
  // rad/s. Without a state, as for a vehicle at rest, the envelope has its factor at state 0. Without a speed, the
  // rotor stands still.
  void follow(TruthTime time, std::optional<double> state, std::optional<double> rotor_speed) noexcept;
  std::optional<VehicleState> followed() const noexcept { return envelope_.of; }
  // Returns the present factor on the mean square of the vibration.
  double power_factor() const noexcept { return factor_ * factor_; }
  // Goes on with the rotor's speed and the factor of the envelope of `before`; if both have equally many lines, also
  // with the phases of the rotor's harmonics.
  void continue_from(const Vibration& before) noexcept;

  // Adds the vibration at `time` to the values, and its integral over the step from the last call's time to the
  // increments if `dt` is not 0.
  void add_to(const SensorInput& input, TruthTime time, double dt) noexcept;

  // Returns the mean square of the specific force on each axis for the factor 1, (m/s^2)^2.
  Vector3 mean_square() const noexcept;

 private:
  struct Line {
    std::uint64_t turns_per_ns;  // in 2^-64 turns: the phase is exact at any time, modulo a turn
    double per_omega;            // s/rad, 1/w
    double order = 0;            // of a harmonic; 0: none
    double phase = 0;            // of a harmonic, in turns
    LaneVector force_sin = {}, force_cos = {}, rate_sin = {}, rate_cos = {};
    double last_sin = 0, last_cos = 1;
  };
  Line& line(double frequency_hz);
  void add_spectrum(const VibrationModel::Spectrum& spectrum, const Normals& normals);

  double angle_of(Line& line, TruthTime time, double dt) noexcept;

  std::vector<Line> lines_;
  VibrationModel::Envelope envelope_;
  bool has_harmonics_ = false;
  double factor_ = 1, last_factor_ = 1;
  double rotor_hz_ = 0;
};

}  // namespace imud
