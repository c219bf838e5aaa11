#include "emulator/truth_intake.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace imud {

namespace {

// Returns true for a file, a fifo or a connection, whose bytes arrive in pieces of any length.
bool is_stream(const std::string& port) noexcept {
  const Transport* transport = transport_of(port);
  return transport == nullptr || !transport->keeps_datagrams;
}

}  // namespace

TruthIntake::TruthIntake(const TruthConfig& config, Timeline& timeline, std::unique_ptr<Port> port)
    : timeline_(timeline),
      port_(std::move(port)),
      decoder_(config.format->make(config.settings)),
      stream_(config.stream),
      is_stream_(is_stream(config.port)),
      is_live_(!is_capture(config.port)) {}

// Called when the input has ended, or the simulator has disconnected. The rest of an incomplete record will not come.
void TruthIntake::finish_input() noexcept {
  decoder_->finish();
  started_ = false;
}

std::optional<TruthResult> TruthIntake::next_record() noexcept {
  constexpr int most = 256;  // pieces without a record in one call, so that the caller can do other work
  for (int i = 0; i < most; ++i) {
    if (const auto result = decoder_->next(truth_)) return result;
    const auto received = port_->receive();
    if (is_stream_ && port_->counters().lost_count != times_lost_) {
      times_lost_ = port_->counters().lost_count;
      finish_input();
    }
    if (!received) {
      if (port_->at_end() && !std::exchange(finished_, true)) finish_input();
      break;
    }
    arrival_ = received->time;
    decoder_->feed(received->frame.bytes, is_stream_ ? TruthInput::stream : TruthInput::datagram, arrival_);
  }
  return std::nullopt;
}

TruthIntake::Outcome TruthIntake::refuse(Refusal refusal) noexcept {
  counters_.refused[static_cast<std::size_t>(refusal)].count();
  return Outcome::ignored;
}

// Counts by the sequence numbers. A format without them has 0 in every truth.
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

// `step`: from the truth that was the newest.
void TruthIntake::count_step(Admission admission, Nanoseconds step) noexcept {
  bool is_gap = false;
  if (admission == Admission::new_run) {
    is_gap = step.count() > 0 && !truth_.new_run;
    steps_.begin_run();
  } else if (admission == Admission::accepted) {
    is_gap = steps_.is_gap(step);
    counters_.simulated_ns.fetch_add(step.count(), std::memory_order_relaxed);
  }
  if (!is_gap) return;
  counters_.gaps.count();
  counters_.longest_gap_ns = std::max(counters_.longest_gap_ns.load(), step.count());
}

TruthIntake::Outcome TruthIntake::take(TruthTime watermark) noexcept {
  answer_due_ = false;
  const auto result = next_record();
  constexpr std::uint64_t between_reports = 256;  // records
  if (!is_live_ && (!result || counters_.received % between_reports == 0))
    counters_.progress.store(port_->progress().value_or(-1), std::memory_order_relaxed);
  if (!result) {
    count_truncated();
    return Outcome::nothing;
  }
  counters_.received.count();
  if (*result == TruthResult::no_state) {
    counters_.no_state.count();
    return Outcome::ignored;
  }
  if (*result != TruthResult::ok) return refuse(refusal(*result));
  if (!stream_) stream_ = truth_.stream;
  if (truth_.stream != *stream_) return refuse(Refusal::other_stream);

  answer_due_ = truth_.acknowledge;
  has_sequence_ = has_sequence_ || truth_.sequence != 0;
  const TruthTime before = timeline_.empty() ? truth_.time : timeline_.newest();
  const Admission admission = timeline_.push(truth_, watermark);
  switch (admission) {
    case Admission::accepted:
    case Admission::inserted:
    case Admission::new_run:
      if (counters_.accepted == 0) counters_.first_ns.store(arrival_.ns, std::memory_order_relaxed);
      counters_.newest_ns.store(arrival_.ns, std::memory_order_relaxed);
      counters_.accepted.count();
      count_lost(admission);
      count_step(admission, truth_.time - before);
      break;
    default:
      break;
  }
  switch (admission) {
    case Admission::accepted:
      return Outcome::accepted;
    case Admission::inserted:
      counters_.inserted.count();
      return Outcome::inserted;
    case Admission::new_run:
      counters_.runs.count();
      return Outcome::new_run;
    case Admission::duplicate:
      if (has_sequence_ && static_cast<std::int32_t>(newest_sequence_ - truth_.sequence) >= 0)
        counters_.repeated.count();
      return refuse(Refusal::duplicate);
    case Admission::reordered:
      if (counters_.lost > 0) counters_.lost.fetch_sub(1, std::memory_order_relaxed);  // it has arrived
      return refuse(Refusal::reordered);
    case Admission::time_back:
      return refuse(Refusal::time_back);
    case Admission::time_jump:
      break;
  }
  return refuse(Refusal::time_jump);
}

void TruthIntake::count_truncated() noexcept {
  const StreamLosses& losses = decoder_->losses();
  const std::uint64_t cut_short = std::max<std::uint64_t>(losses.cut_short, port_->end_warning().empty() ? 0 : 1);
  counters_.truncated.store(port_->counters().truncated + losses.too_long + cut_short, std::memory_order_relaxed);
}

void TruthIntake::answer(TruthTime emitted_until, std::uint64_t samples) noexcept {
  if (!is_live_) return;
  outgoing_.clear();
  decoder_->acknowledge(truth_, emitted_until, samples, outgoing_);
  port_->send(outgoing_.frames());
}

bool TruthIntake::is_reachable() const noexcept {
  return is_live_ && (!is_stream_ || port_->state() == PortState::ready);
}

std::optional<HostTime> TruthIntake::deadline() const noexcept {
  if (!is_reachable()) return std::nullopt;
  if (!started_) return HostTime{};
  const auto deadline = decoder_->deadline(), held_back = port_->next_flush();
  if (!deadline || !held_back) return deadline ? deadline : held_back;
  return std::min(*deadline, *held_back);
}

void TruthIntake::poll(HostTime now) noexcept {
  if (!is_reachable()) return;
  if (!std::exchange(started_, true)) decoder_->start(now);
  if (const auto deadline = decoder_->deadline(); deadline && *deadline <= now) {
    outgoing_.clear();
    decoder_->poll(now, outgoing_);
    port_->send(outgoing_.frames());
  }
  port_->flush();
}

std::string TruthIntake::end_warning() const {
  const std::size_t bytes = decoder_->losses().cut_short_by;
  if (bytes > 0) return fmt::format("cut short: {} bytes after the last whole line", bytes);
  return std::string(port_->end_warning());
}

}  // namespace imud
