#include <cmath>
#include <utility>

#include "core/attitude.hpp"
#include "core/units.hpp"
#include "protocols/mip.hpp"

namespace imud::mip {

namespace {

constexpr DataField fields[] = {
    {"acceleration", sensor, 0x04, 12},   {"rate", sensor, 0x05, 12},
    {"delta_angle", sensor, 0x07, 12},    {"delta_velocity", sensor, 0x08, 12},
    {"quaternion", sensor, 0x0A, 16},     {"euler", sensor, 0x0C, 12},
    {"gps_time", sensor, 0x12, 12},       {"temperature", sensor, 0x14, 12},
    {"overrange", sensor, 0x18, 2},       {"event_source", sensor, 0xD0, 1},
    {"ticks", sensor, 0xD1, 4},           {"delta_ticks", sensor, 0xD2, 4},
    {"shared_gps_time", sensor, 0xD3, 12}, {"delta_time", sensor, 0xD4, 8},
    {"reference_time", sensor, 0xD5, 8},  {"reference_delta", sensor, 0xD6, 8},
    {"filter_quaternion", filter, 0x03, 18}, {"filter_euler", filter, 0x05, 14},
    {"filter_status", filter, 0x10, 6},   {"filter_gps_time", filter, 0x11, 12},
    {"filter_reference_time", filter, 0xD5, 8}, {"filter_reference_delta", filter, 0xD6, 8},
};

// 3-2-1 from N to P.
Vector3 roll_pitch_yaw(const Quaternion& q) noexcept {
  const Vector3 ypr = yaw_pitch_roll_from_dcm(q.conjugate().toRotationMatrix());
  return {ypr[2], ypr[1], ypr[0]};
}

}  // namespace

std::span<const DataField> data_fields() noexcept { return fields; }

const DataField* find_field(std::uint8_t set, std::uint8_t descriptor) noexcept {
  for (const DataField& field : fields)
    if (field.set == set && field.descriptor == descriptor) return &field;
  return nullptr;
}

void Fields::take(const Sample& sample) noexcept {
  sample_ = sample;
  delta_angle_ += sample.delta_angle;
  delta_velocity_ += sample.delta_velocity;
}

void Fields::put(Packet& packet, std::uint8_t set, std::uint8_t descriptor) noexcept {
  const DataField* field = find_field(set, descriptor);
  if (field == nullptr || !packet.has_room_for(field->size)) return;
  packet.begin(descriptor);
  if (descriptor >= 0xD0) put_shared(packet, set, descriptor);
  else if (set == sensor) put_sensor(packet, descriptor);
  else put_filter(packet, descriptor);
  packet.end();
}

void Fields::put_shared(Packet& packet, std::uint8_t set, std::uint8_t descriptor) noexcept {
  const std::uint64_t time_ns = static_cast<std::uint64_t>(sample_.time.ns);
  std::uint64_t& last_ns = last_ns_[set == sensor ? 0 : 1];
  switch (descriptor) {
    case 0xD0: packet.put(std::uint8_t{0}); break;
    case 0xD1: packet.put(static_cast<std::uint32_t>(sample_.counter)); break;
    case 0xD2: packet.put(static_cast<std::uint32_t>(sample_.counter - std::exchange(last_tick_, sample_.counter))); break;
    case 0xD3: put_gps_time(packet); break;
    case 0xD4: packet.put(1e-9 * static_cast<double>(time_ns - std::exchange(last_ns, time_ns))); break;
    case 0xD5: packet.put(time_ns); break;
    default: packet.put(time_ns - std::exchange(last_ns, time_ns)); break;
  }
}

void Fields::put_sensor(Packet& packet, std::uint8_t descriptor) noexcept {
  switch (descriptor) {
    case 0x04: packet.put_floats(sample_.specific_force / units::standard_gravity); break;
    case 0x05: packet.put_floats(sample_.rate); break;
    case 0x07: packet.put_floats(std::exchange(delta_angle_, Vector3::Zero())); break;
    case 0x08: packet.put_floats(std::exchange(delta_velocity_, Vector3::Zero()) / units::standard_gravity); break;
    case 0x0A: put_quaternion(packet); break;
    case 0x0C: packet.put_floats(roll_pitch_yaw(sample_.q_LP)); break;
    case 0x12: put_gps_time(packet); break;
    case 0x14: packet.put_floats(Vector3::Constant(sample_.temperature_c)); break;
    default: packet.put(static_cast<std::uint16_t>((sample_.status & 7U) << 4 | (sample_.status >> 3 & 7U))); break;
  }
}

void Fields::put_filter(Packet& packet, std::uint8_t descriptor) noexcept {
  constexpr std::uint16_t valid = 1;
  switch (descriptor) {
    case 0x03:
      put_quaternion(packet);
      packet.put(valid);
      break;
    case 0x05:
      packet.put_floats(roll_pitch_yaw(sample_.q_LP));
      packet.put(valid);
      break;
    case 0x10:
      packet.put(model_.filter_state);
      packet.put(std::uint16_t{1});
      packet.put(std::uint16_t{0});
      break;
    default: put_gps_time(packet); break;
  }
}

void Fields::put_quaternion(Packet& packet) const noexcept {  // v_P = q* v_N q
  const Quaternion& q = sample_.q_LP;
  for (const double part : {q.w(), q.x(), q.y(), q.z()}) packet.put_float(part);
}

void Fields::put_gps_time(Packet& packet) const noexcept {  // of the week that the device time is in
  constexpr double week_s = 604'800;
  const double time_s = 1e-9 * static_cast<double>(sample_.time.ns);
  packet.put(time_s - week_s * std::floor(time_s / week_s));
  packet.put(static_cast<std::uint16_t>(std::floor(time_s / week_s)));
  packet.put(std::uint16_t{0});  // not valid: no GNSS
}

}  // namespace imud::mip
