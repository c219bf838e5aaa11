#include "emulator/session.hpp"

#include <poll.h>

#include <algorithm>
#include <chrono>
#include <ctime>

#include "transports/host_clock.hpp"

namespace imud {

namespace {

void count_one(std::atomic<std::uint64_t>& counter) noexcept { counter.fetch_add(1, std::memory_order_relaxed); }

std::vector<Grid> grids(const Config& config) {
  std::vector<Grid> all;
  for (const ImuConfig& imu : config.imus) all.push_back(imu.grid);
  return all;
}

}  // namespace

Session::Unit::Unit(const ImuConfig& config, std::uint64_t seed, std::unique_ptr<Port> opened)
    : name(config.name),
      imu(config.model, seed, stream_id(config.name)),
      period(config.grid.period()),
      device(config.protocol->make(config.settings)),
      port(std::move(opened)),
      waits_for_reader(config.protocol->link == Link::bytes),
      line(device->uart()) {
  if (config.protocol->link != Link::can) return;
  // Also its own identifiers, so that the port can confirm its frames, and the device sees who else uses them.
  std::vector<CanFilter> filters = config.protocol->can_filters(config.settings);
  for (const CanMessage& message : config.protocol->can_messages(config.settings, config.rate_hz))
    filters.push_back({.id = message.can.id, .extended = message.can.extended});
  port->set_filters(filters);
}

Session::Session(const Config& config, const std::atomic<bool>& stop, const OpenPort& open)
    : stop_(stop),
      when_stopped_(config.truth.when_stopped),
      timeline_(config.truth.limits),
      intake_(config.truth, timeline_, open(config.truth.port, Role::listener)),
      schedule_(grids(config)) {
  for (const ImuConfig& imu : config.imus) {
    units_.push_back(std::make_unique<Unit>(imu, config.seed, open(imu.port, imu.port_settings)));
    publish(*units_.back());
    const SyncConfig& sync = imu.sync;
    if (!(sync.trigger_port + sync.pps_port + sync.tov_port).empty()) units_.back()->sync.emplace(sync, open);
  }
  prepared_.reserve(units_.size());
  inputs_.reserve(units_.size() + 1);
}

void Session::see_off() noexcept {
  constexpr int readers_ms = 50, lines_ms = 500;
  flush();
  for (int ms = 0; ms < (due() ? lines_ms : readers_ms); ++ms) {
    bool read = true;
    for (const auto& unit : units_) read = unit->port->is_drained() && read;  // which flushes
    if (read) break;
    ::poll(nullptr, 0, 1);
  }
  for (const auto& unit : units_) {
    unit->port->discard_pending();
    publish(*unit);
  }
}

void Session::begin_run() noexcept {
  in_run_ = true;
  samples_in_run_ = 0;
  truths_since_follow_ = 0;
  settled_ = timeline_.run_start();
  for (const auto& unit : units_) {
    unit->imu.begin_run();
    unit->has_sampled = false;
    if (unit->sync) unit->sync->begin_run();
  }
}

void Session::prepare(TruthTime time, DeviceTime stamp) noexcept {
  restart_if_asked();
  Unit& unit = *units_[schedule_.next().imu];
  schedule_.advance();
  Sample sample = unit.imu.sample(timeline_, time, stamp);
  unit.has_sampled = true;
  settled_ = std::max(settled_, time);

  const bool held = (sample.status & status::truth_stale) != 0;
  // Until there is motion again; a run that begins with its truth still to come does not begin by a stop.
  const bool stopped = held && (stopped_ || time > timeline_.newest());
  if (std::exchange(stopped_, stopped) != stopped) count_one(stopped ? quality_.stops : quality_.returns);
  unit.status = sample.status;
  unit.silent = stopped && when_stopped_ == WhenStopped::silence;

  unit.frames.clear();
  if (unit.sync && unit.silent) unit.sync->ignore();
  if (!unit.silent) {
    if (unit.sync) unit.sync->tell(*unit.device, time, stamp);
    if (stopped && when_stopped_ == WhenStopped::flag) sample.status |= status::not_valid;
    unit.now = sample.time;
    unit.device->sample(sample, unit.frames);
  }
  prepared_.push_back(&unit);
}

void Session::fire() noexcept {
  for (Unit* unit : prepared_) {
    hand_over(*unit);
    serve_host(*unit);
  }
  for (Unit* unit : prepared_)
    if (!unit->waits_for_reader) wait_for_bus(*unit);
  finish();
}

void Session::note_times(Unit& unit, Nanoseconds lateness, Nanoseconds write) noexcept {
  unit.counters.lateness.add(seconds(lateness));
  unit.counters.write.add(seconds(write));
  if (lateness >= unit.period) count_one(unit.counters.missed);
}

void Session::finish() noexcept {
  samples_in_run_ += prepared_.size();
  for (Unit* unit : prepared_) {
    count_one(unit->counters.samples);
    if ((unit->status & status::truth_extrapolated) != 0) count_one(unit->counters.extrapolated);
    if ((unit->status & status::truth_stale) != 0) count_one(unit->counters.held);
    if (unit->silent) count_one(unit->counters.silent);
    publish(*unit);
  }
  prepared_.clear();
}

void Session::hand_over(Unit& unit) noexcept {
  if (unit.sync && !unit.silent) unit.sync->send(*unit.device);
  if (unit.frames.frames().empty()) return;
  unit.port->send(unit.frames.frames());
  unit.handed += unit.frames.frames().size();
}

void Session::restart_if_asked() noexcept {
  if (!prepared_.empty() || !restart_.exchange(false, std::memory_order_relaxed)) return;
  for (const auto& unit : units_) {
    unit->device->power_on(unit->now);
    follow_line(*unit);
  }
}

// A device answers at the old rate, then it is at the new one.
void Session::follow_line(Unit& unit) noexcept {
  const UartSettings line = unit.device->uart();
  if (line == unit.line) return;
  unit.line = line;
  unit.port->set_line(line);
}

void Session::publish(Unit& unit) noexcept {
  const PortCounters& port = unit.port->counters();
  unit.counters.frames.store(port.sent, std::memory_order_relaxed);
  unit.counters.dropped.store(port.dropped, std::memory_order_relaxed);
  unit.counters.speeds.store(unit.port->speeds(), std::memory_order_relaxed);
  unit.counters.port_state.store(unit.port->state(), std::memory_order_release);
}

bool Session::holds_back(const Unit& unit) noexcept {
  const PortCounters& counters = unit.port->counters();
  return counters.sent + counters.dropped != unit.handed;
}

void Session::wait_for_readers() noexcept {
  for (Unit* unit : prepared_)
    if (unit->waits_for_reader) wait_for_reader(*unit);
}

void Session::wait_for_reader(Unit& unit) const noexcept {
  constexpr int patience_ms = 2000;
  constexpr int step_ms = 10;  // between looks at `stop`
  for (int waited_ms = 0; !stop_.load(std::memory_order_relaxed); waited_ms += step_ms) {
    pollfd room{unit.port->descriptor(), POLLOUT, 0};
    if (room.fd < 0) return;
    const bool ready = ::poll(&room, 1, unit.reader_stalls ? 0 : step_ms) != 0;
    if (ready && holds_back(unit)) unit.port->flush();
    if (ready && !holds_back(unit)) {
      unit.reader_stalls = false;
      return;
    }
    if (unit.reader_stalls) return;
    unit.reader_stalls = waited_ms >= patience_ms;
  }
}

void Session::wait_for_bus(Unit& unit) const noexcept {
  constexpr Nanoseconds none{0}, step = std::chrono::milliseconds(10);  // between looks at `stop`
  while (holds_back(unit) && !stop_.load(std::memory_order_relaxed)) {
    const std::optional<HostTime> next = unit.port->next_flush();
    const timespec pause{0, (next ? std::clamp(*next - host_now(), none, step) : step).count()};
    pollfd room{unit.port->wants_output() ? unit.port->descriptor() : -1, POLLOUT, 0};
    ::ppoll(&room, 1, &pause, nullptr);
    unit.port->flush();
  }
}

bool Session::serve_host(Unit& unit) noexcept {
  // So much between two looks at the time that a flood from the host does not delay samples; more than any line
  // brings in that time.
  constexpr std::size_t most = 256, per_frame = 16;
  std::size_t heard = 0;
  while (heard < most) {
    const auto received = unit.port->receive();
    if (!received) return heard > 0;
    heard += per_frame + received->frame.bytes.size();
    replies_.clear();
    unit.device->receive(received->frame, unit.now, replies_);
    if (!replies_.frames().empty()) {
      unit.port->reply(replies_.frames());
      unit.handed += replies_.frames().size();
    }
    follow_line(unit);
  }
  return false;  // there may be more
}

void Session::serve_hosts() noexcept {
  restart_if_asked();
  for (const auto& unit : units_) {
    serve_host(*unit);
    publish(*unit);
  }
}

std::span<pollfd> Session::inputs() noexcept {
  inputs_.clear();
  inputs_.push_back({intake_.descriptor(), POLLIN, 0});
  for (const auto& unit : units_)
    inputs_.push_back({unit->port->can_receive() ? unit->port->descriptor() : -1, POLLIN, 0});
  return inputs_;
}

bool Session::serve_inputs() noexcept {
  restart_if_asked();
  bool good = true;
  for (std::size_t i = 0; i < inputs_.size(); ++i) {
    const short seen = inputs_[i].revents;
    if (seen != 0 && (seen & POLLIN) == 0) good = false;
    if (seen == 0 || i == 0) continue;
    if (!serve_host(*units_[i - 1])) good = false;
    publish(*units_[i - 1]);
  }
  return good;
}

void Session::follow(TruthTime until) noexcept {
  constexpr std::size_t often_enough = Timeline::capacity / 2;
  if (++truths_since_follow_ < often_enough) return;
  truths_since_follow_ = 0;
  take_in(until);
}

void Session::take_in(TruthTime until) noexcept {
  until = std::min(until, timeline_.newest());
  settled_ = std::max(settled_, until);
  for (const auto& unit : units_) unit->imu.advance(timeline_, until);
}

bool Session::has_room_for_truth(TruthTime until) noexcept {
  const auto is_full = [&] {
    return std::any_of(units_.begin(), units_.end(), [&](const auto& unit) {
      return timeline_.is_full_for(unit->has_sampled ? unit->imu.advanced_to() : until);
    });
  };
  if (!in_run_ || !is_full()) return true;
  take_in(until);
  return !is_full();
}

void Session::flush() noexcept {
  for (const auto& unit : units_) {
    if (!holds_back(*unit)) continue;
    unit->port->flush();
    publish(*unit);
  }
}

std::optional<HostTime> Session::due() const noexcept {
  std::optional<HostTime> first;
  for (const auto& unit : units_)
    if (const auto due = unit->port->next_flush(); due && (!first || *due < *first)) first = due;
  return first;
}

}  // namespace imud
