// Navigator: the unit's own navigation solution, from its measured samples.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/earth/earth.hpp"
#include "core/navigation/coarse_alignment.hpp"
#include "core/navigation/inertial_filter.hpp"
#include "core/navigation/navigation_requests.hpp"
#include "core/navigation/receiver_fix.hpp"
#include "core/navigation/rest_detector.hpp"
#include "core/sample.hpp"
#include "core/timeline.hpp"

namespace imud {

// Sets the noise and the biases as a maker would for the sensors of `imu` (tuning.cpp).
void tune(NavigatorModel& navigator, const ImuModel& imu) noexcept;

// Replaces the attitude and the place of each sample by the filter's solution. Until the alignment is complete there
// is no place, and the attitude is by gravity and the magnetic field alone. Without a receiver's fix the solution
// coasts; the time runs on. Where fixes are rejected until they have to be accepted, because the attitude is wrong,
// the filter begins again with these fixes and a new attitude; the place has no gap. Where motion is held because
// truth has stopped, the solution coasts for a second, and is held after that. When truth returns after more than a
// second, the navigator aligns again. It also aligns again after a shorter hold in which the truth's time has stood
// still.
//
// Nothing here allocates after construction, locks or throws; not thread-safe.
class Navigator {
 public:
  // NavigationErrors::latency is the age of the receiver's fixes. Up to about a second the covariance allows for it.
  Navigator(const NavigatorModel& model, const ImuModel& imu);

  // Makes the next sample the first of a run, or of a power on: the alignment begins.
  void restart() noexcept;
  // Fixes (aid::position), antennas, magnetic headings and heights can be withheld. The magnetic field is the one of
  // the samples (OwnSolution).
  void set_aids(const NavigationAids& aids) noexcept;
  // Takes the heading of the platform at the last sample. While the filter aligns, the alignment begins its window
  // again, and ends with this heading. Later the filter turns to it at once, unless it is `only_in_alignment`.
  void give(const GivenHeading& heading) noexcept;
  // Replaces the place and the attitude of a sample by the filter's solution. On entry, the place must be the fix
  // that the receiver would make at this sample, and the attitude the true one; faults may have changed both. `time`
  // is the time of the truth that the sample measured; `earth_angle` is PositionVelocity::earth_angle at this time.
  void take(Sample& sample, TruthTime time, std::optional<double> earth_angle) noexcept;

  // Does the same for a vehicle at rest before the first truth of a run. The solution is then aligning.
  void take_at_rest(Sample& sample) noexcept;

  // The filter, whose state is valid once it is aligned.
  const InertialFilter& filter() const noexcept { return filter_; }
  // Measurements that were used, and that were rejected.
  struct Counts {
    std::uint64_t used = 0, rejected = 0;
  };
  const Counts& fixes() const noexcept { return fixes_; }
  const Counts& headings() const noexcept { return headings_; }
  const Counts& antenna_headings() const noexcept { return antenna_headings_; }
  const Counts& heights() const noexcept { return heights_; }  // barometric
  // The rests that the sensors have found, each of a second.
  const Counts& rests() const noexcept { return rests_; }

 private:
  struct At {  // of a sample
    TruthTime time;
    std::optional<double> earth_angle;
  };
  struct Aligned {
    Quaternion q_NP;
    Vector2 sigma;  // rad, of tilt and heading
  };
  void align(const Sample& sample, const At& at, double dt) noexcept;
  // Returns the attitude at the end of a window of alignment_s; the next call begins the next window.
  std::optional<Aligned> measure_attitude(const PositionVelocity& now, const Sample& sample) noexcept;
  std::optional<Aligned> coarse_attitude(const PositionVelocity& now, const Sample& sample) const noexcept;
  void begin_filter(const PositionVelocity& now, const Sample& sample, const At& at, const Quaternion& q_NP,
                    const Vector2& sigma, double more_gyro_bias = 0) noexcept;
  void remember_motion() noexcept;
  // While fixes are rejected, measures the attitude as for the alignment, and compares the filter's with it.
  void review(const Sample& sample, const At& at, double dt) noexcept;
  // Enlarges the covariance for a fix that has to be accepted: position and velocity by the squares of the fix's
  // innovations, m and m/s; attitude and gyro bias by the tilt, and by the bias, that may have caused `velocity_N`.
  void doubt(const Vector3& position, const Vector3& velocity_N) noexcept;
  // Begins the filter again with the position and the velocity of a fix, and the attitude of other_attitude_, which
  // must be set.
  void begin_again(const PositionVelocity& measured, const Sample& sample, const At& at) noexcept;
  void use_fix(const Sample& sample, const At& at) noexcept;
  void use_heading(const Sample& sample, const At& at) noexcept;
  void use_antennas(const Sample& sample, const At& at) noexcept;
  void use_height(const Sample& sample, const At& at) noexcept;
  void use_rest(const Sample& sample, const At& at, double dt) noexcept;
  InertialFilter::ScaleSigmas scale_sigmas() const noexcept {
    const bool estimates = model_.estimates_scale_factors;
    return {
        .gyro = estimates || aids_.estimates_gyro_scale ? model_.gyro_scale_factor : 0,
        .accelerometer = estimates || aids_.estimates_accelerometer_scale ? model_.accelerometer_scale_factor : 0};
  }
  bool is_slow(const Navigation& here, const Navigation& fix) const noexcept;
  bool has(std::uint16_t aid) const noexcept { return (aids_.withheld & aid) == 0; }
  bool has_fix(const Sample& sample) const noexcept { return sample.navigation.is_known && has(aid::position); }
  bool has_antennas(const Sample& sample) const noexcept {
    return sample.navigation.antennas.sigma > 0 && has(aid::antennas_heading);
  }
  // Clears the bits of `aids` in `used_` and `rejected_`. Called when an aid is due.
  void forget(unsigned aids) noexcept;
  bool use(std::uint16_t aid, const InertialFilter::Measurement& measurement) noexcept;
  // Uses a heading of an aid that is due every `interval_s`. `rejected_s`: for how long all headings of this aid have
  // been rejected.
  bool use_azimuth(std::uint16_t aid, const InertialFilter::Measurement& azimuth, const Quaternion& q_LN,
                   double interval_s, double& rejected_s) noexcept;
  double step(const Sample& sample) noexcept;
  void write_aligning(Sample& sample, double dt) noexcept;
  // Writes the filter's solution to the sample. Returns false if the filter's position is no place on the Earth.
  bool write(Sample& sample, const At& at) const noexcept;
  void hold(bool is_held, TruthTime time, double dt) noexcept;
  Quaternion q_NL(const PositionVelocity& position, const Navigation& place) const noexcept;
  PositionVelocity in_N(const Navigation& fix, const At& at) const noexcept;
  PositionVelocity position_of(const At& at) const noexcept;
  Navigation place(const At& at) const noexcept;

  static constexpr double coasting_after_s = 1;  // without a fix, or after three of their intervals
  static constexpr double longest_hold_s = 1;

  NavigatorModel model_;
  Earth earth_;
  std::int64_t start_gps_ns_;
  InertialFilter filter_;
  CoarseAlignment alignment_;
  std::optional<CoarseAlignment> window_;  // alignment_ at the end of the window
  std::optional<Vector3> first_v_N_;       // m/s, at the begin of the window
  double period_s_;
  Nanoseconds latency_;
  std::uint64_t fix_every_, heading_every_, height_every_;  // samples; 0: never
  ReceiverFix receiver_;  // the fix that the unit reports; the fixes of the same epochs correct the filter
  int position_error_, velocity_error_, height_error_;  // InertialFilter::Measurement::error; -1: there is none
  // The motion after each of the last samples, a ring by their numbers. A late fix is compared with the motion at its
  // own time. past_ is kept without the corrections by fixes; corrections_ is their sum, which is added at the
  // comparison, so that an error that one fix has corrected is not corrected again by the next.
  struct Motion {
    Vector3 v_N = Vector3::Zero(), r_N = Vector3::Zero();  // m/s, m
  };
  std::vector<Motion> past_;
  Motion corrections_;
  NavigationAids aids_;
  std::optional<GivenHeading> given_;  // of the platform at the begin of the window, for the alignment
  bool has_begun_ = false;             // the window of the alignment, while there are fixes
  bool is_aligned_ = false;
  std::uint64_t number_ = 0;  // of the next sample since restart()
  std::uint64_t aligned_at_ = 0;
  std::optional<DeviceTime> last_time_;
  std::optional<TruthTime> truth_time_;  // of the last sample
  std::optional<Vector3> up_P_;          // m/s^2, the mean specific force of the last time, before the alignment
  double since_fix_s_ = 0, held_s_ = 0;
  double rejecting_s_ = 0;  // since the first of the rejections after the last fix that was used
  bool is_rejecting_ = false;
  struct OtherAttitude {
    Quaternion turn_N;  // from the filter's attitude to the one that was measured
    Vector2 sigma;      // rad, of its tilt and heading
  };
  std::optional<OtherAttitude> other_attitude_;  // while fixes are rejected: the filter's attitude cannot be right
  At at_;                                        // of the last sample that the filter has integrated
  Geodetic origin_;
  std::int64_t receiver_clock_ns_ = 0;  // the receiver's GPS time less the true one
  // The times for which all heights, or all headings of an aid, have been rejected.
  double heights_rejected_s_ = 0, headings_rejected_s_ = 0, antenna_headings_rejected_s_ = 0;
  RestDetector rest_detector_;
  Counts fixes_, headings_, antenna_headings_, heights_, rests_;
  std::uint16_t used_ = 0, rejected_ = 0;  // Solution's
};

}  // namespace imud
