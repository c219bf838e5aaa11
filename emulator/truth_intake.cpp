#include "emulator/truth_intake.hpp"

#include <fmt/format.h>

namespace imud {

namespace {

void increment(Counter& counter) noexcept { counter.fetch_add(1, std::memory_order_relaxed); }

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
