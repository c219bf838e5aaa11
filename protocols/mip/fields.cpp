#include <algorithm>
#include <chrono>
#include <cstdint>

#include "core/attitude.hpp"
#include "core/gps_time.hpp"
#include "core/navigation/azimuth.hpp"
#include "core/numbers/dispatch.hpp"
#include "core/numbers/elementary.hpp"
#include "core/numbers/lane_rotation.hpp"
#include "core/numbers/plus_zero.hpp"
#include "core/units.hpp"
#include "protocols/mip/field_table.hpp"
#include "protocols/mip/mip.hpp"

namespace imud::mip {
namespace {

constexpr double millibar = 100;  // Pa

// Returns the attitude of the platform whose heading two antennas have measured; without such a heading, the
// sample's.
Quaternion antennas_attitude(const Sample& sample) noexcept {
  const AntennaLine* const line = sample.antennas();
  if (line == nullptr) return sample.q_LP;
  const double azimuth = elementary::atan2(line->direction_L.y(), line->direction_L.x());
  const std::optional<double> turn = turn_to({.azimuth = azimuth}, sample.q_LP);
  return turn ? exp(Vector3(0, 0, *turn)) * sample.q_LP : sample.q_LP;
}

constexpr bool is_of_each_aid(std::uint8_t set, std::uint8_t descriptor) {
  return set == filter && descriptor == aiding_summary;
}

}  // namespace

std::span<const DataField> data_fields() noexcept { return field_table; }

const DataField* find_field(const Model& model, std::uint8_t set, std::uint8_t descriptor) noexcept {
  const bool is_receiver = set != 0 && (set == model.receivers[0] || set == model.receivers[1]);
  if (!is_receiver && set == gnss) return nullptr;
  const std::uint8_t listed = is_receiver ? std::uint8_t{gnss} : set;
  for (const DataField& field : field_table)
    if (field.descriptor == descriptor && field.set == listed && model.is(field.models)) return &field;
  return nullptr;
}

bool fits_a_packet(const Model& model, const Stream& stream) noexcept {
  std::size_t size = 0;
  for (std::size_t i = 0; i < stream.count; ++i)
    if (const DataField* field = find_field(model, stream.set, stream.format[i].descriptor))
      size += (2U + field->size) * (is_of_each_aid(stream.set, field->descriptor) ? most_aids : 1);
  return size <= longest - header_size - checksum_size;
}

IMUD_DISPATCHED void Fields::set_sample(const Sample& sample) noexcept {
  const Configuration& c = memory_.active();
  const Quaternion q_VP = c.q_PV.conjugate();
  // Most units are not turned. A rotation by the identity only adds zeros, which may change the sign of a zero, but
  // no other number.
  const bool is_turned = c.q_PV.coeffs() != Quaternion::Identity().coeffs();
  const auto in_V = [&](const Vector3& v_P) -> Vector3 {
    if (is_plus_zero(v_P)) return v_P;
    const bool has_zero = v_P.x() == 0.0 || v_P.y() == 0.0 || v_P.z() == 0.0;
    return is_turned || has_zero ? q_VP * v_P : v_P;
  };
  if (!has_sampled_) {
    has_sampled_ = true;
    since_ = {};
    restarted_.reset();
  }
  copy(sample, sample_);
  if (sample.solution && sample.fix().is_known)
    last_fix_ = sample.fix();
  else if (is_in(Solution::State::aligning))
    last_fix_.reset();
  sample_.rate = in_V(sample.rate - c.gyro_bias);
  sample_.specific_force = in_V(sample.specific_force - c.accelerometer_bias);
  sample_.magnetic_field = in_V(requests_.aids.compensated(sample.magnetic_field));
  sample_.q_LP = quaternion_of(product(lanes(sample.q_LP), lanes(c.q_PV)));
  if (!sample.solution || sample.solution->since_epoch == 0)
    antennas_q_LV_ = sample.antennas() == nullptr ? sample_.q_LP : antennas_attitude(sample) * c.q_PV;
  sample_.delta_angle = in_V(sample.delta_angle - c.gyro_bias / internal_hz);
  sample_.delta_velocity = in_V(sample.delta_velocity - c.accelerometer_bias / internal_hz);
  if (!filter_began_ && has_pulse(sample.time)) filter_began_ = sample.time;
  Since& since = since_[slot_of(sensor)];  // no other set has increments
  since.delta_angle += sample_.delta_angle;
  since.delta_velocity += sample_.delta_velocity;
}

void Fields::restart(DeviceTime now) noexcept {
  restarted_ = now;
  restarted_tick_ = sample_.number();
  filter_began_.reset();
  last_fix_.reset();
  sample_ = {};
  sample_.time = now;
  sample_.counter = restarted_tick_;
  begin(0, now);
}

void Fields::reset_filter() noexcept {
  filter_began_.reset();
  requests_.restart();
}

void Fields::begin(std::uint8_t set, DeviceTime now) noexcept {
  const DeviceTime begun = std::max(sample_.time, now - nanoseconds(1 / internal_hz));
  for (std::size_t i = 0; i < since_.size(); ++i)
    if (set == 0 || slot_of(set) == i)
      since_[i] = {.delta_time = begun, .reference = begun, .tick = sample_.number()};
}

void Fields::step_clock(Nanoseconds by) noexcept {
  sample_.time = sample_.time + by;
  if (restarted_) restarted_ = *restarted_ + by;
  if (filter_began_) filter_began_ = *filter_began_ + by;
  for (Since& since : since_) {
    since.delta_time = since.delta_time + by;
    since.reference = since.reference + by;
  }
}

void Fields::sent(std::uint8_t set, std::uint8_t descriptor) noexcept {
  Since& since = since_[slot_of(set)];
  switch (descriptor) {
    case 0x07:
      since.delta_angle.setZero();
      break;
    case 0x08:
      since.delta_velocity.setZero();
      break;
    case 0xD2:
      since.tick = sample_.number();
      break;
    case 0xD4:
    case 0xD8:
      since.delta_time = stamp();
      break;
    case 0xD6:
      since.reference = stamp();
      break;
    default:
      break;
  }
}

std::int64_t Fields::true_gps_ns(DeviceTime at) const noexcept {
  return knows_time() ? sample_.timed().gps_ns + (at - sample_.time).count() : 0;
}
std::int64_t Fields::fix_gps_ns(DeviceTime at) const noexcept {
  const bool has_time = sample_.solution && sample_.solution->has_epochs && sample_.fix().is_known;
  return has_time ? sample_.fix_gps_ns() : true_gps_ns(at);
}
std::int64_t Fields::gps_ns(DeviceTime at) const noexcept {
  if (memory_.gps_update().count > 0) return at.ns + memory_.gps_update().offset_ns;
  return knows_time() ? true_gps_ns(at) : at.ns;
}
bool Fields::has_pulse(DeviceTime at) const noexcept {
  constexpr Nanoseconds longest_period = std::chrono::milliseconds(1100);
  switch (memory_.pulse_source()) {
    case PulseSource::receiver_1:  // a receiver without a fix sends none
    case PulseSource::receiver_2:
      return sample_.fix().is_known;
    case PulseSource::gpio:
      return memory_.pulses().last && at - *memory_.pulses().last <= longest_period;
    default:
      return memory_.pulse_source() == PulseSource::generated;
  }
}

std::optional<std::int64_t> Fields::seconds_clock(PulseSource source, DeviceTime at) const noexcept {
  if (source == PulseSource::generated) return since_start(at).count();
  if ((source == PulseSource::receiver_1 || source == PulseSource::receiver_2) && sample_.fix().is_known)
    return true_gps_ns(at);
  return std::nullopt;
}
bool Fields::has_week() const noexcept { return knows_time() || memory_.gps_update().has_week; }
bool Fields::has_time_of_week() const noexcept { return knows_time() || memory_.gps_update().has_time_of_week; }

void Fields::poll(Packet& packet, std::uint8_t set, std::uint8_t descriptor, DeviceTime now,
                  std::uint8_t event) const noexcept {
  const Stream* stream = memory_.active().find(set);
  if (stream == nullptr) return;
  const auto samples = static_cast<std::uint64_t>(internal_hz) / stream->base_hz;
  const DeviceTime before = now - Nanoseconds(std::chrono::seconds(1)) / stream->base_hz;
  put(packet, set, descriptor,
      {before, before, sample_.number() - samples, event, sample_.delta_angle, sample_.delta_velocity}, now);
}

void Fields::put(Packet& packet, std::uint8_t set, std::uint8_t descriptor, const Since& since,
                 DeviceTime at) const noexcept {
  const DataField* field = find_field(memory_.model(), set, descriptor);
  if (field == nullptr || !packet.has_room_for(field->size)) return;
  if (is_of_each_aid(set, descriptor)) return put_aiding_summaries(packet, at);
  packet.begin(descriptor);
  if (descriptor >= 0xD0)
    put_shared(packet, descriptor, since, at);
  else if (set == sensor)
    put_sensor(packet, descriptor, since, at);
  else if (set == filter)
    put_filter(packet, descriptor, at);
  else if (set == system)
    put_system(packet, descriptor, at);
  else
    put_gnss(packet, descriptor, at);
  packet.end();
}

void Fields::put_shared(Packet& packet, std::uint8_t descriptor, const Since& since, DeviceTime at) const noexcept {
  const auto put_ns = [&](Nanoseconds ns) { packet.put(static_cast<std::uint64_t>(ns.count())); };
  switch (descriptor) {
    case 0xD0:
      packet.put(since.event);
      break;
    case 0xD1:
      packet.put(static_cast<std::uint32_t>(sample_.counter - restarted_tick_));
      break;
    case 0xD2:
      packet.put(static_cast<std::uint32_t>(sample_.number() - since.tick));
      break;
    case 0xD3:
      put_gps_time(packet, gps_ns(at));
      packet.put(static_cast<std::uint16_t>(has_time_of_week() | has_week() << 1));
      break;
    case 0xD4:
      packet.put(seconds(at - since.delta_time));
      break;
    case 0xD5:
      put_ns(since_start(at));
      break;
    case 0xD7:
      packet.put(static_cast<std::uint64_t>(gps_ns(at)));
      packet.put(std::uint16_t{has_pulse(at) && has_time_of_week() && has_week()});
      break;
    case 0xD8:
      put_ns(at - since.delta_time);
      packet.put(std::uint16_t{has_pulse(at)});
      break;
    default:
      put_ns(at - since.reference);
      break;
  }
}

void Fields::put_sensor(Packet& packet, std::uint8_t descriptor, const Since& since, DeviceTime at) const noexcept {
  switch (descriptor) {
    case 0x04:
      packet.put_floats(sample_.specific_force / units::standard_gravity);
      break;
    case 0x05:
      packet.put_floats(sample_.rate);
      break;
    case 0x06:
      packet.put_floats(sample_.magnetic_field / units::gauss);
      break;
    case 0x07:
      packet.put_floats(since.delta_angle);
      break;
    case 0x08:
      packet.put_floats(since.delta_velocity / units::standard_gravity);
      break;
    case 0x0A:
      put_quaternion(packet);
      break;
    case 0x0C:
      put_euler(packet);
      break;
    case 0x12: {  // flags: a pulse per second is present; a bit that each update toggles; the time was set; the
                  // time of week is valid; the week is valid
      const std::int64_t updates = memory_.gps_update().count + gnss_updates(at);
      put_gps_time(packet, gps_ns(at));
      packet.put(static_cast<std::uint16_t>(has_pulse(at) | (updates & 1) << 1 |
                                            (has_time_of_week() || has_week()) << 2 | has_time_of_week() << 3 |
                                            has_week() << 4));
      break;
    }
    case 0x14:
      packet.put_floats(Vector3::Constant(sample_.temperature_c));
      break;
    case 0x17:
      packet.put_float(sample_.pressure / millibar);
      break;
    default:
      packet.put(static_cast<std::uint16_t>((sample_.status & 7U) << 4 | (sample_.status >> 3 & 7U)));
      break;
  }
}

std::int64_t Fields::gnss_updates(DeviceTime at) const noexcept {
  if (memory_.model().gnss_hz == 0) return 0;
  if (sample_.fix().is_known) return true_gps_ns(at) / second_ns;
  return last_fix_ ? last_fix_->gps_ns / second_ns : 0;
}

std::int64_t Fields::since_pulse_s(DeviceTime at) const noexcept {
  constexpr std::int64_t never = 255;
  const PulseSource source = memory_.pulse_source();
  if (source == PulseSource::gpio) {
    const auto& last = memory_.pulses().last;
    return last ? std::min((at - *last).count() / second_ns, never) : never;
  }
  if (has_pulse(at)) return 0;
  const bool is_receiver = source == PulseSource::receiver_1 || source == PulseSource::receiver_2;
  if (!is_receiver || !last_fix_ || !knows_time()) return never;
  return std::clamp((true_gps_ns(at) - last_fix_->gps_ns) / second_ns, std::int64_t{0}, never);
}

// Writes the state of synchronization and the seconds since the last pulse, or the states of the pins.
void Fields::put_system(Packet& packet, std::uint8_t descriptor, DeviceTime at) const noexcept {
  if (descriptor == 0x03) return packet.put(memory_.pin_states());
  packet.put(std::uint8_t{has_pulse(at)});
  packet.put(static_cast<std::uint8_t>(since_pulse_s(at)));
}

void Fields::put_gps_time(Packet& packet, std::int64_t ns) noexcept {
  const std::int64_t week = ns / gps_week_ns - (ns % gps_week_ns < 0);
  packet.put(1e-9 * static_cast<double>(ns - week * gps_week_ns));
  packet.put(static_cast<std::uint16_t>(week));
}

void Fields::put_quaternion(Packet& packet) const noexcept {  // v_V = q* v_L q
  const Quaternion& q = sample_.q_LP;
  for (const double part : {q.w(), q.x(), q.y(), q.z()}) packet.put_float(part);
}

// Writes roll, pitch and yaw of the rotation sequence 3-2-1.
void Fields::put_euler(Packet& packet) const noexcept {
  const Vector3 ypr = yaw_pitch_roll_from_dcm(sample_.q_LP.conjugate().toRotationMatrix());
  packet.put_floats({ypr[2], ypr[1], ypr[0]});
}

}  // namespace imud::mip
