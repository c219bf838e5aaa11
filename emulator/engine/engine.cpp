#include "emulator/engine/engine.hpp"

#include <algorithm>
#include <utility>

#include "emulator/imu/reload.hpp"

namespace imud {

Engine::Engine(const Config& config, const Ports& ports, StepSink& sink, RunControl* control)
    : sink_(sink),
      control_(control),
      faults_(config.faults, config.control.faults, config.imus.size()),
      expectations_(config.expectations),
      when_stopped_(config.truth.when_stopped),
      timeline_(config.truth.limits),
      intake_(config.truth, timeline_,
              ports({PortUse::Of::truth, 0, 0, config.truth.port, config.truth.port_settings}), sink,
              with_faults(config.truth.format->make(config.truth.settings), faults_.configured(), config.seed,
                          faults_.log(), faults_.capacity() - faults_.configured().size(), truth_faults_)) {
  for (const ImuConfig& imu : config.imus) {
    const std::uint64_t seed = imu.seed.value_or(config.seed);
    channels_.push_back(std::make_unique<Channel>(imu, channels_.size(), seed, ports, sink, faults_of(imu, seed)));
  }
  if (control_ != nullptr)
    for (const auto& channel : channels_) {
      channel->awaited.set_feed(&control_->feed);
      if (SolutionJudge* judge = channel->sensor.judge()) judge->watch(control_->feed, channel->number);
    }
  prepared_.reserve(channels_.size());
}

// Returns nullptr if the imu can have no faults, and nothing is expected of its host.
std::unique_ptr<ChannelFaults> Engine::faults_of(const ImuConfig& imu, std::uint64_t seed) {
  if (imu.errors_model == model_of_truth) return nullptr;
  const std::span<const FaultConfig> configured = faults_.configured();
  if (!faults_.can_grow() &&
      std::none_of(configured.begin(), configured.end(), [&](const FaultConfig& f) { return f.acts_on(imu.name); }) &&
      std::none_of(expectations_.begin(), expectations_.end(), [&](const auto& e) { return e.imu == imu.name; }))
    return nullptr;
  return std::make_unique<ChannelFaults>(configured, expectations_, imu, static_cast<std::uint16_t>(channels_.size()),
                                         seed, faults_.log(), faults_.capacity() - configured.size());
}

// Executes the steps that neither take a sample nor transmit one. The functions for each kind of step are out of
// line, so that no function saves registers that only another one needs.
TruthIntake::Outcome Engine::apply_other(const Step& step) noexcept {
  using Type = Step::Type;
  switch (step.event.type) {
    case Type::truth:
      return take_truth(step);
    case Type::deadlines:
      finish_encoding();
      poll(HostTime{step.event.a});
      break;
    default:
      finish_encoding();
      apply_rare(step);
      look_at_imus();
  }
  return TruthIntake::Outcome::nothing;
}

// Called before each step that may touch a device or a port.
void Engine::finish_encoding() noexcept {
  if (encoding_ != nullptr) encoding_->finish();
}

// Called after each step that may change faults or ports.
void Engine::look_at_imus() noexcept {
  may_encode_apart_ = encoding_ != nullptr && !sink_.keeps() && EncodingThread::serves(channels_);
  is_apart_ = is_apart_ && may_encode_apart_;
}

void Engine::encode_by(EncodingThread* encoding) noexcept {
  finish_encoding();
  encoding_ = encoding;
  look_at_imus();
}

// Executes the steps that are not part of every sample.
[[gnu::noinline]] void Engine::apply_rare(const Step& step) noexcept {
  using Type = Step::Type;
  const RecordEvent& event = step.event;
  if (!has_effect(step)) return;
  offer(step);
  Channel* const channel = traits_of(event).is_of_imu ? channels_[step.imu].get() : nullptr;
  switch (event.type) {
    case Type::power_on:
      channel->power_on(HostTime{event.a});
      break;
    case Type::power_cycle:
      for (const auto& one : channels_) one->cycle_power(HostTime{event.a});
      break;
    case Type::forget_past:
      forget_past();
      break;
    case Type::run:
      (event.flags & RecordEvent::goes_on) != 0 ? pass_over() : begin_run();
      break;
    case Type::set_clock: {
      const bool runs = (event.flags & RecordEvent::has_host_time) != 0;
      channel->set_clock(DeviceTime{event.a}, runs ? std::optional(HostTime{event.b}) : std::nullopt);
      break;
    }
    case Type::start_samples:
      channel->sensor.clock().start_samples();
      break;
    case Type::advance:
      advance(TruthTime{event.a});
      break;
    case Type::receive:
      channel->receive(step.content->frame, event.flags, HostTime{event.a});
      break;
    case Type::command:
    case Type::mark:
      execute(step);
      break;
    case Type::end:
      for (const auto& one : channels_) one->publish();
      break;
    case Type::truth:
    case Type::sample:
    case Type::transmit:
    case Type::deadlines:
      break;  // by apply()
    case Type::begin:
    case Type::disconnected:
    case Type::lost:
      break;  // of the record, not of the run
  }
}

// Returns false for a step that cannot be applied (in a damaged record the number of an imu, line or fault may be too
// large, or the content or the truth missing), and for an event that the record holds only as information.
bool Engine::has_effect(const Step& step) const noexcept {
  using Type = Step::Type;
  if (traits_of(step.event).is_of_imu && step.imu >= channels_.size()) return false;
  switch (step.event.type) {
    case Type::receive:
      return step.content != nullptr && step.event.flags < channels_[step.imu]->lines.all().size();
    case Type::advance:
      return !timeline_.empty();
    case Type::command:
      if (step.command_kind() == Command::Kind::reload)
        return step.content != nullptr && step.content->reload != nullptr;
      return step.command_kind() != Command::Kind::fault_begin || step.command_number() < faults_.all().size();
    case Type::begin:
    case Type::disconnected:
    case Type::lost:
      return false;
    case Type::deadlines:
    case Type::power_on:
    case Type::power_cycle:
    case Type::truth:
    case Type::forget_past:
    case Type::run:
    case Type::set_clock:
    case Type::start_samples:
    case Type::sample:
    case Type::transmit:
    case Type::end:
    case Type::mark:
      return true;
  }
  return false;
}

// Offers the sink a step that has not acted yet, with its bytes.
void Engine::offer(const Step& step) noexcept {
  if (!sink_.keeps()) return;
  RecordEvent event = step.event;
  if (event.type == Step::Type::advance)
    event = Step::advance(std::min(TruthTime{event.a}, timeline_.newest())).event;
  if (event.type == Step::Type::command || event.type == Step::Type::mark) return offer_command(step);
  keep(event, step.imu);
  if (event.type != Step::Type::receive) return;
  const auto host = static_cast<std::uint16_t>(channels_[step.imu]->lines.all()[event.flags].interface + 1);
  sink_.packet(host, PacketDirection::inbound, step.content->arrival, step.content->frame);
}

// The recorded event has the imu's interface in place of its number, and the time up to which deadlines were polled.
void Engine::keep(RecordEvent event, std::uint16_t imu) noexcept {
  if (imu < channels_.size())
    event.interface = channels_[imu]->lines.all()[0].interface;
  else if (event.type == Step::Type::command || event.type == Step::Type::mark)
    event.interface = RecordEvent::all_imus;
  if (traits_of(event).has_polled_time) event.b = polled_.ns;
  sink_.event(event);
}

[[gnu::noinline]] TruthIntake::Outcome Engine::take_truth(const Step& step) noexcept {
  const TruthIntake::Outcome outcome = intake_.take(TruthTime{step.event.b});
  if (outcome == TruthIntake::Outcome::nothing) return outcome;
  unreviewed_ = outcome == TruthIntake::Outcome::accepted;
  if (!sink_.keeps()) return outcome;
  RecordEvent event = step.event;
  event.flags = static_cast<std::uint8_t>(outcome);
  event.a = TruthIntake::is_taken(outcome) ? intake_.truth().time.ns : 0;
  keep(event, step.imu);
  return outcome;
}

[[gnu::noinline]] void Engine::review() noexcept {
  unreviewed_ = false;
  for (const auto& channel : channels_) channel->awaited.review(timeline_, quality_.extrapolation_error);
}

void Engine::forget_past() noexcept {
  unreviewed_ = false;
  if (!timeline_.empty()) timeline_.forget_past();
}

void Engine::begin_run() noexcept {
  if (timeline_.empty()) return;
  in_run_ = true;
  samples_in_run_ = 0;
  watermark_ = timeline_.run_start();
  if (truth_faults_ != nullptr) truth_faults_->begin_run(watermark_);
  for (const auto& channel : channels_) channel->begin_run(timeline_.run_start());
  if (control_ != nullptr)
    control_->events.push({.sample = channels_[0]->sensor.imu().next(), .time_ns = watermark_.ns});
}

// The next sample of each imu has no increments.
void Engine::pass_over() noexcept {
  for (const auto& channel : channels_) channel->begin_run(std::nullopt);
}

void Engine::advance(TruthTime until) noexcept {
  until = std::min(until, timeline_.newest());
  raise_watermark(until);
  for (const auto& channel : channels_) channel->sensor.advance(timeline_, until);
}

void Engine::take_sample(const Step& step) noexcept {
  if (step.imu >= channels_.size()) return;
  Channel& channel = *channels_[step.imu];
  const auto k = static_cast<std::uint64_t>(step.event.c);
  const bool at_rest = (step.event.flags & RecordEvent::at_rest) != 0;
  if ((!at_rest && timeline_.empty()) || (!step.at_once && prepared_.size() == prepared_.capacity())) return;
  if (at_rest) {
    if (sink_.keeps()) keep(step.event, step.imu);
    channel.sensor.sense_at_rest(Nanoseconds(step.event.a), k);
    channel.prepare(std::nullopt, false);
  } else {
    const TruthTime time{step.event.a};
    channel.sensor.sense(timeline_, time, k);
    Sample& sample = channel.sensor.sample();
    if (step.at_once) {
      finish_encoding();
      channel.prepare(time, false);
      channel.encode(channel.prepared);
      channel.transmit();
      return;
    }
    raise_watermark(time);
    const bool held = (sample.status & status::truth_stale) != 0;
    if (sink_.keeps()) {
      RecordEvent event = step.event;
      event.flags = static_cast<std::uint8_t>(held ? MotionState::Basis::held
                                              : (sample.status & status::truth_extrapolated) != 0
                                                  ? MotionState::Basis::extrapolated
                                                  : MotionState::Basis::interpolated);
      event.b = timeline_.newest().ns;
      keep(event, step.imu);
    }
    // A stop lasts until motion is no longer held. A sample that precedes the first truth of its run is held, but
    // does not begin a stop.
    const bool stopped = held && (stopped_ || time >= timeline_.run_start());
    if (std::exchange(stopped_, stopped) != stopped) (stopped ? quality_.stops : quality_.returns).count();
    const bool silent = stopped && when_stopped_ == WhenStopped::silence;
    if (stopped && when_stopped_ == WhenStopped::flag) sample.status |= status::not_valid;
    channel.prepare(silent ? std::nullopt : std::optional(time), silent);
  }
  is_apart_ = (prepared_.empty() ? may_encode_apart_ : is_apart_) && !channel.prepared.is_shown &&
              (channel.sensor.sample().status & status::truth_extrapolated) == 0;
  if (!is_apart_) finish_encoding();
  prepared_.push_back(&channel);
}

void Engine::transmit(const Step& step) noexcept {
  const bool is_skipped = (step.event.flags & RecordEvent::skipped) != 0;
  if (is_apart_) return encoding_->put(prepared_);
  for (Channel* channel : prepared_) channel->encode(channel->prepared, is_skipped);
  if (sink_.keeps()) keep(step.event, step.imu);
}

void Engine::complete() noexcept {
  for (Channel* channel : prepared_) {
    if (!is_apart_) channel->count_sample();
    if ((channel->sensor.sample().status & status::at_rest) == 0) ++samples_in_run_;
  }
  prepared_.clear();
}

[[gnu::noinline]] void Engine::poll(HostTime now) noexcept {
  sink_.set_time(now);
  polled_ = now;
  intake_.poll(now);
  for (const auto& channel : channels_) channel->poll(now);
}

bool Engine::has_room_for_truth(TruthTime until) const noexcept {
  return !in_run_ || std::none_of(channels_.begin(), channels_.end(), [&](const auto& channel) {
    return timeline_.is_full_for(channel->sensor.used_until().value_or(until));
  });
}

void Engine::finish_faults() noexcept {
  intake_.finish();
  if (truth_faults_ != nullptr) truth_faults_->schedule().finish();
  for (const auto& channel : channels_)
    if (channel->faults) channel->faults->finish();
}

}  // namespace imud
