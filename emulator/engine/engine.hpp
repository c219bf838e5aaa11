// Engine: the truth on one side, all channels on the other.
#pragma once

#include <poll.h>

#include <atomic>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/timeline.hpp"
#include "emulator/engine/channel.hpp"
#include "emulator/engine/run_control.hpp"
#include "emulator/faults/fault_book.hpp"
#include "emulator/faults/truth_faults.hpp"
#include "emulator/ground/counters.hpp"
#include "emulator/ground/step_sink.hpp"
#include "emulator/plan/config.hpp"
#include "emulator/truth/truth_intake.hpp"

namespace imud {

class Pacer;
class Schedule;
struct Reload;

// Configuration keys of ports that the system has chosen, with the ports.
using ChosenPorts = std::vector<std::pair<std::string, std::string>>;

// Owns the objects of a run. The Pacer and the Loop decide times and the order of events. The constructor allocates
// all memory. One thread, except for request_power_cycle() and the counters, which any thread may use.
class Engine {
 public:
  // Opens every port. `sink` takes the events of the run. `control` brings commands and takes watched samples;
  // nullptr: none does. Throws PortError.
  explicit Engine(const Config& config, const Ports& ports = real_ports, StepSink& sink = StepSink::none(),
                   RunControl* control = nullptr);

  StepSink& sink() const noexcept { return sink_; }
  // The faults of the run, and their begins and ends so far.
  FaultBook& faults() noexcept { return faults_; }
  const FaultBook& faults() const noexcept { return faults_; }
  // Returns the outcomes of the expectations. Called after the last sample.
  std::vector<Expected> expected() const;
  // Begins a fault of truth, whose times count from the next truth, and ends one, or all (FaultSchedule). Without
  // effect if truth cannot fail.
  void begin_truth_fault(std::uint32_t number) noexcept {
    if (truth_faults_ != nullptr && faults_[number].acts_on(fault_of_truth))
      truth_faults_->schedule().add(faults_[number], number);
  }
  void end_truth_fault(std::uint32_t number) noexcept {
    if (truth_faults_ != nullptr) truth_faults_->schedule().end(number);
  }
  void end_truth_faults() noexcept {
    if (truth_faults_ != nullptr) truth_faults_->schedule().end_all();
  }
  // Ends the faults that act. Called after the last sample.
  void finish_faults() noexcept;

  // Sets the reload of the next Command::Kind::reload. It outlives the command. Called by the thread that makes the
  // command, after the last reload was executed.
  void set_reload(Reload* reload) noexcept { reload_ = reload; }
  Reload* next_reload() const noexcept { return reload_; }

  TruthIntake& intake() noexcept { return intake_; }
  const TruthIntake& intake() const noexcept { return intake_; }
  Timeline& timeline() noexcept { return timeline_; }
  std::span<const std::unique_ptr<Channel>> channels() const noexcept { return channels_; }
  ChosenPorts chosen_ports() const;
  TruthQuality& quality() noexcept { return quality_; }
  const TruthQuality& quality() const noexcept { return quality_; }

  // Begins a run of the truth with the timeline's newest truth: the next samples have no increments.
  void begin_run() noexcept;
  // Continues the run after the simulator's time has leapt and the timeline has discarded the earlier truths. The
  // next sample of each imu has no increments.
  void pass_over() noexcept;
  // Returns true from the first run on.
  bool in_run() const noexcept { return in_run_; }
  // Returns the number of samples of the truth that all channels have transmitted since begin_run().
  std::uint64_t samples_in_run() const noexcept { return samples_in_run_; }
  void count_samples(std::size_t transmitted) noexcept { samples_in_run_ += transmitted; }

  // Called when truth has come: the samples that were taken before it (AwaitedTruth).
  void review_samples() noexcept {
    for (const auto& channel : channels_) channel->review_samples(timeline_, quality_.extrapolation_error);
  }

  // Take sample `k` of the channel's grid, of the truth at `time` or of the vehicle at rest, for Channel::encode().
  void prepare(Channel& channel, std::uint64_t k, TruthTime time) noexcept;
  void prepare_at_rest(Channel& channel, std::uint64_t k, Nanoseconds since_power_on) noexcept;

  // Returns the watermark: the truth up to it has been used and is fixed. A later truth may still be inserted.
  TruthTime watermark() const noexcept { return watermark_; }
  // Called for each accepted truth. No sample before `until` will be taken any more. Every 512 truths, advances slow
  // imus and the watermark to `until`, so that the timeline does not overflow between their samples.
  void advance(TruthTime until) noexcept;
  // Raises the watermark to `until`: no truth up to it is accepted any more.
  void raise_watermark(TruthTime until) noexcept;
  // Integrates the truth up to `until` in slow imus, and raises the watermark: advance() does it when it has to.
  void advance_imus(TruthTime until) noexcept;
  // Returns false while the timeline has no room for another truth. If it is full, first advances slow imus and the
  // watermark to `until`.
  bool has_room_for_truth(TruthTime until) noexcept;

  // Returns the descriptors for ::poll(): first the truth's, disabled unless `truth`, then the hosts'.
  std::span<pollfd> inputs(bool truth) noexcept;
  // Serves the hosts for which ::poll() has reported an event in inputs(). Returns false if ::poll() would return at
  // once again, because of a lasting error or a flood. `clock`: see Channel::serve().
  bool serve_inputs(HostTime now, Host* clock) noexcept;
  // Serves all hosts and polls all devices. Lost ports check whether their device is back.
  void serve_all(HostTime now, Host* clock) noexcept;
  // Polls the deadlines of the truth format and of the devices up to `now`, and sends frames that ports hold back;
  // flush() does only the latter.
  void poll(HostTime now) noexcept;
  void flush() noexcept;
  // Returns the time up to which the devices' deadlines have been polled.
  HostTime polled() const noexcept { return polled_; }
  // Returns when poll() has to be called next; nullopt if nothing waits for a time.
  std::optional<HostTime> next_wake() const noexcept;
  // Called at the end. Waits up to `readers` until the readers have read everything, or up to 500 ms until paced
  // lines have sent everything; the rest counts as dropped. Returns false if a reader is known not to have read
  // everything.
  bool drain(std::chrono::milliseconds readers) noexcept;
  // Called after drain() if the run has not failed: commit() of all channels. Throws std::runtime_error.
  void commit();

  // Computes the counters of all channels again. Called when the sampling thread has ended.
  void publish() noexcept {
    for (const auto& channel : channels_) channel->publish();
  }

  // The pacer of the Loop that drives this; nullptr: none does.
  void set_pacer(Pacer* pacer) noexcept { pacer_ = pacer; }
  Pacer* pacer() noexcept { return pacer_; }
  // The schedule of that Loop; nullptr: there is no Loop.
  void set_schedule(Schedule* schedule) noexcept { schedule_ = schedule; }
  Schedule* schedule() noexcept { return schedule_; }
  void set_when_stopped(WhenStopped reaction) noexcept { when_stopped_ = reaction; }

  // The queues of the clients that control this; nullptr: there are none.
  RunControl* control() noexcept { return control_; }

  // Switches the supply of all devices off and on, between two samples. Any thread.
  void request_power_cycle() noexcept { power_cycle_.store(true, std::memory_order_relaxed); }
  // Does so if it was requested. Must not be called between a channel's encode() and transmit().
  void cycle_power_if_requested(HostTime now) noexcept;
  void cycle_power(HostTime now) noexcept;

 private:
  std::unique_ptr<ChannelFaults> faults_of(const ImuConfig& imu, std::uint64_t seed);
  void record_sample(const Channel& channel, std::uint8_t flags, std::int64_t time, std::uint64_t k) noexcept;

  StepSink& sink_;
  RunControl* const control_;
  FaultBook faults_;
  const std::vector<ExpectConfig> expectations_;
  WhenStopped when_stopped_;
  Reload* reload_ = nullptr;
  Pacer* pacer_ = nullptr;
  Schedule* schedule_ = nullptr;
  Timeline timeline_;
  TruthFaults* truth_faults_ = nullptr;  // of the intake's decoder; nullptr: truth cannot fail
  TruthIntake intake_;
  std::vector<std::unique_ptr<Channel>> channels_;
  std::vector<pollfd> inputs_;
  std::atomic<bool> power_cycle_ = false;
  bool in_run_ = false;
  bool stopped_ = false;  // motion is held because truth has stopped
  TruthTime watermark_;
  HostTime polled_;
  std::uint64_t samples_in_run_ = 0;
  std::size_t truths_since_advance_ = 0;
  TruthQuality quality_;
};

}  // namespace imud
