// TruthIntake: from the truth port to the timeline, refusing what is wrong, by cause.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include "core/timeline.hpp"
#include "emulator/config.hpp"
#include "emulator/line_splitter.hpp"
#include "protocols/truth_format.hpp"
#include "transports/port.hpp"

namespace imud {

// Why a truth never reached the model. The words of TruthResult, of Admission, and one more.
enum class Refusal : std::uint8_t {
  too_short,
  too_long,
  not_this_kind,
  bad_version,
  bad_checksum,
  bad_number,
  not_finite,
  out_of_range,
  no_columns,
  duplicate,
  reordered,
  time_back,
  time_jump,
  other_stream,
  count
};
std::string_view cause(Refusal refusal) noexcept;
// What would be right, for the log.
std::string_view remedy(Refusal refusal) noexcept;

// Written by the thread that samples, read by any.
struct TruthCounters {
  using Counter = std::atomic<std::uint64_t>;
  Counter received = 0;  // records
  Counter no_state = 0;  // headers, blank lines
  Counter accepted = 0;
  Counter inserted = 0;                    // of these, overtaken on their way, but still in time
  Counter lost = 0;                        // that the sender's sequence numbers say are missing
  Counter runs = 0;                        // times that the timeline began anew, the first included
  std::atomic<std::int64_t> first_ns = 0;  // arrival of the first truth accepted, and of the newest
  std::atomic<std::int64_t> newest_ns = 0;
  Counter truncated = 0;  // records of a capture that are cut short
  std::array<Counter, static_cast<std::size_t>(Refusal::count)> refused = {};
};

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
