// TruthIntake: moves records from the truth port to the timeline, counts refused ones by cause, and sends the
// messages of the truth format to the simulator.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "core/pose/pose_fit.hpp"
#include "core/timeline.hpp"
#include "emulator/ground/counters.hpp"
#include "emulator/ground/step_sink.hpp"
#include "emulator/plan/config.hpp"
#include "emulator/truth/place_watch.hpp"
#include "emulator/truth/sender_watch.hpp"
#include "emulator/truth/step_watch.hpp"
#include "protocols/truth_format.hpp"
#include "transports/port.hpp"

namespace imud {

// Owns the truth port and the format's decoder. One thread, but any thread may read counters().
class TruthIntake {
 public:
  // `config.format` must outlive this. `sink` takes received and sent packets. `decoder` decodes in place of the
  // format's decoder; nullptr: the format's decoder does.
  TruthIntake(const TruthConfig& config, Timeline& timeline, std::unique_ptr<Port> port,
              StepSink& sink = StepSink::none(), std::unique_ptr<TruthDecoder> decoder = nullptr);

  enum class Outcome : std::uint8_t {
    nothing,   // no record has arrived; wait for the descriptor, unless at_end()
    ignored,   // the record had no state, was refused, or waits for later ones, from which its motion is derived
    accepted,  // the truth is now the newest of the timeline
    inserted,  // the truth was reordered, and is inserted before the newest
    new_run,   // the truth has begun a new run of the timeline
    withheld,  // a fault delays or drops the truth
  };
  // Returns true if the timeline has taken the truth: truth() has its time.
  static constexpr bool is_taken(Outcome outcome) noexcept {
    return outcome == Outcome::accepted || outcome == Outcome::inserted || outcome == Outcome::new_run;
  }
  // Takes one record, if one has arrived. Never waits. One datagram may hold several records: wait for the
  // descriptor only after take() has returned `nothing`. `watermark`: see Timeline::push().
  Outcome take(TruthTime watermark = Timeline::never) noexcept;

  // The last truth that was accepted or inserted, or a refused repetition; valid unless the record was ignored.
  const Truth& truth() const noexcept { return truth_; }
  // Returns true from take() to answer() if a live sender of truth() waits for an answer, also after a refused
  // repetition.
  bool answer_due() const noexcept { return answer_due_ && is_live_; }
  // Answers truth() with the time up to which samples were emitted, and their number in the run.
  void answer(TruthTime emitted_until, std::uint64_t samples) noexcept;

  // Sets a servo of the format, see TruthDecoder::set_servo().
  void set_servo(std::size_t servo, std::uint16_t pulse_us) noexcept { decoder_->set_servo(servo, pulse_us); }

  // Returns when poll() has to be called next, for the messages of the format and the frames that the port holds
  // back; nullopt: it need not be; HostTime{}: at once. take() and answer() change it.
  std::optional<HostTime> deadline() const noexcept;
  // Sends the messages of the format that are due at `now`. Never waits.
  void poll(HostTime now) noexcept;

  // Returns true once take() will never take another record; valid after take() has returned `nothing`.
  bool at_end() const noexcept { return finished_; }
  int descriptor() const noexcept { return port_->descriptor(); }
  std::string chosen_port() const { return port_->chosen_port(); }
  // Returns true if the truth comes from a simulator, false if from a capture.
  bool is_live() const noexcept { return is_live_; }
  // Ends the input. Called after the last take().
  void finish() noexcept { decoder_->finish(); }
  // The arrival of the last record.
  HostTime arrival() const noexcept { return arrival_; }
  const TruthCounters& counters() const noexcept { return counters_; }
  // Describes the end of a damaged capture; empty if the capture is whole.
  std::string end_warning() const;

 private:
  void add_interface(const TruthConfig& config);
  void send() noexcept;
  std::optional<TruthResult> next_record() noexcept;
  void finish_input() noexcept;
  void watch_connection() noexcept;
  bool starts_again() const noexcept;
  bool is_reachable() const noexcept;
  void count_truncated() noexcept;
  void count_lost(Admission admission) noexcept;
  void count_step(Admission admission, Nanoseconds step) noexcept;
  void count_foreign() noexcept;
  void remark_columns() noexcept;
  void remark_no_force() noexcept;
  void remark_far_from_earth() noexcept;
  void remark_step(Nanoseconds step) noexcept;
  void remark_place() noexcept;
  void remark_no_place() noexcept;
  void remark_excess(bool follows) noexcept;
  void remark_last_line() noexcept;
  void remark_long_line() noexcept;
  void watch_senders() noexcept;
  Outcome derive(TruthTime watermark) noexcept;
  void count_outliers() noexcept;
  void report_fit() noexcept;
  std::optional<Outcome> take_derived(TruthTime watermark) noexcept;
  Outcome admit(TruthTime watermark) noexcept;
  Outcome refuse(Admission admission, TruthTime newest) noexcept;
  Outcome refuse(Refusal refusal) noexcept;
  Outcome refuse(TruthResult result) noexcept;
  Outcome refuse(Refusal refusal, TruthTime newest) noexcept;

  Timeline& timeline_;
  std::unique_ptr<Port> port_;
  StepSink& sink_;
  std::uint16_t interface_ = 0;  // of the record
  const TruthFormat& format_;
  std::unique_ptr<TruthDecoder> decoder_;
  std::optional<std::uint32_t> stream_;
  // The stage between decoder and timeline; null if nothing is derived.
  struct Derivation {
    PoseFit fit;
    Timeline order;              // the records as they arrive: it refuses late ones, and finds new runs
    std::uint64_t outliers = 0;  // the outliers that have been counted
  };
  std::unique_ptr<Derivation> derivation_;
  const bool ignores_force_;
  const bool is_window_chosen_;  // by the fit
  const bool needs_earth_;       // the gravitation depends on the position
  const bool is_stream_;         // the port does not keep datagrams apart
  const bool is_live_;           // a simulator is at the port's other end, and can receive
  bool started_ = false;         // the decoder's start() was called, and the simulator has not disconnected since
  bool is_drained_ = false;      // the port need not be asked before the descriptor is ready again
  bool has_ended_ = false;       // the port's input has ended; the decoder may still have its last record
  bool finished_ = false;        // the input has ended, and every record was taken
  const Timeline::Limits limits_;
  std::uint64_t times_lost_ = 0;  // PortCounters::lost_count of a stream at the last record
  bool is_back_ = false;          // no truth has come since the simulator has disconnected
  Truth truth_;
  std::uint32_t newest_sequence_ = 0;
  bool has_sequence_ = false;  // of a format without it, every number is 0
  StepWatch steps_;
  TimeUnitWatch unit_;
  BoundsWatch bounds_;
  PlaceWatch place_;
  SenderWatch senders_;
  Endpoint sender_;            // of the last record
  std::uint64_t foreign_ = 0;  // PortCounters::foreign at the last record
  int headers_ = 0;            // records without state that were looked at for columns that are not used
  bool answer_due_ = false;
  HostTime arrival_;
  FrameBuffer outgoing_;
  TruthCounters counters_;
};

}  // namespace imud
