#include "emulator/truth/truth_intake.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "emulator/truth/remark_text.hpp"
#include "transports/socket/host_address.hpp"

namespace imud {

namespace {

// Returns true for a file, a fifo or a connection, whose bytes arrive in pieces of any length.
bool is_stream(const std::string& text, const Port& port) noexcept {
  const Transport* transport = transport_of(text);
  return !port.keeps_datagrams().value_or(transport != nullptr && transport->keeps_datagrams);
}

// Returns the address at which `port` receives datagrams, as far as its text gives it.
Endpoint address_of(const std::string& port) {
  const Transport* transport = transport_of(port);
  Endpoint address;
  if (transport == nullptr || transport->udp_port == nullptr) return address;
  try {
    const PortSpec spec = PortSpec::parse(port);
    if (!transport->ends) address = Endpoint::parse(HostAddress::parse(spec.address).numeric().address);
    address.port = transport->udp_port(spec).value_or(0);
  } catch (const PortError&) {  // the address stays unknown
  }
  return address;
}

}  // namespace

TruthIntake::TruthIntake(const TruthConfig& config, Timeline& timeline, std::unique_ptr<Port> port, StepSink& sink,
                         std::unique_ptr<TruthDecoder> decoder)
    : timeline_(timeline),
      port_(std::move(port)),
      sink_(sink),
      format_(*config.format),
      decoder_(decoder ? std::move(decoder) : config.format->make(config.settings)),
      stream_(config.stream),
      derivation_(config.fit ? new Derivation{PoseFit(*config.fit), Timeline(config.limits)} : nullptr),
      ignores_force_(config.ignores_force),
      is_window_chosen_(config.fit && config.fit->widest > 0),
      needs_earth_(config.fit && config.fit->gravitation.needs_position()),
      is_stream_(is_stream(config.port, *port_)),
      is_live_(!is_capture(config.port)),
      limits_(config.limits),
      bounds_(config.bounds),
      place_(config) {
  remark_columns();
  if (sink_.keeps()) add_interface(config);
}

void TruthIntake::add_interface(const TruthConfig& config) {
  interface_ = sink_.add_interface(std::string(truth_interface), is_stream_ ? link_type::bytes : link_type::raw_ip);
  const std::string chosen = port_->chosen_port();
  sink_.set_truth_address(address_of(chosen.empty() ? config.port : chosen));
}

// Sends `outgoing_`.
void TruthIntake::send() noexcept {
  port_->send(outgoing_.frames());
  for (const Frame& frame : outgoing_.frames())
    sink_.packet(interface_, PacketDirection::outbound, sink_.now(), frame, sender_);
}

// Called when the input has ended, or the simulator has disconnected. The rest of an incomplete record will not come.
void TruthIntake::finish_input() noexcept {
  decoder_->finish();
  if (derivation_ != nullptr) {
    derivation_->fit.finish();
    count_outliers();
  }
  started_ = false;
}

// Ends the stream where the simulator disconnects, also in a capture.
void TruthIntake::watch_connection() noexcept {
  if (!is_stream_ && is_live_) return;
  const PortCounters& port = port_->counters();
  counters_.connections_refused.store(port.connections_refused, std::memory_order_relaxed);
  if (port.lost_count != times_lost_) {
    times_lost_ = port.lost_count;
    counters_.disconnections.store(port.lost_count, std::memory_order_relaxed);
    is_back_ = true;
    finish_input();
    sink_.event({.type = RecordEvent::Type::disconnected});
  }
  counters_.port_state.store(port_->state(), std::memory_order_release);
}

// Returns true if a connection's first truth does not continue the truth of the connection before.
bool TruthIntake::starts_again() const noexcept {
  if (timeline_.empty()) return false;
  const Nanoseconds ahead = truth_.time - timeline_.newest();
  return ahead.count() < 0 || ahead > limits_.max_gap;
}

std::optional<TruthResult> TruthIntake::next_record() noexcept {
  constexpr int most = 256;  // pieces without a record in one call, so that the caller can do other work
  for (int i = 0; i < most; ++i) {
    if (const auto result = decoder_->next(truth_)) return result;
    if (std::exchange(is_drained_, false)) break;
    const auto received = port_->receive();
    watch_connection();
    if (!received) {
      if (port_->at_end() && !std::exchange(has_ended_, true)) {
        sink_.event({.type = RecordEvent::Type::disconnected, .flags = RecordEvent::input_ended});
        if (is_stream_) decoder_->end_of_file();
        if (const auto last = decoder_->next(truth_)) return last;
      }
      if (port_->at_end() && !std::exchange(finished_, true)) {
        finish_input();
        counters_.remarks.content.set([&](std::span<char> room) {
          const std::string_view content = port_->other_content();
          return write_remark(room, "{}{}", content.empty() ? "" : "the capture has ", content);
        });
      }
      break;
    }
    is_drained_ = received->is_last;
    arrival_ = received->time;
    sender_ = received->from;
    // A capture's own time stamps are no host times.
    sink_.packet(interface_, PacketDirection::inbound, is_live_ ? arrival_ : sink_.now(), received->frame, sender_);
    const bool is_stream = is_stream_ || received->is_piece;
    decoder_->feed(received->frame.bytes, is_stream ? TruthInput::stream : TruthInput::datagram, arrival_);
  }
  return std::nullopt;
}

// The count is stored with release order, so that the log, which reads the count, also sees the remark that was set
// before.
TruthIntake::Outcome TruthIntake::refuse(Refusal refusal) noexcept {
  counters_.refused[static_cast<std::size_t>(refusal)].fetch_add(1, std::memory_order_release);
  return Outcome::ignored;
}

TruthIntake::Outcome TruthIntake::refuse(TruthResult result) noexcept {
  const Refusal cause = refusal(result);
  if (counters_.refused[static_cast<std::size_t>(cause)] == 0)
    counters_.refused.first[static_cast<std::size_t>(cause)].set(
        [&](std::span<char> room) { return decoder_->describe(result, room); });
  return refuse(cause);
}

// `newest`: the time of the newest truth.
TruthIntake::Outcome TruthIntake::refuse(Refusal refusal, TruthTime newest) noexcept {
  counters_.refused.first[static_cast<std::size_t>(refusal)].set([&](std::span<char> room) {
    return write_remark(room, "its time is {} ns, and that of the newest {} ns", truth_.time.ns, newest.ns);
  });
  return refuse(refusal);
}

// Counts the datagrams that the port has dropped because they came from another sender.
void TruthIntake::count_foreign() noexcept {
  const PortCounters& port = port_->counters();
  constexpr auto cause = static_cast<std::size_t>(Refusal::foreign_sender);
  counters_.refused.first[cause].set(
      [&](std::span<char> room) { return write_remark(room, "from {}", EndpointText(port.foreign_from).whole()); });
  const std::uint64_t further = port.foreign - std::exchange(foreign_, port.foreign);
  counters_.received.count(further);
  counters_.refused[cause].fetch_add(further, std::memory_order_release);
}

void TruthIntake::remark_step(Nanoseconds step) noexcept {
  if (!unit_.is_wrong(step)) [[likely]]
    return;
  counters_.remarks.time_unit.set([&](std::span<char> room) {
    return write_remark(room, "time rises by {} ns from truth to truth: is it in {} instead of ns?",
                        unit_.step().count(), unit_.probable_unit());
  });
}

void TruthIntake::watch_senders() noexcept {
  constexpr std::uint64_t few = 3;  // a simulator that starts again may overlap with itself
  if (!senders_.has_come_back(sender_, arrival_)) return;
  counters_.sender_changes.count();
  if (counters_.sender_changes < few) return;
  counters_.remarks.senders.set([&](std::span<char> room) {
    const EndpointText one(sender_), other(senders_.other());
    const bool same = one.address() == other.address();
    return write_remark(room, "two senders send in turn, {} and {}; truth.from = \"{}\" admits only one", one.whole(),
                        other.whole(), same ? one.whole() : one.address());
  });
}

// Counts lost truths by the sequence numbers. A format without sequence numbers has 0 in every truth.
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
  if (const auto derived = take_derived(watermark)) return *derived;
  const auto result = next_record();
  constexpr std::uint64_t between_reports = 256;  // records
  if (!is_live_ && (!result || counters_.received % between_reports == 0))
    counters_.progress.store(port_->progress().value_or(-1), std::memory_order_relaxed);
  if (port_->counters().foreign != foreign_) [[unlikely]]
    count_foreign();
  if (!result) {
    count_truncated();
    return take_derived(watermark).value_or(Outcome::nothing);
  }
  if (*result == TruthResult::withheld) return Outcome::withheld;
  counters_.received.count();
  if (*result == TruthResult::no_state) {
    remark_columns();
    counters_.no_state.count();
    return Outcome::ignored;
  }
  if (*result != TruthResult::ok) {
    if (sender_ != senders_.newest()) watch_senders();
    return refuse(*result);
  }
  if (!stream_) stream_ = truth_.stream;
  if (truth_.stream != *stream_) return refuse(Refusal::other_stream);
  if (sender_ != senders_.newest()) [[unlikely]]
    watch_senders();

  if (std::exchange(is_back_, false) && starts_again()) {
    timeline_.forget_past();  // so that the truth is no repetition of the run's first
    truth_.new_run = true;
  }
  answer_due_ = truth_.acknowledge;
  has_sequence_ = has_sequence_ || truth_.sequence != 0;
  if (ignores_force_) [[unlikely]] {
    truth_.has_specific_force = false;
    truth_.accumulated_dv = AccumulatedDv::none;
  }
  return derivation_ == nullptr ? admit(watermark) : derive(watermark);
}

// Gives the record to the fit, and takes from it the truth that is complete now.
TruthIntake::Outcome TruthIntake::derive(TruthTime watermark) noexcept {
  auto& [fit, order, unused] = *derivation_;
  const TruthTime newest = order.empty() ? truth_.time : order.newest();
  const Admission admission = order.push(truth_);
  if (admission != Admission::accepted && admission != Admission::new_run) return refuse(admission, newest);
  // After a gap of a capture, the timeline begins a run by itself, and the gap is counted.
  truth_.new_run = admission == Admission::new_run && (!limits_.gap_begins_run || truth_.time <= newest);
  fit.push(truth_);
  count_outliers();
  return take_derived(watermark).value_or(Outcome::ignored);
}

std::optional<TruthIntake::Outcome> TruthIntake::take_derived(TruthTime watermark) noexcept {
  answer_due_ = false;
  if (derivation_ == nullptr) return std::nullopt;
  const bool is_derived = derivation_->fit.next(truth_);
  if (!is_derived || counters_.accepted % 64 == 0) report_fit();
  if (!is_derived) return std::nullopt;
  answer_due_ = truth_.acknowledge;
  if (!is_finite(truth_) || !is_in_range(truth_)) return refuse(Refusal::out_of_range);
  return admit(watermark);
}

TruthIntake::Outcome TruthIntake::admit(TruthTime watermark) noexcept {
  if (!truth_.has_rate) [[unlikely]]
    return refuse(Refusal::no_rate);
  const TruthTime before = timeline_.empty() ? truth_.time : timeline_.newest();
  const Admission admission = timeline_.push(truth_, watermark);
  if (admission != Admission::accepted && admission != Admission::inserted && admission != Admission::new_run)
    return refuse(admission, before);
  if (counters_.accepted == 0) counters_.first_ns.store(arrival_.ns, std::memory_order_relaxed);
  counters_.newest_ns.store(arrival_.ns, std::memory_order_relaxed);
  counters_.accepted.count();
  count_lost(admission);
  count_step(admission, truth_.time - before);
  if (admission == Admission::accepted) remark_step(truth_.time - before);
  if (admission != Admission::inserted) {
    if (counters_.accepted == 1 || admission == Admission::new_run) remark_place();
    remark_excess(admission == Admission::accepted);
  }
  if (place_.lacks_place(truth_)) [[unlikely]]
    remark_no_place();
  if (!truth_.has_specific_force && truth_.accumulated_dv == AccumulatedDv::none) [[unlikely]]
    remark_no_force();
  if (truth_.is_force_derived && needs_earth_ && !is_near_earth(truth_.r_BN_N)) [[unlikely]]
    remark_far_from_earth();
  if (admission == Admission::accepted) return Outcome::accepted;
  if (admission == Admission::inserted) {
    counters_.inserted.count();
    return Outcome::inserted;
  }
  counters_.runs.count();
  return Outcome::new_run;
}

void TruthIntake::count_outliers() noexcept {
  const PoseFit::Outliers& found = derivation_->fit.outliers();
  if (found.count == derivation_->outliers) [[likely]]
    return;
  counters_.refused.first[static_cast<std::size_t>(Refusal::outlier)].set([&](std::span<char> room) {
    return found.distance > 0
               ? write_remark(room, "the pose at {} ns is {:.3g} m (a velocity: m/s) off; the bound is {:.3g}",
                              found.time.ns, found.distance, found.distance_bound)
               : write_remark(room, "the pose at {} ns is turned by {:.3g} rad; the bound is {:.3g}", found.time.ns,
                              found.angle, found.angle_bound);
  });
  for (; derivation_->outliers < found.count; ++derivation_->outliers) refuse(Refusal::outlier);
}

void TruthIntake::report_fit() noexcept {
  const PoseFit::Quality rate = derivation_->fit.rate_quality(), force = derivation_->fit.force_quality();
  if (rate.count + force.count == 0) return;
  FitFigures& figures = counters_.fit;
  figures.attitude_noise = rate.noise;
  figures.place_noise = force.noise;
  figures.rate_noise = rate.derived_noise;
  figures.force_noise = force.derived_noise;
  figures.rate_shortest = rate.shortest_s;
  figures.rate_mean = rate.mean_s;
  figures.rate_longest = rate.longest_s;
  figures.force_shortest = force.shortest_s;
  figures.force_mean = force.mean_s;
  figures.force_longest = force.longest_s;
  figures.known.store(true, std::memory_order_release);
  constexpr double large_rate = 0.01, large_force = 0.2;  // rad/s, m/s^2
  constexpr std::uint64_t enough = 200;                   // truths
  if (is_window_chosen_ || std::max(rate.count, force.count) < enough) return;
  if (rate.derived_noise > large_rate || force.derived_noise > large_force)
    counters_.remarks.noisy_poses.set([&](std::span<char> room) {
      return write_remark(
          room,
          "the noise of its poses, {:.2g} mrad and {:.2g} mm, becomes {:.2g} rad/s and {:.2g} m/s^2 with "
          "truth.fit_delay_ms = {:.6g}; give a longer one, or \"auto\" for a capture",
          1e3 * rate.noise, 1e3 * force.noise, rate.derived_noise, force.derived_noise,
          1e3 * std::max(rate.mean_s, force.mean_s));
    });
}

// `newest`: the time of the newest truth.
TruthIntake::Outcome TruthIntake::refuse(Admission admission, TruthTime newest) noexcept {
  switch (admission) {
    case Admission::duplicate:
      if (has_sequence_ && static_cast<std::int32_t>(newest_sequence_ - truth_.sequence) >= 0)
        counters_.repeated.count();
      else
        remark_step(Nanoseconds{0});
      return refuse(Refusal::duplicate, newest);
    case Admission::reordered:
      if (counters_.lost > 0) counters_.lost.fetch_sub(1, std::memory_order_relaxed);  // it has arrived
      return refuse(Refusal::reordered, newest);
    case Admission::time_back:
      return refuse(Refusal::time_back, newest);
    default:
      return refuse(Refusal::time_jump, newest);
  }
}

void TruthIntake::count_truncated() noexcept {
  const StreamLosses& losses = decoder_->losses();
  const std::uint64_t cut_short = std::max<std::uint64_t>(losses.cut_short, port_->end_warning().empty() ? 0 : 1);
  if (losses.last_lines > 0) remark_last_line();
  if (losses.longest > 0) remark_long_line();
  counters_.truncated.store(port_->counters().truncated + losses.too_long + cut_short, std::memory_order_relaxed);
}

void TruthIntake::answer(TruthTime emitted_until, std::uint64_t samples) noexcept {
  answer_due_ = false;
  if (!is_live_) return;
  outgoing_.clear();
  decoder_->acknowledge(truth_, emitted_until, samples, outgoing_);
  send();
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
    send();
  }
  port_->flush();
}

std::string TruthIntake::end_warning() const {
  const std::size_t bytes = decoder_->losses().cut_short_by;
  if (const std::size_t lines = decoder_->losses().cut_short_lines; lines > 0)
    return fmt::format("cut short: {} whole lines{} of a message without its end", lines,
                       bytes > 0 ? fmt::format(" and {} bytes", bytes) : "");
  if (bytes > 0) return fmt::format("cut short: {} bytes after the last whole line", bytes);
  return std::string(port_->end_warning());
}

}  // namespace imud
