// AwaitedTruth: samples that an imu took before their truth came, kept until it comes.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "core/imu.hpp"
#include "core/timeline.hpp"
#include "emulator/ground/counters.hpp"
#include "emulator/imu/sample_feed.hpp"

namespace imud {

// When the truth of a sample's instant has come, measures the error of the extrapolation, and passes the sample with
// the true motion of that instant to the feed. A sample whose truth has not come 500 ms later, or before
// the run of the truth ends, is passed on with a true motion of NaN. The constructor allocates; nothing else here
// allocates, locks or throws. One thread.
class AwaitedTruth {
 public:
  static constexpr std::size_t capacity = 512;
  static constexpr Nanoseconds patience = std::chrono::milliseconds(500);

  // `model`: the model of the imu.
  explicit AwaitedTruth(const ImuModel& model) : r_SB_B_(model.r_SB_B), dcm_PB_(model.dcm_PB), ring_(capacity) {}

  // From now on the imu has the mounting of `model`.
  void set_mounting(const ImuModel& model) noexcept {
    r_SB_B_ = model.r_SB_B;
    dcm_PB_ = model.dcm_PB;
  }
  // `feed` must outlive this. nullptr: nobody can watch.
  void set_feed(SampleFeed* feed) noexcept { feed_ = feed; }
  SampleFeed* feed() const noexcept { return feed_; }

  // Adds the last sample of `imu`. `ahead`: the sample's time less the time of the truth that was the newest then;
  // negative: that truth was later. `is_extrapolated`: the sample's motion is compared with the truth to come.
  // `shown`: the sample for the feed, with the true motion as it was sampled; nullopt: the feed does not get it.
  void add(const Imu& imu, Nanoseconds ahead, bool is_extrapolated, const std::optional<FeedSample>& shown) noexcept;
  // Reviews the samples whose truth has come. Must be called when truth has come.
  void review(const Timeline& timeline, TruthQuality::ExtrapolationError& error) noexcept;
  // Discards all samples, which are shown without truth. Called when a run of the truth ends.
  void clear() noexcept;

 private:
  struct Awaiting {
    TruthTime time;
    Nanoseconds ahead;
    bool is_extrapolated = false, is_shown = false;
    Vector3 rate, specific_force;  // of the sample, in platform axes
    FeedSample shown;
  };
  Awaiting& first() noexcept { return ring_[first_]; }
  void remove_first() noexcept {
    first_ = (first_ + 1) % capacity;
    --count_;
  }
  void give_up_first() noexcept;

  Vector3 r_SB_B_;
  Matrix3 dcm_PB_;
  SampleFeed* feed_ = nullptr;
  std::vector<Awaiting> ring_;
  std::size_t first_ = 0, count_ = 0;
};

}  // namespace imud
