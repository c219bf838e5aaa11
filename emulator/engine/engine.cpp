#include "emulator/engine/engine.hpp"

#include <algorithm>
#include <utility>

namespace imud {

Engine::Engine(const Config& config, const Ports& ports, StepSink& sink, RunControl* control)
    : sink_(sink),
      control_(control),
      faults_(config.faults, config.control.faults),
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
    for (const auto& channel : channels_) channel->set_feed(control_->feed);
  constexpr std::size_t most_ports = 2;
  inputs_.reserve(most_ports * channels_.size() + 1);
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

std::vector<Expected> Engine::expected() const {
  std::vector<Expected> all;
  for (const auto& channel : channels_)
    for (Expected& one : channel->expected()) all.push_back(std::move(one));
  return all;
}

void Engine::finish_faults() noexcept {
  intake_.finish();
  if (truth_faults_ != nullptr) truth_faults_->schedule().finish();
  for (const auto& channel : channels_) channel->finish_faults();
}

ChosenPorts Engine::chosen_ports() const {
  ChosenPorts all;
  const auto add = [&all](std::string key, std::string port) {
    if (!port.empty()) all.emplace_back(std::move(key), std::move(port));
  };
  add("truth.port", intake_.chosen_port());
  for (const auto& channel : channels_) {
    add("imu." + channel->name() + ".port", channel->port(0).chosen_port());
    if (channel->port_count() == 2) add("imu." + channel->name() + ".second_port", channel->port(1).chosen_port());
    for (const DeviceLine& copy : channel->copies().lines())
      add("imu." + channel->name() + ".also", copy.port->chosen_port());
    if (channel->sync()) {
      add("imu." + channel->name() + ".sync.trigger_port", channel->sync()->chosen_trigger_port());
      add("imu." + channel->name() + ".sync.pps_port", channel->sync()->chosen_pps_port());
    }
  }
  return all;
}

void Engine::begin_run() noexcept {
  sink_.event({.type = RecordEvent::Type::run, .b = polled_.ns});
  in_run_ = true;
  samples_in_run_ = 0;
  truths_since_advance_ = 0;
  watermark_ = timeline_.run_start();
  if (truth_faults_ != nullptr) truth_faults_->begin_run(watermark_);
  for (const auto& channel : channels_) channel->begin_run(timeline_.run_start());
  if (control_ != nullptr)
    control_->events.push(
        {.kind = RunEvent::Kind::run, .sample = channels_[0]->next_sample(), .time_ns = watermark_.ns});
}

void Engine::pass_over() noexcept {
  sink_.event({.type = RecordEvent::Type::run, .flags = RecordEvent::goes_on, .b = polled_.ns});
  truths_since_advance_ = 0;
  for (const auto& channel : channels_) channel->pass_over();
}

void Engine::record_sample(const Channel& channel, std::uint8_t flags, std::int64_t time, std::uint64_t k) noexcept {
  sink_.event({RecordEvent::Type::sample, flags, channel.record_interface(), time,
               timeline_.empty() ? 0 : timeline_.newest().ns, static_cast<std::int64_t>(k)});
}

void Engine::prepare_at_rest(Channel& channel, std::uint64_t k, Nanoseconds since_power_on) noexcept {
  record_sample(channel, RecordEvent::at_rest, since_power_on.count(), k);
  channel.sense_at_rest(since_power_on, k);
  channel.prepare(std::nullopt, false);
}

void Engine::prepare(Channel& channel, std::uint64_t k, TruthTime time) noexcept {
  Sample& sample = channel.sense(timeline_, time, k);
  watermark_ = std::max(watermark_, time);
  const auto basis = (sample.status & status::truth_stale) != 0          ? MotionState::Basis::held
                     : (sample.status & status::truth_extrapolated) != 0 ? MotionState::Basis::extrapolated
                                                                         : MotionState::Basis::interpolated;
  record_sample(channel, static_cast<std::uint8_t>(basis), time.ns, k);

  const bool held = (sample.status & status::truth_stale) != 0;
  // A stop lasts until there is motion again. A sample that precedes the first truth of its run is held, but does
  // not begin a stop.
  const bool stopped = held && (stopped_ || time >= timeline_.run_start());
  if (std::exchange(stopped_, stopped) != stopped) (stopped ? quality_.stops : quality_.returns).count();
  const bool silent = stopped && when_stopped_ == WhenStopped::silence;
  if (stopped && when_stopped_ == WhenStopped::flag) sample.status |= status::not_valid;
  channel.prepare(silent ? std::nullopt : std::optional(time), silent);
}

void Engine::advance(TruthTime until) noexcept {
  constexpr std::size_t between_advances = Timeline::capacity / 2;
  if (++truths_since_advance_ < between_advances) return;
  truths_since_advance_ = 0;
  advance_imus(until);
}

void Engine::raise_watermark(TruthTime until) noexcept { watermark_ = std::max(watermark_, until); }

void Engine::advance_imus(TruthTime until) noexcept {
  until = std::min(until, timeline_.newest());
  sink_.event({.type = RecordEvent::Type::advance, .a = until.ns});
  raise_watermark(until);
  for (const auto& channel : channels_) channel->advance(timeline_, until);
}

bool Engine::has_room_for_truth(TruthTime until) noexcept {
  const auto is_full = [&] {
    return std::any_of(channels_.begin(), channels_.end(), [&](const auto& channel) {
      return timeline_.is_full_for(channel->used_until().value_or(until));
    });
  };
  if (!in_run_ || !is_full()) return true;
  advance_imus(until);
  return !is_full();
}

std::span<pollfd> Engine::inputs(bool truth) noexcept {
  inputs_.clear();
  inputs_.push_back({truth ? intake_.descriptor() : -1, POLLIN, 0});
  for (const auto& channel : channels_)
    for (std::size_t i = 0; i < channel->port_count(); ++i) {
      const Port& port = channel->port(i);
      const int events = (port.can_receive() ? POLLIN : 0) | (port.wants_output() ? POLLOUT : 0);
      inputs_.push_back({events != 0 ? port.descriptor() : -1, static_cast<short>(events), 0});
    }
  return inputs_;
}

bool Engine::serve_inputs(HostTime now, Host* clock) noexcept {
  sink_.set_time(now);
  constexpr int failures = POLLERR | POLLHUP | POLLNVAL;
  bool may_poll = (inputs_[0].revents & failures) == 0;
  auto input = inputs_.begin() + 1;
  for (const auto& channel : channels_) {
    int seen = 0;
    for (std::size_t i = 0; i < channel->port_count(); ++i) seen |= (input++)->revents;
    if ((seen & failures) != 0) may_poll = false;
    if (seen == 0) continue;
    if ((seen & POLLOUT) != 0) channel->flush();
    if (!channel->serve(now, clock) && (seen & POLLOUT) == 0) may_poll = false;
  }
  return may_poll;
}

void Engine::serve_all(HostTime now, Host* clock) noexcept {
  sink_.set_time(now);
  polled_ = now;
  intake_.poll(now);
  for (const auto& channel : channels_) {
    channel->serve(now, clock);
    channel->poll(now);
  }
}

void Engine::poll(HostTime now) noexcept {
  sink_.set_time(now);
  polled_ = now;
  intake_.poll(now);
  for (const auto& channel : channels_) {
    channel->poll(now);
    channel->flush();
  }
}

void Engine::flush() noexcept {
  for (const auto& channel : channels_) channel->flush();
}

std::optional<HostTime> Engine::next_wake() const noexcept {
  std::optional<HostTime> first = intake_.deadline();
  for (const auto& channel : channels_)
    if (const auto wake = channel->next_wake(); wake && (!first || *wake < *first)) first = wake;
  return first;
}

bool Engine::drain(std::chrono::milliseconds readers) noexcept {
  constexpr std::chrono::milliseconds lines(500);
  const auto has_pace = [&] {
    for (const auto& channel : channels_)
      for (std::size_t i = 0; i < channel->port_count(); ++i)
        if (channel->port(i).next_flush()) return true;
    return false;
  };
  flush();
  bool read = false;
  for (int ms = 0; !read && ms < (has_pace() ? std::max(lines, readers) : readers).count(); ++ms) {
    if (ms > 0) ::poll(nullptr, 0, 1);
    read = true;
    for (const auto& channel : channels_) {
      for (std::size_t i = 0; i < channel->port_count(); ++i)
        read = channel->port(i).is_drained() && read;  // which flushes
      read = channel->copies().is_drained() && read;
    }
  }
  for (const auto& channel : channels_) channel->discard_pending();
  return read;
}

void Engine::commit() { imud::commit(channels_); }

void Engine::cycle_power_if_requested(HostTime now) noexcept {
  if (!power_cycle_.load(std::memory_order_relaxed)) return;
  power_cycle_.store(false, std::memory_order_relaxed);
  cycle_power(now);
}

void Engine::cycle_power(HostTime now) noexcept {
  sink_.event({.type = RecordEvent::Type::power_cycle, .a = now.ns, .b = polled_.ns});
  for (const auto& channel : channels_) channel->cycle_power(now);
}

}  // namespace imud
