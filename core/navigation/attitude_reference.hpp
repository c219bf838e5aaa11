// AttitudeReference: the attitude that a unit without a receiver computes from its measured samples.
#pragma once

#include <cstdint>
#include <optional>

#include "core/earth/earth.hpp"
#include "core/navigation/attitude_filter.hpp"
#include "core/navigation/coarse_alignment.hpp"
#include "core/navigation/navigation_requests.hpp"
#include "core/navigation/navigator.hpp"
#include "core/sample.hpp"

namespace imud {

// An attitude and heading reference: replaces the attitude of each sample by the filter's attitude, and leaves
// velocity and position unchanged. The filter needs no position.
//
// An alignment lasts NavigatorModel::alignment_s. The attitude is levelled by the mean of the specific force, and
// turned north by the mean of the magnetic field. If the mean force differs from gravity by more than half, the
// alignment begins again. Headings are relative to magnetic north. Where the alignment finds a place, the declination
// there (IGRF-14 at the model's start) makes them true, like the declination that the installer of a real unit
// enters. This declination is used until the next alignment. Without a magnetic field the platform's x axis (its z
// axis, where x is upright) points north at the end of the alignment, and the heading drifts on as the gyros do.
//
// A heading is rejected if the field's strength differs by more than a quarter from the alignment's, or if it is
// beyond NavigatorModel::gate; after `accept_after_s` of rejections alone the field is taken as it is.
//
// While motion is held because truth has stopped, the filter goes on with the samples. The filter aligns again when
// truth returns after more than a second, in a new run, after a leap of the truth's time, and after a power on.
//
// Nothing here allocates after construction, locks or throws; not thread-safe.
class AttitudeReference {
 public:
  AttitudeReference(const NavigatorModel& model, const ImuModel& imu);

  // Makes the next sample the first of a run, or of a power on: the alignment begins.
  void restart() noexcept;
  // Magnetic headings and gravity can be withheld. The magnetic field is the one of the samples (OwnSolution).
  void set_aids(const NavigationAids& aids) noexcept;
  // Takes the heading of the platform at the last sample. While the filter aligns, the alignment begins its window
  // again, and ends with this heading. Later the filter turns to it at once, unless it is `only_in_alignment`.
  void give(const GivenHeading& heading) noexcept;
  // Replaces the attitude of a sample, which must be the true one, by the filter's. Samples at rest, before the first
  // truth of a run, may be given as well.
  void take(Sample& sample) noexcept;

  // The filter, whose state is valid once it is aligned.
  const AttitudeFilter& filter() const noexcept { return filter_; }
  const Navigator::Counts& headings() const noexcept { return headings_; }

 private:
  // The strength of the field, T, and the tangent of its dip.
  struct Field {
    double strength = 0, dip = 0;
  };
  static Field field_of(const Vector3& field_L) noexcept;
  void find_north(const Sample& sample) noexcept;
  void align(const Sample& sample, double dt) noexcept;
  void begin_window() noexcept;
  Quaternion levelled(const Sample& sample) const noexcept;
  // `sigma`: rad, of tilt and of the heading before the field is used.
  void begin_filter(const Quaternion& q_LP, const Vector2& sigma, const Vector3& field_L) noexcept;
  AttitudeFilter::Heading heading_by(const Vector3& field_L) const noexcept;
  void use_heading(const Sample& sample) noexcept;
  void write(Sample& sample) const noexcept;

  static constexpr double longest_hold_s = 1;
  static constexpr double field_change = 0.25;  // of its strength, above which a field is disturbed; chosen

  NavigatorModel model_;
  Earth earth_;
  AttitudeFilter filter_;
  CoarseAlignment alignment_;
  std::uint64_t heading_every_;  // samples; 0: never
  std::optional<DeviceTime> last_time_;
  std::uint64_t number_ = 0;  // of the next sample since restart()
  std::uint64_t aligned_at_ = 0;
  bool is_aligned_ = false;
  double held_s_ = 0;
  NavigationAids aids_;
  std::optional<GivenHeading> given_;  // of the platform at the begin of the window, for the alignment
  Vector3 north_ = Vector3::UnitX();   // in L, the horizontal direction of the undisturbed field
  bool knows_north_ = false;           // by a place
  std::optional<Field> field_;         // undisturbed
  double rejecting_s_ = 0;             // since the first of the rejections after the last heading that was used
  bool is_rejecting_ = false;
  Navigator::Counts headings_;
  std::uint16_t used_ = 0, rejected_ = 0;  // Solution's
};

}  // namespace imud
