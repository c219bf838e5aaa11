#include "protocols/mip/pins.hpp"

#include <chrono>

namespace imud::mip {
namespace {

using namespace std::chrono_literals;

constexpr Nanoseconds tick = 1ms;           // an event that an edge triggers is active for one tick
constexpr Nanoseconds half_second = 500ms;  // "a square wave pulse with a 50% duty cycle"
constexpr std::uint8_t pins = 4;

}  // namespace

Pin Memory::pin(std::uint8_t number) const noexcept {
  const Kept* kept = active_.find_kept(model_, three_dm, 0x41, number);
  return kept != nullptr ? Pin{kept->bytes[1], kept->bytes[2]} : Pin{};
}

bool Memory::has_pin(Pin wanted) const noexcept {
  for (std::uint8_t number = 1; number <= pins; ++number)
    if (pin(number) == wanted) return true;
  return false;
}

PulseSource Memory::pulse_source() const noexcept {
  if (model_.is(gx5)) return model_.is(with_receiver) ? PulseSource::receiver_1 : PulseSource::gpio;
  return static_cast<PulseSource>(active_.find_kept(model_, three_dm, 0x28)->bytes[0]);
}

void Memory::reset_pins() noexcept {
  pin_states_ = 0;
  for (std::uint8_t number = 1; number <= pins; ++number)
    if (pin(number) == Pin{Pin::gpio, Pin::output_high}) set_pin_state(number, true);
  sends_pulses_ = has_pin({Pin::pps, Pin::output});
}

void Memory::set_pin_state(std::uint8_t number, bool is_high) noexcept {
  const auto bit = static_cast<std::uint8_t>(1U << (number - 1U));
  pin_states_ = static_cast<std::uint8_t>(is_high ? pin_states_ | bit : pin_states_ & ~bit);
}

// Only one pin can be the pulse-per-second input: "the second one will take precedence and the original pin's
// configuration will be reset".
void Memory::configure_pin(std::uint8_t number) noexcept {
  for (std::uint8_t other = 1; other <= pins; ++other) {
    if (other == number || pin(other) != pin(number) || pin(number) != Pin{Pin::pps, Pin::input}) continue;
    for (Kept& kept : active_.kept)
      if (&kept == active_.find_kept(model_, three_dm, 0x41, other))
        kept.bytes[1] = kept.bytes[2] = kept.bytes[3] = 0;
  }
  set_pin_state(number, pin(number) == Pin{Pin::gpio, Pin::output_high});
  sends_pulses_ = has_pin({Pin::pps, Pin::output});
}

Memory::Code Memory::pin_state(Reader& reader, Packet& answer) noexcept {
  const auto function = reader.take<std::uint8_t>();
  const auto number = reader.take<std::uint8_t>();
  if (!reader.is_whole() || number < 1 || number > pins) return bad_parameter;
  if (function == write) {
    const auto state = reader.take<std::uint8_t>();
    if (!reader.is_done() || state > 1) return bad_parameter;
    const Pin one = pin(number);
    if (one.feature == Pin::gpio && one.behavior != Pin::input) set_pin_state(number, state != 0);
    return ok;
  }
  if (function != read) return bad_parameter;
  answer.begin(0xC2);
  answer.put(number);
  answer.put(static_cast<std::uint8_t>(pin_states_ >> (number - 1U) & 1U));
  answer.end();
  return ok;
}

// If the host has set the GPS time, the edge moves this time to the nearest full second.
bool Memory::pps(DeviceTime at) noexcept {
  if (pulse_source() != PulseSource::gpio) return false;
  if (model_.is(series_7) && !has_pin({Pin::pps, Pin::input})) return false;
  pulses_.last = at;
  ++pulses_.count;
  if (gps_update_.has_time_of_week) {
    const std::int64_t into_second = ((at.ns + gps_update_.offset_ns) % second_ns + second_ns) % second_ns;
    gps_update_.offset_ns += into_second < second_ns / 2 ? -into_second : second_ns - into_second;
  }
  return true;
}

void Pins::restart() noexcept {
  count_ = 0;
  passed_.reset();
  last_.reset();
  pulse_.reset();
}

void Pins::step_clock(Nanoseconds by) noexcept {
  for (DeviceTime& edge : edges_) edge = edge + by;
  if (passed_) passed_ = *passed_ + by;
  if (last_) last_ = *last_ + by;
}

void Pins::pps(DeviceTime at) noexcept {
  if (fields_.since_start(at) >= 0ns && memory_.pps(at)) passed_ = at;
}

void Pins::trigger(DeviceTime at) noexcept {
  const bool is_stamped =
      memory_.has_pin({Pin::timestamp, Pin::rising}) || memory_.has_pin({Pin::timestamp, Pin::either});
  if (fields_.since_start(at) >= 0ns && is_stamped && count_ < edges_.size()) edges_[count_++] = at;
}

void Pins::sample(DeviceTime now, FrameBuffer& out) noexcept {
  pulse_.reset();
  const Configuration& active = memory_.active();
  for (std::size_t k = 0; k < count_; ++k)
    for (std::uint8_t trigger = 1; trigger <= events; ++trigger) {
      const Kept* setting = active.find_kept(memory_.model(), three_dm, 0x2E, trigger);
      const Kept* control = active.find_kept(memory_.model(), three_dm, 0x2B, trigger);
      enum : std::uint8_t { on_gpio = 1, enabled = 1, at_an_edge = 4 };
      if (setting->bytes[1] != on_gpio || setting->bytes[3] != at_an_edge || control->bytes[1] != enabled) continue;
      const Pin pin = memory_.pin(setting->bytes[2]);
      if (pin.feature == Pin::timestamp && pin.behavior != Pin::falling) execute(trigger, edges_[k], now, out);
    }
  count_ = 0;
  if (memory_.sends_pulses()) find_second(now);
  passed_.reset();
  last_ = now;
}

void Pins::execute(std::uint8_t trigger, DeviceTime edge, DeviceTime now, FrameBuffer& out) noexcept {
  enum : std::uint8_t { set_pin = 1, send_message = 2 };
  for (std::uint8_t action = 1; action <= events; ++action) {
    const auto& [size, bytes] = *memory_.active().find_kept(memory_.model(), three_dm, 0x2F, action);
    if (bytes[1] != trigger) continue;
    if (bytes[2] == set_pin) drive(bytes[3], bytes[4], now);
    if (bytes[2] != send_message || memory_.is_idle()) continue;
    Packet packet(out, bytes[3]);
    for (std::size_t i = 0; i < bytes[6] && 7 + i < size; ++i)
      fields_.poll(packet, bytes[3], bytes[7 + i], edge, trigger);
    packet.finish();
  }
}

void Pins::drive(std::uint8_t pin, std::uint8_t mode, DeviceTime now) noexcept {
  enum : std::uint8_t { active_high = 1, oneshot_high = 5, oneshot_low = 6, toggle = 7 };
  const Pin one = memory_.pin(pin);
  if (one.feature != Pin::gpio || one.behavior == Pin::input) return;
  const bool is_high = (memory_.pin_states() >> (pin - 1U) & 1U) != 0;
  if (mode == active_high) pulse_ = {now, now + tick};
  if (mode == oneshot_high || mode == oneshot_low || mode == toggle)
    memory_.set_pin_state(pin, mode == oneshot_high || (mode == toggle && !is_high));
}

void Pins::find_second(DeviceTime now) noexcept {
  const PulseSource source = memory_.pulse_source();
  std::optional<DeviceTime> begin;
  if (source == PulseSource::gpio) {
    begin = passed_;
  } else if (const auto clock = fields_.seconds_clock(source, now)) {
    const DeviceTime second = now - Nanoseconds((*clock % second_ns + second_ns) % second_ns);
    if (second > last_.value_or(now - tick)) begin = second;
  }
  if (begin) pulse_ = {*begin, *begin + half_second};
}

}  // namespace imud::mip
