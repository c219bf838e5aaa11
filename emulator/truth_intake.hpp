// TruthIntake: from the truth port to the timeline, refusing what is wrong, by cause.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include "core/timeline.hpp"
#include "emulator/config.hpp"
#include "emulator/counters.hpp"
#include "emulator/line_splitter.hpp"
#include "protocols/truth_format.hpp"
#include "transports/port.hpp"

namespace imud {

class TruthIntake {
 public:
  TruthIntake(const TruthConfig& config, Timeline& timeline, std::unique_ptr<Port> port);

  enum class Outcome : std::uint8_t {
    nothing,   // no record is there (at_end() tells whether one will ever be)
    ignored,   // a record without state, or one that was refused
    accepted,  // it is the newest now
    inserted,  // accepted, though another has overtaken it
    new_run,   // accepted, and the timeline has begun anew with it
  };
  // Takes one record, if there is one. Never waits. `settled`: see Timeline::push().
  Outcome take(TruthTime settled = Timeline::never) noexcept;

  // The last record's truth, unless it was ignored; and whether its sender waits for an answer, which holds for
  // refused repetitions too.
  const Truth& truth() const noexcept { return truth_; }
  bool answer_due() const noexcept { return answer_due_; }
  // Answers it: the time reached and the samples emitted so far in the run.
  void answer(TruthTime reached, std::uint64_t samples) noexcept;

  bool at_end() const noexcept { return port_->at_end(); }
  int descriptor() const noexcept { return port_->descriptor(); }
  // Arrival of the last record.
  HostTime arrival() const noexcept { return arrival_; }
  const TruthCounters& counters() const noexcept { return counters_; }
  // How the capture ended, if not well; empty otherwise.
  std::string end_warning() const;

 private:
  bool next_record(std::span<const std::byte>& record) noexcept;
  void count_lost(Admission admission) noexcept;
  Outcome refuse(Refusal refusal) noexcept;

  Timeline& timeline_;
  std::unique_ptr<Port> port_;
  std::unique_ptr<TruthDecoder> decoder_;
  std::optional<std::uint32_t> stream_;
  bool lines_;  // a record is a line of a text file
  LineSplitter splitter_;
  bool splitting_ = false;
  Truth truth_;
  std::uint32_t newest_sequence_ = 0;
  bool answer_due_ = false;
  HostTime arrival_;
  FrameBuffer answer_;
  TruthCounters counters_;
};

}  // namespace imud
