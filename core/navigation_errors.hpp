// NavigationError: the errors of a navigation solution, which a GNSS receiver or a filter computes.
#pragma once

#include <cstdint>

#include "core/attitude.hpp"
#include "core/earth/earth.hpp"
#include "core/gnss/antenna_line.hpp"
#include "core/gnss/sky.hpp"
#include "core/numbers/correlated_noise.hpp"
#include "core/time.hpp"

namespace imud {

// A first-order model: each component has exponentially correlated noise, with the accuracy of a data sheet as its
// standard deviation, and white noise beside it. The default of every member switches its effect off. Vectors are
// north, east, down, and not negative.
struct NavigationErrors {
  Nanoseconds latency{0};                    // the age of position and velocity, not negative
  double time_s = 0;                         // standard deviation of the GPS time, not negative
  double time_correlation_s = 600;           // above 0
  Vector3 position = Vector3::Zero();        // m, standard deviation
  double position_correlation_s = 600;       // above 0
  Vector3 position_noise = Vector3::Zero();  // m, standard deviation of one sample
  Vector3 velocity = Vector3::Zero();        // m/s, standard deviation
  double velocity_correlation_s = 60;
  Vector3 velocity_noise = Vector3::Zero();  // m/s, standard deviation of one sample
  Vector3 attitude = Vector3::Zero();        // rad, standard deviation of rotations about north, east, down
  double attitude_correlation_s = 300;
  // rad, standard deviation of the heading that two antennas along the platform's x axis give with each fix, white,
  // not negative; 0: there is one antenna.
  double antennas_heading = 0;
  // Its sky, if there is an almanac, multiplies the errors of position and velocity by accuracy_factor. The times of
  // its search are not applied here (gnss/acquisition.hpp).
  GnssModel gnss;
};

// Does not allocate after construction, lock or throw; not thread-safe.
class NavigationError {
 public:
  // `period_s` is the nominal sample period, above 0.
  NavigationError(const NavigationErrors& errors, double period_s)
      : errors_(errors),
        position_(errors.position, Vector3::Constant(errors.position_correlation_s), period_s, Quantity::position),
        velocity_(errors.velocity, Vector3::Constant(errors.velocity_correlation_s), period_s, Quantity::velocity),
        attitude_(errors.attitude, Vector3::Constant(errors.attitude_correlation_s), period_s, Quantity::attitude),
        time_(Vector3(errors.time_s, 0, 0), Vector3::Constant(errors.time_correlation_s), period_s,
              Quantity::gnss_time),
        sky_(errors.gnss),
        has_noise_(!errors.position_noise.isZero(0.0) || !errors.velocity_noise.isZero(0.0)),
        has_errors_(has_noise_ || sky_.is_on() || position_.is_on() || velocity_.is_on() || attitude_.is_on() ||
                    time_.is_on()) {}

  // Returns false if there are no errors but the latency, which is not applied here, and no second antenna.
  bool is_on() const noexcept { return has_errors_ || errors_.antennas_heading > 0; }
  Nanoseconds latency() const noexcept { return errors_.latency; }

  // Adds the errors of sample k to its place, if the place is known, and to its attitude, which must be the true one.
  // A known place gets the line of two antennas. With too few satellites the place becomes unknown. The last call
  // must have been for sample k - 1, or seek(k).
  void apply(Sample& sample, const Normals& normals, std::uint64_t k) noexcept {
    if (errors_.antennas_heading > 0 && sample.navigation.is_known) [[unlikely]]
      sample.navigation.antennas = measured_line(sample.q_LP, errors_.antennas_heading, normals, k);
    if (!has_errors_) return;
    if (attitude_.is_on()) sample.q_LP = exp(attitude_.next(normals, k)) * sample.q_LP;
    Vector3 position = Vector3::Zero(), velocity = Vector3::Zero();
    if (position_.is_on()) position = position_.next(normals, k);
    if (velocity_.is_on()) velocity = velocity_.next(normals, k);
    if (time_.is_on()) time_.next(normals, k);
    if (!sample.navigation.is_known) return;
    if (sky_.is_on() && !sky_.look(sample.navigation)) {
      sample.navigation = {};
      return;
    }
    if (has_noise_) {
      position += errors_.position_noise.cwiseProduct(normals(Quantity::position, Process::white_noise, k));
      velocity += errors_.velocity_noise.cwiseProduct(normals(Quantity::velocity, Process::white_noise, k));
    }
    if (sky_.is_on()) {
      const double factor = double{sample.navigation.accuracy_factor};
      position = factor * position + sky_.displacement(normals);
      velocity *= factor;
    }
    sample.navigation.v_L += velocity;
    sample.navigation.gps_ns += static_cast<std::int64_t>(1e9 * time_.value().x());
    move(sample.navigation, position);
  }
  // Makes sample k the next, with the errors that sample k has in the sequence from sample 0. The run time is
  // proportional to k.
  void seek(const Normals& normals, std::uint64_t k) noexcept {
    position_.seek(normals, k);
    velocity_.seek(normals, k);
    attitude_.seek(normals, k);
    time_.seek(normals, k);
  }
  // Makes sample k the next, with the memory of `before`.
  void continue_from(const NavigationError& before, const Normals& normals, std::uint64_t k) noexcept {
    position_.continue_from(before.position_, normals, k);
    velocity_.continue_from(before.velocity_, normals, k);
    attitude_.continue_from(before.attitude_, normals, k);
    time_.continue_from(before.time_, normals, k);
  }
  template <class Visit>
  void each_sequence(Visit visit) noexcept {
    for (CorrelatedNoise* noise : {&position_, &velocity_, &attitude_, &time_})
      if (noise->is_on()) noise->each_sequence(visit);
  }

 private:
  NavigationErrors errors_;
  CorrelatedNoise position_, velocity_, attitude_;
  CorrelatedNoise time_;  // on x
  Sky sky_;
  bool has_noise_, has_errors_;
};

}  // namespace imud
