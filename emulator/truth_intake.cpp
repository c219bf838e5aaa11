#include "emulator/truth_intake.hpp"

#include <fmt/format.h>

namespace imud {

std::string_view cause(Refusal refusal) noexcept {
  switch (refusal) {
    case Refusal::too_short:
      return cause(TruthResult::too_short);
    case Refusal::too_long:
      return cause(TruthResult::too_long);
    case Refusal::not_this_kind:
      return cause(TruthResult::not_this_kind);
    case Refusal::bad_version:
      return cause(TruthResult::bad_version);
    case Refusal::bad_checksum:
      return cause(TruthResult::bad_checksum);
    case Refusal::bad_number:
      return cause(TruthResult::bad_number);
    case Refusal::not_finite:
      return cause(TruthResult::not_finite);
    case Refusal::out_of_range:
      return cause(TruthResult::out_of_range);
    case Refusal::no_columns:
      return cause(TruthResult::no_columns);
    case Refusal::duplicate:
      return "duplicate";
    case Refusal::reordered:
      return "reordered";
    case Refusal::time_back:
      return "time_back";
    case Refusal::time_jump:
      return "time_jump";
    case Refusal::other_stream:
      return "stream";
    case Refusal::count:
      break;
  }
  return "";
}

std::string_view remedy(Refusal refusal) noexcept {
  switch (refusal) {
    case Refusal::too_short:
    case Refusal::too_long:
    case Refusal::not_this_kind:
    case Refusal::bad_version:
      return "another format? see truth.format and imud list";
    case Refusal::no_columns:
      return "no header row has named every required column; name them in truth.columns";
    case Refusal::bad_checksum:
      return "damaged on its way, or another CRC than CRC-32C";
    case Refusal::bad_number:
      return "not a number where one is wanted";
    case Refusal::not_finite:
      return "NaN or infinity: the simulation has diverged";
    case Refusal::out_of_range:
      return "no vehicle does that: check units";
    case Refusal::duplicate:
      return "that instant is there already";
    case Refusal::reordered:
      return "overtaken on its way";
    case Refusal::time_back:
      return "the sender's clock ran back; a sender that starts again says so by the new-run flag";
    case Refusal::time_jump:
      return "further ahead than truth.max_gap_ms";
    case Refusal::other_stream:
      return "another vehicle; see truth.stream";
    case Refusal::count:
      break;
  }
  return "";
}

namespace {

Refusal refusal(TruthResult result) noexcept {
  switch (result) {
    case TruthResult::too_short:
      return Refusal::too_short;
    case TruthResult::too_long:
      return Refusal::too_long;
    case TruthResult::bad_version:
      return Refusal::bad_version;
    case TruthResult::bad_checksum:
      return Refusal::bad_checksum;
    case TruthResult::bad_number:
      return Refusal::bad_number;
    case TruthResult::not_finite:
      return Refusal::not_finite;
    case TruthResult::out_of_range:
      return Refusal::out_of_range;
    case TruthResult::no_columns:
      return Refusal::no_columns;
    case TruthResult::not_this_kind:
    default:
      return Refusal::not_this_kind;
  }
}

void increment(TruthCounters::Counter& counter) noexcept { counter.fetch_add(1, std::memory_order_relaxed); }

}  // namespace

TruthIntake::TruthIntake(const TruthConfig& config, Timeline& timeline, std::unique_ptr<Port> port)
    : timeline_(timeline),
      port_(std::move(port)),
      decoder_(config.format->make(config.settings)),
      stream_(config.stream),
      lines_(config.port.starts_with("file:")) {}

bool TruthIntake::next_record(std::span<const std::byte>& record) noexcept {
  constexpr int most = 256;  // chunks without a record, before the caller may look at other things
  for (int i = 0; i < most; ++i) {
    if (splitting_) {
      if (const auto line = splitter_.next()) {
        record = *line;
        return true;
      }
      splitting_ = false;
    }
    const auto received = port_->receive();
    if (!received) return false;
    arrival_ = received->time;
    if (!lines_) {
      record = received->frame.bytes;
      return true;
    }
    splitter_.feed(received->frame.bytes);
    splitting_ = true;
  }
  return false;
}

TruthIntake::Outcome TruthIntake::refuse(Refusal refusal) noexcept {
  increment(counters_.refused[static_cast<std::size_t>(refusal)]);
  return Outcome::ignored;
}

// By the sequence numbers; a format without has 0 in all.
void TruthIntake::count_lost(Admission admission) noexcept {
  constexpr std::uint32_t believable = 100'000;
  const std::uint32_t step = truth_.sequence - newest_sequence_;
  if (admission == Admission::inserted) {
    if (counters_.lost > 0) counters_.lost.fetch_sub(1, std::memory_order_relaxed);
    return;
  }
  if (admission == Admission::accepted && step > 1 && step < believable)
    counters_.lost.fetch_add(step - 1, std::memory_order_relaxed);
  newest_sequence_ = truth_.sequence;
}

TruthIntake::Outcome TruthIntake::take(TruthTime settled) noexcept {
  answer_due_ = false;
  std::span<const std::byte> record;
  if (!next_record(record)) {
    const bool last_is_cut = splitter_.rest() > 0 || !port_->end_warning().empty();
    counters_.truncated.store(port_->counters().truncated + splitter_.too_long() + (last_is_cut ? 1U : 0U),
                              std::memory_order_relaxed);
    return Outcome::nothing;
  }
  increment(counters_.received);
  const TruthResult result = decoder_->decode(record, truth_);
  if (result == TruthResult::no_state) {
    increment(counters_.no_state);
    return Outcome::ignored;
  }
  if (result != TruthResult::ok) return refuse(refusal(result));
  if (!stream_) stream_ = truth_.stream;
  if (truth_.stream != *stream_) return refuse(Refusal::other_stream);

  answer_due_ = truth_.acknowledge;
  const Admission admission = timeline_.push(truth_, settled);
  switch (admission) {
    case Admission::accepted:
    case Admission::inserted:
    case Admission::new_run:
      if (counters_.accepted == 0) counters_.first_ns.store(arrival_.ns, std::memory_order_relaxed);
      counters_.newest_ns.store(arrival_.ns, std::memory_order_relaxed);
      increment(counters_.accepted);
      count_lost(admission);
      break;
    default:
      break;
  }
  switch (admission) {
    case Admission::accepted:
      return Outcome::accepted;
    case Admission::inserted:
      increment(counters_.inserted);
      return Outcome::inserted;
    case Admission::new_run:
      increment(counters_.runs);
      return Outcome::new_run;
    case Admission::duplicate:
      return refuse(Refusal::duplicate);
    case Admission::reordered:
      return refuse(Refusal::reordered);
    case Admission::time_back:
      return refuse(Refusal::time_back);
    case Admission::time_jump:
      break;
  }
  return refuse(Refusal::time_jump);
}

void TruthIntake::answer(TruthTime reached, std::uint64_t samples) noexcept {
  answer_.clear();
  decoder_->acknowledge(truth_, reached, samples, answer_);
  port_->send(answer_.frames());
}

std::string TruthIntake::end_warning() const {
  if (splitter_.rest() > 0) return fmt::format("cut short: {} bytes after the last whole line", splitter_.rest());
  return std::string(port_->end_warning());
}

}  // namespace imud
