// Engine: the truth on one side, all channels on the other. It executes the steps that a driver proposes.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/timeline.hpp"
#include "emulator/engine/encoding_thread.hpp"
#include "emulator/engine/run_control.hpp"
#include "emulator/engine/step.hpp"
#include "emulator/faults/fault_book.hpp"
#include "emulator/faults/truth_faults.hpp"
#include "emulator/ground/counters.hpp"
#include "emulator/ground/step_sink.hpp"
#include "emulator/imu/channel.hpp"
#include "emulator/imu/ports.hpp"
#include "emulator/plan/config.hpp"
#include "emulator/truth/truth_intake.hpp"

namespace imud {

// Owns the objects of a run. apply() alone changes the timeline, the imus, the devices and the faults. The same steps
// give the same bytes, whoever proposes them. The constructor allocates all memory. One thread, except for
// `power_cycle` and the counters, which any thread may use.
class Engine {
 public:
  // Opens every port. `sink` takes the steps of the run. `control` brings commands and takes watched samples;
  // nullptr: nobody controls or watches the run. Throws PortError.
  explicit Engine(const Config& config, const Ports& ports = real_ports, StepSink& sink = StepSink::none(),
                  RunControl* control = nullptr);

  // Executes a step. The sink gets the step before the step acts, with these exceptions: a truth and a sample are
  // given with their results, and `transmit` is given after the frames of the deadlines up to it. Deadlines are
  // stated by later events. Returns what became of a truth; otherwise `nothing`. No allocation, no lock, no wait.
  // Steps that a damaged record may hold have no effect.
  TruthIntake::Outcome apply(const Step& step) noexcept {
    // A leap, which the driver proposes after its truth, discards the samples that wait for truth.
    if (unreviewed_ && step.event.type != Step::Type::forget_past) review();
    if (step.event.type != Step::Type::sample && step.event.type != Step::Type::transmit) return apply_other(step);
    step.event.type == Step::Type::sample ? take_sample(step) : transmit(step);
    return TruthIntake::Outcome::nothing;
  }

  // The channels whose samples were taken since the last `transmit` was completed, in order.
  std::span<Channel* const> prepared() const noexcept { return prepared_; }
  // Called when the frames of the prepared samples have been sent or skipped: counts the samples.
  void complete() noexcept;

  // From now on `encoding` makes and sends the frames of samples, if it serves all imus and no step is recorded.
  // nullptr: the engine makes the frames itself again. `encoding` must exist until then.
  void encode_by(EncodingThread* encoding) noexcept;
  // Returns true if the EncodingThread makes the frames of the prepared samples. The driver then sends nothing after
  // `transmit`.
  bool encodes_apart() const noexcept { return is_apart_; }

  StepSink& sink() const noexcept { return sink_; }
  // The queues of the clients that control this; nullptr: there are none.
  RunControl* control() const noexcept { return control_; }
  // The faults of the run, and their begins and ends so far.
  FaultBook& faults() noexcept { return faults_; }
  TruthIntake& intake() noexcept { return intake_; }
  const TruthIntake& intake() const noexcept { return intake_; }
  const Timeline& timeline() const noexcept { return timeline_; }
  std::span<const std::unique_ptr<Channel>> channels() const noexcept { return channels_; }
  TruthQuality& quality() noexcept { return quality_; }

  // Returns true from the first run on.
  bool in_run() const noexcept { return in_run_; }
  // Returns the number of samples of the truth that all channels have transmitted since the run began.
  std::uint64_t samples_in_run() const noexcept { return samples_in_run_; }
  // Returns the watermark: the truth up to it has been used and is fixed. A later truth may still be inserted.
  TruthTime watermark() const noexcept { return watermark_; }
  // Raises the watermark to `until`: no truth up to it is accepted any more.
  void raise_watermark(TruthTime until) noexcept { watermark_ = std::max(watermark_, until); }
  // Returns false while the timeline has no room for another truth before slow imus advance. No later sample may
  // precede `until`.
  bool has_room_for_truth(TruthTime until) const noexcept;
  // Ends the faults that act. Called after the last step.
  void finish_faults() noexcept;

  // A request that the supply of all devices is switched off and on. A driver then proposes it between two samples.
  Request power_cycle;

 private:
  std::unique_ptr<ChannelFaults> faults_of(const ImuConfig& imu, std::uint64_t seed);
  TruthIntake::Outcome apply_other(const Step& step) noexcept;
  void apply_rare(const Step& step) noexcept;
  void finish_encoding() noexcept;
  void look_at_imus() noexcept;
  void keep(RecordEvent event, std::uint16_t imu) noexcept;
  bool has_effect(const Step& step) const noexcept;
  void offer(const Step& step) noexcept;
  void offer_command(const Step& step) noexcept;
  TruthIntake::Outcome take_truth(const Step& step) noexcept;
  void review() noexcept;
  void forget_past() noexcept;
  void begin_run() noexcept;
  void pass_over() noexcept;
  void advance(TruthTime until) noexcept;
  void take_sample(const Step& step) noexcept;
  void transmit(const Step& step) noexcept;
  void poll(HostTime now) noexcept;
  void execute(const Step& step) noexcept;
  void change(const Command& command) noexcept;
  void reload(Reload& reload, HostTime now) noexcept;

  StepSink& sink_;
  RunControl* const control_;
  FaultBook faults_;
  const std::vector<ExpectConfig> expectations_;
  WhenStopped when_stopped_;
  Timeline timeline_;
  TruthFaults* truth_faults_ = nullptr;  // of the intake's decoder; nullptr: truth cannot fail
  TruthIntake intake_;
  std::vector<std::unique_ptr<Channel>> channels_;
  std::vector<Channel*> prepared_;
  EncodingThread* encoding_ = nullptr;
  bool may_encode_apart_ = false;  // the imus and the sink allow it
  bool is_apart_ = false;          // encodes_apart()
  bool in_run_ = false;
  bool stopped_ = false;     // motion is held because truth has stopped
  bool unreviewed_ = false;  // truth has come since the samples that wait for theirs were reviewed
  TruthTime watermark_;
  HostTime polled_;  // up to which deadlines were polled
  std::uint64_t samples_in_run_ = 0;
  TruthQuality quality_;
};

}  // namespace imud
