#include <algorithm>

#include "core/gps_time.hpp"
#include "core/units.hpp"
#include "protocols/mip/mip.hpp"

namespace imud::mip {
namespace {

struct Commands {
  std::uint8_t set;
  unsigned models;
  std::array<std::uint8_t, 11> commands;  // in the order of the list of descriptors; 0: none
};
// All commands, except for kept settings and commands that are merely acknowledged.
constexpr Commands commands[] = {
    {base, all, {0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x08, 0x09, 0x72, 0x7E}},
    {three_dm, all, {0x01}},
    {three_dm, gx5_45, {0x02}},
    {three_dm, all, {0x03, 0x06}},
    {three_dm, gx5_45, {0x07}},
    {three_dm, all, {0x08}},
    {three_dm, gx5_45, {0x09}},
    {three_dm, all, {0x0A, 0x0B, 0x0D, 0x0E, 0x0F, 0x11, 0x30}},
    {three_dm, series_7, {0x31, 0x32, 0x33}},
    {three_dm, all, {0x37, 0x38, 0x39, 0x40}},
    {three_dm, series_7, {0x42}},
    {three_dm, gx5, {0x50, 0x64}},
    {three_dm, series_7, {0x54}},
    {filter_command, gx5, {0x11}},
};

}  // namespace

void Memory::execute(std::span<const std::byte> packet, DeviceTime now, Fields& fields,
                     FrameBuffer& replies) noexcept {
  // If the longest possible answer does not fit into the packet, the answer begins a new packet.
  constexpr std::size_t longest_answer = 105, longest_list = 252;
  const auto set = std::to_integer<std::uint8_t>(packet[2]);
  std::optional<Packet> answer(std::in_place, replies, set);
  for_each_field(packet, [&](std::uint8_t command, Data data) {
    if (set == three_dm && command == 0x39 && begins_capture(data, now)) return;  // it is answered when it ends
    if (is_poll(set, command) && parse_poll(command, data).is_silent) return;
    const bool lists = set == base && (command == 0x04 || command == 0x07);
    if (!answer->has_room_for(lists ? longest_list : longest_answer) && answer->size() > header_size) {
      answer->finish();
      answer.emplace(replies, set);
    }
    answer->begin(reply);
    answer->put(command);
    const std::size_t at = answer->size();
    answer->put(std::uint8_t{ok});
    answer->end();
    std::array<bool, streams_of_a_device> streamed = {};
    for (std::size_t i = 0; i < streamed.size(); ++i) streamed[i] = is_streaming(active_.streams[i]);
    answer->set_byte(at, execute(set, command, data, {now, *answer, fields}));
    fields.requests().aids = active_.aids(model_);
    for (std::size_t i = 0; i < streamed.size(); ++i)
      if (!streamed[i] && is_streaming(active_.streams[i])) fields.begin(active_.streams[i].set, now);
  });
  answer->finish();
  answer.reset();
  for_each_field(packet, [&](std::uint8_t command, Data data) {
    if (!is_poll(set, command)) return;
    const Poll polled = parse_poll(command, data);
    if (polled.code != ok) return;
    Packet answered(replies, polled.stream.set);
    for (std::size_t i = 0; i < polled.stream.count; ++i)
      fields.poll(answered, polled.stream.set, polled.stream.format[i].descriptor, now);
    answered.finish();
  });
}

Memory::Code Memory::execute(std::uint8_t set, std::uint8_t command, Data data, const Context& context) noexcept {
  for (const KeptSetting& kept : kept_settings())
    if (kept.set == set && kept.command == command && model_.is(kept.models))
      return execute_kept(kept, data, context.answer);
  for (const Acknowledged& one : acknowledged_commands())
    if (one.set == set && one.command == command && model_.is(one.models)) {
      if (data.size() != one.size) return bad_parameter;
      return set == filter_command && command <= 0x03 ? act_on_filter(command, data, context.fields) : ok;
    }
  if (!has(set, command)) return unknown_command;
  if (is_poll(set, command)) return parse_poll(command, data).code;
  Reader reader(data);
  if (set == base) return execute_base(command, reader, context);
  if (set == three_dm) return execute_3dm(command, reader, context);
  return rotation(set, command, reader, context.answer);
}

Memory::Code Memory::execute_base(std::uint8_t command, Reader& reader, const Context& context) noexcept {
  Packet& answer = context.answer;
  // Each product has its own bits of the built-in test. A failure sets bit 0 (an assumption).
  const bool has_failed = (context.fields.newest().status & status::self_test_failed) != 0;
  switch (command) {
    case 0x01:
      return ok;
    case 0x02:
      is_idle_ = true;
      return ok;
    case 0x03:
      put_device_info(answer);
      return ok;
    case 0x04:
      put_descriptors(answer, false);
      return ok;
    case 0x05:
      answer.begin(0x83);
      answer.put(std::uint32_t{has_failed});
      answer.end();
      return ok;
    case 0x06:
      is_idle_ = false;
      return ok;
    case 0x07:
      put_descriptors(answer, true);
      return ok;
    case 0x08:
      answer.begin(0x88);
      answer.put(std::uint8_t{has_failed});  // the least significant byte is the first
      for (int i = 1; i < 16; ++i) answer.put(std::uint8_t{0});
      answer.end();
      return ok;
    case 0x09: {
      const auto function = reader.take<std::uint8_t>();
      const auto port = reader.take<std::uint8_t>();
      if (port > 1) return bad_parameter;
      return baud(function, reader, answer, 0x89, true);
    }
    case 0x72:
      return update_gps_time(reader, context);
    default:
      restart(context.fields, context.now);
      context.fields.requests().restart();
      return ok;
  }
}

Memory::Code Memory::execute_3dm(std::uint8_t command, Reader& reader, const Context& context) noexcept {
  Packet& answer = context.answer;
  switch (command) {
    case 0x06:
      return base_rate(sensor, 0x83, reader, answer, false);
    case 0x07:
      return base_rate(gnss, 0x84, reader, answer, false);
    case 0x0B:
      return base_rate(filter, 0x8A, reader, answer, false);
    case 0x0E:
      return base_rate(reader.take<std::uint8_t>(), 0x8E, reader, answer, true);
    case 0x08:
      return format(reader.take<std::uint8_t>(), sensor, 0x80, reader, context, false);
    case 0x09:
      return format(reader.take<std::uint8_t>(), gnss, 0x81, reader, context, false);
    case 0x0A:
      return format(reader.take<std::uint8_t>(), filter, 0x82, reader, context, false);
    case 0x0F: {
      const auto function = reader.take<std::uint8_t>();
      return format(function, reader.take<std::uint8_t>(), 0x8F, reader, context, true);
    }
    case 0x11:
      return stream_control(reader, answer);
    case 0x30:
      return device_settings(reader, context);
    case 0x37:
      return vector(&Configuration::accelerometer_bias, units::standard_gravity, 0x9A, reader, answer);
    case 0x38:
      return vector(&Configuration::gyro_bias, 1, 0x9B, reader, answer);
    case 0x39:
      return capture_end_ ? failed : bad_parameter;
    case 0x42:
      return pin_state(reader, answer);
    case 0x50:
      return low_pass(reader, answer, false);
    case 0x54:
      return low_pass(reader, answer, true);
    case 0x64:
      return device_status(reader, context);
    case 0x40: {
      const auto function = reader.take<std::uint8_t>();
      return baud(function, reader, answer, 0x87, false);
    }
    default:
      return rotation(three_dm, command, reader, answer);
  }
}

void Memory::restart(Fields& fields, DeviceTime now) noexcept {
  active_ = stored_;
  fields.requests().aids = active_.aids(model_);
  fields.requests().heading.reset();
  gps_update_ = {};
  pulses_ = {};
  bytes_read_ = bytes_written_ = 0;
  reset_pins();
  capture_end_.reset();
  is_idle_ = false;
  fields.restart(now);
}

void Memory::step_clock(Nanoseconds by) noexcept {
  gps_update_.offset_ns -= by.count();
  if (capture_end_) capture_end_ = *capture_end_ + by;
  if (pulses_.last) pulses_.last = *pulses_.last + by;
}

Memory::Code Memory::baud(std::uint8_t function, Reader& reader, Packet& answer, std::uint8_t descriptor,
                          bool with_port) noexcept {
  constexpr std::array<std::uint32_t, 6> known = {9600, 19200, 115200, 230400, 460800, 921600};
  if (function == write) {
    const auto wanted = reader.take<std::uint32_t>();
    if (!reader.is_done() || std::find(known.begin(), known.end(), wanted) == known.end()) return bad_parameter;
    active_.baud = wanted;
    return ok;
  }
  if (!reader.is_whole()) return bad_parameter;
  if (function != read)
    return transfer(function, [](Configuration& to, const Configuration& from) { to.baud = from.baud; });
  answer.begin(descriptor);
  if (with_port) answer.put(std::uint8_t{1});
  answer.put(active_.baud);
  answer.end();
  return ok;
}

void Memory::count_bytes(std::size_t received, std::size_t sent) noexcept {
  bytes_read_ += static_cast<std::uint32_t>(received);
  bytes_written_ += static_cast<std::uint32_t>(sent);
}

// Writes the basic structure, or the diagnostic one. Their layouts are from the manual of the 3DM-GX5-45 (8500-0064
// C, 4.2.25) and imu_3dm_gx4 (imu.hpp, DiagnosticFields). Nothing is ever lost, and there is no USB.
Memory::Code Memory::device_status(Reader& reader, const Context& context) noexcept {
  enum Selector : std::uint8_t { basic = 1, diagnostic = 2 };
  const auto model = reader.take<std::uint16_t>();
  const auto selector = reader.take<std::uint8_t>();
  unsigned number = 0;
  for (const char digit : model_.number.substr(0, 4)) number = 10 * number + static_cast<unsigned>(digit - '0');
  if (!reader.is_done() || model != number || selector < basic || selector > diagnostic) return bad_parameter;
  const auto milliseconds = [&](DeviceTime at) {
    return static_cast<std::uint32_t>(context.fields.since_start(at).count() / 1'000'000);
  };
  const auto put = [&](std::initializer_list<std::uint32_t> numbers) {
    for (const std::uint32_t one : numbers) context.answer.put(one);
  };
  context.answer.begin(0x90);
  context.answer.put(model);
  context.answer.put(selector);
  put({0, milliseconds(context.now)});  // flags; system timer
  if (selector == diagnostic) {
    put({pulses_.count, pulses_.last ? milliseconds(*pulses_.last) : 0});
    for (const std::uint8_t set : {sensor, filter})
      context.answer.put(static_cast<std::uint8_t>(is_streaming(active_.streams[slot_of(set)])));
    put({0, 0, bytes_written_, bytes_read_, 0, 0});  // dropped packets; serial line: bytes, overruns
    put({0, 0, 0, 0, 0});                            // USB; parsing errors
    put({static_cast<std::uint32_t>(context.fields.samples()), milliseconds(context.fields.newest().time)});
  }
  context.answer.end();
  return ok;
}

// Sets the week or the second of the week, and keeps the other part. The given second of the week is the second that
// began with the last valid edge of the pulse-per-second input; without such an edge, the second that begins now.
Memory::Code Memory::update_gps_time(Reader& reader, const Context& context) noexcept {
  enum Part : std::uint8_t { week = 1, time_of_week = 2 };
  constexpr std::int64_t last_week = 9999;
  const auto function = reader.take<std::uint8_t>();
  const auto part = reader.take<std::uint8_t>();
  const std::int64_t value = reader.take<std::uint32_t>();
  if (!reader.is_done() || function != write) return bad_parameter;
  const std::int64_t now_ns = context.fields.gps_ns(context.now);
  const std::int64_t into_week_ns = ((now_ns % gps_week_ns) + gps_week_ns) % gps_week_ns;
  if (part == week && value <= last_week) {
    gps_update_.offset_ns = value * gps_week_ns + into_week_ns - context.now.ns;
    gps_update_.has_week = true;
  } else if (part == time_of_week && value < gps_week_s) {
    const bool is_pulsed = pulse_source() == PulseSource::gpio && context.fields.has_pulse(context.now);
    const DeviceTime begun = is_pulsed ? *pulses_.last : context.now;
    gps_update_.offset_ns = now_ns - into_week_ns + value * second_ns - begun.ns;
    gps_update_.has_time_of_week = true;
  } else {
    return bad_parameter;
  }
  ++gps_update_.count;
  return ok;
}

Memory::Code Memory::device_settings(Reader& reader, const Context& context) noexcept {
  const auto function = reader.take<std::uint8_t>();
  if (!reader.is_done()) return bad_parameter;
  if (function == load || function == to_default) context.fields.begin(0, context.now);
  const Code code = transfer(function, [](Configuration& to, const Configuration& from) { to = from; });
  if (function == load || function == to_default) reset_pins();
  return code;
}

bool Memory::has(std::uint8_t set, std::uint8_t command) const noexcept {
  return command != 0 && std::ranges::any_of(commands, [&](const Commands& some) {
           return some.set == set && model_.is(some.models) && std::ranges::count(some.commands, command) > 0;
         });
}

void Memory::put_device_info(Packet& answer) const noexcept {
  answer.begin(0x81);
  answer.put(std::uint16_t{1100});
  for (const std::string_view text :
       {model_.name, model_.number, model_.serial, std::string_view("I2Q"), model_.options})
    answer.put_padded(text, 16);
  answer.end();
}

// Writes the list of descriptors, as many as fit in a packet; the extended list has the other descriptors.
void Memory::put_descriptors(Packet& answer, bool extended) const noexcept {
  constexpr std::size_t list = 124;
  std::size_t count = 0;
  const auto put = [&](unsigned set, unsigned descriptor, unsigned of) {
    if (model_.is(of) && (count++ >= list) == extended) answer.put(static_cast<std::uint16_t>(set << 8 | descriptor));
  };
  answer.begin(extended ? 0x86 : 0x82);
  for (const Commands& some : commands)
    for (const std::uint8_t command : some.commands)
      if (command != 0) put(some.set, command, some.models);
  for (const KeptSetting& kept : kept_settings()) put(kept.set, kept.command, kept.models);
  for (const Acknowledged& one : acknowledged_commands()) put(one.set, one.command, one.models);
  for (const DataField& field : data_fields()) {
    if (field.set != gnss) put(field.set, field.descriptor, field.models);
    for (const std::uint8_t receiver : model_.receivers)
      if (field.set == gnss && receiver != 0) put(receiver, field.descriptor, field.models);
  }
  answer.end();
}

}  // namespace imud::mip
