// Session: the truth on one side, all channels on the other.
#pragma once

#include <poll.h>

#include <atomic>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/timeline.hpp"
#include "emulator/channel.hpp"
#include "emulator/config.hpp"
#include "emulator/counters.hpp"
#include "emulator/truth_intake.hpp"

namespace imud {

// Owns what a run of the emulator works on, and knows neither clock nor order of events: that is the Loop's. All
// memory is taken by the constructor. One thread, but for request_power_cycle() and the counters.
class Session {
 public:
  // Opens every port. Throws PortError.
  explicit Session(const Config& config, const Sync::OpenPort& open = open_port);

  TruthIntake& intake() noexcept { return intake_; }
  const TruthIntake& intake() const noexcept { return intake_; }
  Timeline& timeline() noexcept { return timeline_; }
  std::span<const std::unique_ptr<Channel>> channels() const noexcept { return channels_; }
  TruthQuality& quality() noexcept { return quality_; }
  const TruthQuality& quality() const noexcept { return quality_; }

  // A run of the truth begins with the timeline's newest truth: the next samples have no increments.
  void begin_run() noexcept;
  // True from the first run on.
  bool in_run() const noexcept { return in_run_; }
  // Samples of the truth that were transmitted since begin_run(), of all channels.
  std::uint64_t samples_in_run() const noexcept { return samples_in_run_; }
  void count_samples(std::size_t transmitted) noexcept { samples_in_run_ += transmitted; }

  // Makes the frames of the channel's sample `k` of its grid, of the truth at `time`; or of the vehicle at rest.
  void prepare(Channel& channel, std::uint64_t k, TruthTime time) noexcept;
  void prepare_at_rest(Channel& channel, std::uint64_t k, Nanoseconds since_power_on) noexcept;

  // The watermark: the truth up to there is in use and does not change any more. A later one may still be inserted.
  TruthTime watermark() const noexcept { return watermark_; }
  // A truth was accepted, and no sample before `until` will be taken any more: moves slow imus, and with them the
  // watermark, there now and then, so that the timeline does not overflow between their samples.
  void advance(TruthTime until) noexcept;
  // Raises the watermark: no truth before `until` is accepted any more.
  void raise_watermark(TruthTime until) noexcept;
  // False while the timeline has no room for another truth. Moves slow imus up to `until` first, as advance().
  bool has_room_for_truth(TruthTime until) noexcept;

  // The descriptors for poll(): that of truth comes first, disabled unless `truth`, then those of the hosts.
  std::span<pollfd> inputs(bool truth) noexcept;
  // Serves the hosts of which poll() has seen something in inputs(). Returns false if something stays, such as an
  // error or a flood: poll() would return at once again.
  bool serve_inputs(HostTime now) noexcept;
  // Serves all hosts and polls all devices; lost ports look whether their device is back.
  void serve_all(HostTime now) noexcept;
  // Polls the deadlines of the truth format and of the devices up to `now`, and hands on what the ports hold back;
  // flush() does only the latter.
  void poll(HostTime now) noexcept;
  void flush() noexcept;
  // The next time at which poll() has something to do.
  std::optional<HostTime> next_wake() const noexcept;
  // Gives readers up to 50 ms at the end for what they have not read yet, and lines with a pace up to 500 ms for what
  // is not out; the rest counts as dropped.
  void drain() noexcept;

  // Switches the supply of all devices off and on, between two samples. Any thread.
  void request_power_cycle() noexcept { power_cycle_.store(true, std::memory_order_relaxed); }
  // Does so if it was requested. Not between prepare() and the sample's transmission.
  void cycle_power_if_requested(HostTime now) noexcept;

 private:
  void advance_imus(TruthTime until) noexcept;

  const WhenStopped when_stopped_;
  Timeline timeline_;
  TruthIntake intake_;
  std::vector<std::unique_ptr<Channel>> channels_;
  std::vector<pollfd> inputs_;
  std::atomic<bool> power_cycle_ = false;
  bool in_run_ = false;
  bool stopped_ = false;  // motion is held for want of truth
  TruthTime watermark_;
  std::uint64_t samples_in_run_ = 0;
  std::size_t truths_since_advance_ = 0;
  TruthQuality quality_;
};

}  // namespace imud
