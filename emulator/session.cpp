#include "emulator/session.hpp"

#include <poll.h>

#include <algorithm>

namespace imud {

namespace {
void count_one(std::atomic<std::uint64_t>& counter) noexcept { counter.fetch_add(1, std::memory_order_relaxed); }
}  // namespace

Session::Unit::Unit(const ImuConfig& config, std::uint64_t seed)
    : name(config.name),
      imu(config.model, seed, stream_id(config.name)),
      grid(config.rate_hz),
      device(config.protocol->make(config.settings)),
      port(open_port(config.port, Role::device)),
      waits_for_reader(config.protocol->link == Link::bytes) {}

Session::Session(const Config& config, const std::atomic<bool>& stop)
    : stop_(stop), timeline_(config.truth.limits), intake_(config.truth, timeline_) {
  for (const ImuConfig& imu : config.imus) {
    units_.push_back(std::make_unique<Unit>(imu, config.seed));
    publish(*units_.back());
  }
}

Session::~Session() {
  flush();
  for (int ms = 0; ms < 50; ++ms) {
    if (std::all_of(units_.begin(), units_.end(), [](const auto& unit) { return unit->port->is_read(); })) return;
    ::poll(nullptr, 0, 1);
  }
}

void Session::begin_run(TruthTime start) noexcept {
  start_ = start;
  in_run_ = true;
  samples_in_run_ = 0;
  truths_since_follow_ = 0;
  for (const auto& unit : units_) {
    unit->index = 0;
    unit->imu.begin_run();
  }
}

Session::Unit& Session::next_unit() noexcept {
  return **std::min_element(units_.begin(), units_.end(),
                            [this](const auto& a, const auto& b) { return a->due(start_) < b->due(start_); });
}

TruthTime Session::next_due() const noexcept {
  TruthTime due = units_.front()->due(start_);
  for (const auto& unit : units_) due = std::min(due, unit->due(start_));
  return due;
}

bool Session::advance(TruthTime limit, Pace* pace) noexcept {
  if (!in_run_) return true;
  while (!stop_.load(std::memory_order_relaxed)) {
    Unit& unit = next_unit();
    const TruthTime due = unit.due(start_);
    if (due > limit) return true;
    Nanoseconds lateness{0};
    if (pace != nullptr && !pace->wait(due, lateness)) return false;
    if (pace == nullptr) wait_for_reader(unit);
    emit(unit, due);
    if (pace != nullptr) unit.counters.lateness.add(seconds(lateness));
  }
  return false;
}

void Session::emit(Unit& unit, TruthTime due) noexcept {
  const Sample sample = unit.imu.sample(timeline_, due, DeviceTime{due.ns});
  unit.frames.clear();
  unit.device->sample(sample, unit.frames);
  if ((sample.status & status::truth_extrapolated) != 0) count_one(unit.counters.extrapolated);
  if ((sample.status & status::truth_stale) != 0) count_one(unit.counters.held);
  hand_over(unit);
  ++unit.index;
  ++samples_in_run_;
  serve_host(unit);
  publish(unit);
}

void Session::hand_over(Unit& unit) noexcept {
  if (unit.frames.frames().empty()) return;
  unit.port->send(unit.frames.frames());
  unit.handed += unit.frames.frames().size();
}

void Session::publish(Unit& unit) noexcept {
  unit.counters.samples.store(unit.imu.next(), std::memory_order_relaxed);
  unit.counters.frames.store(unit.port->counters().sent, std::memory_order_relaxed);
  unit.counters.dropped.store(unit.port->counters().dropped, std::memory_order_relaxed);
  unit.counters.port_state.store(unit.port->state(), std::memory_order_relaxed);
}

void Session::wait_for_reader(Unit& unit) const noexcept {
  if (!unit.waits_for_reader) return;
  constexpr int patience_ms = 2000;
  constexpr int step_ms = 10;  // between looks at `stop`
  for (int waited_ms = 0; !stop_.load(std::memory_order_relaxed); waited_ms += step_ms) {
    pollfd room{unit.port->descriptor(), POLLOUT, 0};
    if (room.fd < 0) return;
    const bool ready = ::poll(&room, 1, unit.reader_stalls ? 0 : step_ms) != 0;
    if (ready) unit.port->flush();
    const PortCounters& counters = unit.port->counters();
    if (ready && counters.sent + counters.dropped == unit.handed) {
      unit.reader_stalls = false;
      return;
    }
    if (unit.reader_stalls) return;
    unit.reader_stalls = waited_ms >= patience_ms;
  }
}

void Session::serve_host(Unit& unit) noexcept {
  constexpr int most = 16;  // a flood from the host does not delay samples
  for (int i = 0; i < most; ++i) {
    const auto received = unit.port->receive();
    if (!received) return;
    unit.frames.clear();
    unit.device->receive(received->frame, unit.frames);
    hand_over(unit);
  }
}

void Session::serve_hosts() noexcept {
  for (const auto& unit : units_) {
    serve_host(*unit);
    publish(*unit);
  }
}

void Session::follow() noexcept {
  constexpr std::size_t often_enough = Timeline::capacity / 2;
  if (++truths_since_follow_ >= often_enough) take_in_truth();
}

void Session::take_in_truth() noexcept {
  truths_since_follow_ = 0;
  for (const auto& unit : units_) unit->imu.follow(timeline_, std::min(timeline_.newest(), unit->due(start_)));
}

bool Session::has_room_for_truth() noexcept {
  const auto is_full = [this] {
    return std::any_of(units_.begin(), units_.end(), [this](const auto& unit) {
      return timeline_.is_full_for(unit->index == 0 ? start_ : unit->imu.reached());
    });
  };
  if (!in_run_ || !is_full()) return true;
  take_in_truth();
  return !is_full();
}

void Session::flush() noexcept {
  for (const auto& unit : units_) {
    unit->port->flush();
    publish(*unit);
  }
}

}  // namespace imud
