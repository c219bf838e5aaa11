#include "protocols/canopen/supervision.hpp"

#include <chrono>
#include <utility>

namespace imud::canopen {
namespace {

constexpr Nanoseconds millisecond = std::chrono::milliseconds(1), microsecond = std::chrono::microseconds(1);

Alarm alarm_of(unsigned consumer) noexcept {
  return static_cast<Alarm>(static_cast<unsigned>(Alarm::consumer_1) + consumer);
}

}  // namespace

std::uint32_t Supervision::consumer(unsigned i) const noexcept {
  return dictionary_.u32(find_object(0x1016, static_cast<std::uint8_t>(i + 1)));
}

void Supervision::start(DeviceTime now) noexcept {
  toggle_ = false;
  is_lost_ = {};
  for (unsigned i = 0; i < consumers; ++i) alarms_.clear(alarm_of(i));
  alarms_.clear(Alarm::life_guarding);
  alarms_.clear(Alarm::sync_loss);
  update(at(0x1017), now);
}

void Supervision::update(std::size_t position, DeviceTime now) noexcept {
  const Object& object = objects[position];
  if (object.index == objects[at(0x1017)].index) {
    alarms_.clear(Alarm::heartbeat);
    const auto period = static_cast<std::int64_t>(dictionary_[at(0x1017)]);
    if (period != 0) {
      alarms_.set(Alarm::heartbeat, now + period * millisecond);
      alarms_.clear(Alarm::life_guarding);  // a node has either heartbeats or node guarding
    }
  }
  if (object.index == objects[at(0x1016)].index) {
    alarms_.clear(alarm_of(object.sub - 1U));
    is_lost_[object.sub - 1U] = false;
  }
  if (position == at(0x100C) || position == at(0x100D)) alarms_.clear(Alarm::life_guarding);
  if (position == at(0x1006)) alarms_.clear(Alarm::sync_loss);
}

// Each node may be supervised by at most one subindex.
Abort Supervision::check_consumer(unsigned sub, std::uint64_t value) const noexcept {
  const auto node = value >> 16, time = value & 0xFFFF;
  if (time == 0 || node == 0) return node > last_node_id ? Abort::value : Abort::none;
  if (node > last_node_id) return Abort::value;
  for (unsigned i = 0; i < consumers; ++i)
    if (i + 1 != sub && (consumer(i) & 0xFFFF) != 0 && consumer(i) >> 16 == node) return Abort::incompatible;
  return Abort::none;
}

void Supervision::send_heartbeat(unsigned node_id, State state, DeviceTime due, DeviceTime now,
                                 FrameBuffer& out) noexcept {
  const std::array message = {static_cast<std::byte>(state)};
  send(heartbeat_id + node_id, message, out);
  const Nanoseconds period = static_cast<std::int64_t>(dictionary_[at(0x1017)]) * millisecond;
  alarms_.set(Alarm::heartbeat, now - (now - due) % period + period);
}

void Supervision::answer_guarding(unsigned node_id, State state, DeviceTime now, FrameBuffer& out) noexcept {
  if (dictionary_[at(0x1017)] != 0) return;
  constexpr unsigned toggle_bit = 0x80;
  const std::array message = {static_cast<std::byte>(static_cast<unsigned>(state) | (toggle_ ? toggle_bit : 0U))};
  toggle_ = !toggle_;
  send(heartbeat_id + node_id, message, out);
  const auto life_time = static_cast<std::int64_t>(dictionary_[at(0x100C)] * dictionary_[at(0x100D)]);
  if (life_time != 0) alarms_.set(Alarm::life_guarding, now + life_time * millisecond);
}

bool Supervision::receive_heartbeat(unsigned node_id, DeviceTime now) noexcept {
  for (unsigned i = 0; i < consumers; ++i) {
    const std::uint32_t time = consumer(i) & 0xFFFF;
    if (time == 0 || consumer(i) >> 16 != node_id) continue;
    alarms_.set(alarm_of(i), now + std::int64_t{time} * millisecond);
    return std::exchange(is_lost_[i], false);
  }
  return false;
}

unsigned Supervision::lose(unsigned i) noexcept {
  is_lost_[i] = true;
  return consumer(i) >> 16;
}

bool Supervision::is_any_lost() const noexcept {
  return std::any_of(is_lost_.begin(), is_lost_.end(), [](bool is_lost) { return is_lost; });
}

void Supervision::receive_sync(DeviceTime now) noexcept {
  const auto period = static_cast<std::int64_t>(dictionary_[at(0x1006)]);
  if (period != 0) alarms_.set(Alarm::sync_loss, now + period * microsecond * 3 / 2);
}

}  // namespace imud::canopen
