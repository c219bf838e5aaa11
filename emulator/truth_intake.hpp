// TruthIntake: from the truth port to the timeline, refusing what is wrong, by cause; and what the truth format sends
// to the simulator.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "core/timeline.hpp"
#include "emulator/config.hpp"
#include "emulator/counters.hpp"
#include "protocols/truth_format.hpp"
#include "transports/port.hpp"

namespace imud {

// Owns the truth port and the format's decoder. One thread; only counters() may be read by any.
class TruthIntake {
 public:
  TruthIntake(const TruthConfig& config, Timeline& timeline, std::unique_ptr<Port> port);

  enum class Outcome : std::uint8_t {
    nothing,   // no record is there (at_end() tells whether one will ever be); wait for the descriptor
    ignored,   // a record without state, or one that was refused
    accepted,  // it is the newest now
    inserted,  // accepted, though another has overtaken it
    new_run,   // accepted, and the timeline has begun anew with it
  };
  // Takes one record, if there is one. Never waits. One datagram may hold several records: call it until it returns
  // `nothing` before waiting for the descriptor. `settled`: see Timeline::push().
  Outcome take(TruthTime settled = Timeline::never) noexcept;

  // The last record's truth, unless it was ignored; and whether its sender waits for an answer, which holds for
  // refused repetitions too.
  const Truth& truth() const noexcept { return truth_; }
  bool answer_due() const noexcept { return answer_due_; }
  // Answers it: the time reached and the samples emitted so far in the run.
  void answer(TruthTime reached, std::uint64_t samples) noexcept;

  // When poll() is to be called next, for what the format sends by itself and what the port holds back; nullopt if
  // that is no matter of time. HostTime{}: at once. Changes with take() and answer(), too.
  std::optional<HostTime> deadline() const noexcept;
  // Sends what is due at `now`. Never waits.
  void poll(HostTime now) noexcept;

  // True once take() will never take another record; valid after take() has returned `nothing`.
  bool at_end() const noexcept { return finished_; }
  int descriptor() const noexcept { return port_->descriptor(); }
  // Arrival of the last record.
  HostTime arrival() const noexcept { return arrival_; }
  const TruthCounters& counters() const noexcept { return counters_; }
  // How the capture ended, if not well; empty otherwise.
  std::string end_warning() const;

 private:
  std::optional<TruthResult> next_record() noexcept;
  void finish_input() noexcept;
  bool is_reachable() const noexcept;
  void count_truncated() noexcept;
  void count_lost(Admission admission) noexcept;
  Outcome refuse(Refusal refusal) noexcept;

  Timeline& timeline_;
  std::unique_ptr<Port> port_;
  std::unique_ptr<TruthDecoder> decoder_;
  std::optional<std::uint32_t> stream_;
  const bool is_stream_;          // otherwise the port keeps datagrams apart
  const bool is_live_;            // a simulator is at the port's other end, which can be sent something
  bool started_ = false;          // start() was called, and the simulator has not left
  bool finished_ = false;         // the port's input has ended, and every record of it was taken
  std::uint64_t times_lost_ = 0;  // PortCounters::lost_count of a stream, as last seen
  Truth truth_;
  std::uint32_t newest_sequence_ = 0;
  bool answer_due_ = false;
  HostTime arrival_;
  FrameBuffer outgoing_;
  TruthCounters counters_;
};

}  // namespace imud
