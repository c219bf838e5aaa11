#include <algorithm>

#include "protocols/mip.hpp"

namespace imud::mip {

Stream* Configuration::find(std::uint8_t set) noexcept {
  for (Stream& stream : streams)
    if (stream.set == set && set != 0) return &stream;
  return nullptr;
}
const Stream* Configuration::find(std::uint8_t set) const noexcept {
  for (const Stream& stream : streams)
    if (stream.set == set && set != 0) return &stream;
  return nullptr;
}

void Memory::answer(std::span<const std::byte> packet, Fields& fields, FrameBuffer& replies) noexcept {
  const auto set = std::to_integer<std::uint8_t>(packet[2]);
  polled_ = 0;
  acknowledges_ = true;
  {
    Packet answer(replies, set);
    for_each_field(packet, [&](std::uint8_t command, std::span<const std::byte> data) {
      if (!answer.has_room_for(2)) return;
      answer.begin(reply);
      answer.put(command);
      const std::size_t at = answer.size();
      answer.put(std::uint8_t{ok});
      answer.end();
      Reader reader(data);
      const Code code = set == base       ? obey_base(command, reader, answer)
                        : set == three_dm && has(command) ? obey_3dm(command, reader, answer)
                                          : unknown_command;
      answer.set_byte(at, code);
    });
    if (acknowledges_) answer.finish();
  }
  if (polled_ == 0) return;
  Packet data(replies, polled_set_);
  for (std::size_t i = 0; i < polled_; ++i) fields.put(data, polled_set_, poll_[i]);
  data.finish();
}

Memory::Code Memory::obey_base(std::uint8_t command, Reader& reader, Packet& answer) noexcept {
  switch (command) {
    case 0x01: return ok;
    case 0x02: is_idle_ = true; return ok;
    case 0x03:
      answer.begin(0x81);
      answer.put(std::uint16_t{1100});
      for (const std::string_view text : {model_.name, model_.number, std::string_view("6254.123456"),
                                          std::string_view("I2Q"), model_.options})
        answer.put_padded(text, 16);
      answer.end();
      return ok;
    case 0x04:
    case 0x07:
      answer.begin(command == 0x04 ? 0x82 : 0x86);
      if (command == 0x04) put_descriptors(answer);
      answer.end();
      return ok;
    case 0x05:
      answer.begin(0x83);
      answer.put(std::uint32_t{0});
      answer.end();
      return ok;
    case 0x06: is_idle_ = false; return ok;
    case 0x08:
      answer.begin(0x88);
      for (int i = 0; i < 16; ++i) answer.put(std::uint8_t{0});
      answer.end();
      return ok;
    case 0x09: {
      const auto function = reader.take<std::uint8_t>();
      const auto port = reader.take<std::uint8_t>();
      if (port > 1) return bad_parameter;
      return baud(function, reader, answer, 0x89, true);
    }
    case 0x72: return ok;
    case 0x7E:
      active_ = stored_;
      is_idle_ = false;
      return ok;
    default: return unknown_command;
  }
}

Memory::Code Memory::baud(std::uint8_t function, Reader& reader, Packet& answer, std::uint8_t descriptor, bool with_port) noexcept {
  constexpr std::array<std::uint32_t, 6> known = {9600, 19200, 115200, 230400, 460800, 921600};
  std::uint32_t wanted = active_.baud;
  switch (function) {
    case write: wanted = reader.take<std::uint32_t>(); break;
    case read: break;
    case save: stored_.baud = active_.baud; break;
    case load: wanted = stored_.baud; break;
    case to_default: wanted = factory_.baud; break;
    default: return bad_parameter;
  }
  if (!reader.is_done() || std::find(known.begin(), known.end(), wanted) == known.end()) return bad_parameter;
  active_.baud = wanted;
  if (function != read) return ok;
  answer.begin(descriptor);
  if (with_port) answer.put(std::uint8_t{1});
  answer.put(active_.baud);
  answer.end();
  return ok;
}

Memory::Code Memory::obey_3dm(std::uint8_t command, Reader& reader, Packet& answer) noexcept {
  switch (command) {
    case 0x01: return poll(sensor, true, reader);
    case 0x02: return poll(gnss, true, reader);
    case 0x03: return poll(filter, true, reader);
    case 0x0D: return poll(reader.take<std::uint8_t>(), false, reader);
    case 0x06: return base_rate(sensor, 0x83, answer, false);
    case 0x07: return base_rate(gnss, 0x84, answer, false);
    case 0x0B: return base_rate(filter, 0x8A, answer, false);
    case 0x0E: return base_rate(reader.take<std::uint8_t>(), 0x8E, answer, true);
    case 0x08: return format(reader.take<std::uint8_t>(), sensor, 0x80, reader, answer, false);
    case 0x09: return format(reader.take<std::uint8_t>(), gnss, 0x81, reader, answer, false);
    case 0x0A: return format(reader.take<std::uint8_t>(), filter, 0x82, reader, answer, false);
    case 0x0F: {
      const auto function = reader.take<std::uint8_t>();
      return format(function, reader.take<std::uint8_t>(), 0x8F, reader, answer, true);
    }
    case 0x11: return stream_control(reader, answer);
    case 0x30: return device_settings(reader);
    case 0x40: {
      const auto function = reader.take<std::uint8_t>();
      return baud(function, reader, answer, 0x87, false);
    }
    default: return unknown_command;
  }
}

Memory::Code Memory::device_settings(Reader& reader) noexcept {
  const auto function = reader.take<std::uint8_t>();
  if (!reader.is_done()) return bad_parameter;
  switch (function) {
    case save: stored_ = active_; return ok;
    case load: active_ = stored_; return ok;
    case to_default: active_ = factory_; return ok;
    default: return bad_parameter;
  }
}

Memory::Code Memory::poll(std::uint8_t set, bool with_rates, Reader& reader) noexcept {
  const bool suppress = reader.take<std::uint8_t>() != 0;
  const auto count = reader.take<std::uint8_t>();
  const Stream* stream = active_.find(set);
  if (stream == nullptr || !reader.is_whole() || count > poll_.size()) return bad_parameter;
  for (std::size_t i = 0; i < count; ++i) {
    poll_[i] = reader.take<std::uint8_t>();
    if (with_rates) reader.take<std::uint16_t>();
    if (find_field(model_, set, poll_[i]) == nullptr) return bad_parameter;
  }
  if (!reader.is_done()) return bad_parameter;
  polled_set_ = set;
  polled_ = count;
  if (count == 0)  // as it is streamed
    for (; polled_ < stream->count; ++polled_) poll_[polled_] = stream->format[polled_].descriptor;
  if (suppress) acknowledges_ = false;
  return ok;
}

Memory::Code Memory::base_rate(std::uint8_t set, std::uint8_t descriptor, Packet& answer, bool with_set) noexcept {
  const Stream* stream = active_.find(set);
  if (stream == nullptr) return bad_parameter;
  answer.begin(descriptor);
  if (with_set) answer.put(set);
  answer.put(stream->base_hz);
  answer.end();
  return ok;
}

Memory::Code Memory::format(std::uint8_t function, std::uint8_t set, std::uint8_t descriptor, Reader& reader, Packet& answer,
            bool with_set) noexcept {
  Stream *active = active_.find(set), *stored = stored_.find(set);
  const Stream* factory = factory_.find(set);
  if (active == nullptr || !reader.is_whole()) return bad_parameter;
  switch (function) {
    case write: {
      Stream wanted = *active;
      wanted.count = 0;
      const auto count = reader.take<std::uint8_t>();
      if (count > wanted.format.size()) return bad_parameter;
      for (unsigned i = 0; i < count; ++i) {
        const auto field = reader.take<std::uint8_t>();
        const auto decimation = reader.take<std::uint16_t>();
        if (find_field(model_, set, field) == nullptr || decimation == 0) return bad_parameter;
        wanted.add(field, decimation);
      }
      if (!reader.is_done()) return bad_parameter;
      *active = wanted;
      return ok;
    }
    case read:
      answer.begin(descriptor);
      if (with_set) answer.put(set);
      answer.put(active->count);
      for (std::size_t i = 0; i < active->count; ++i) {
        answer.put(active->format[i].descriptor);
        answer.put(active->format[i].decimation);
      }
      answer.end();
      return ok;
    case save: *stored = *active; return ok;
    case load: *active = *stored; return ok;
    case to_default: *active = *factory; return ok;
    default: return bad_parameter;
  }
}

Memory::Code Memory::stream_control(Reader& reader, Packet& answer) noexcept {
  const auto function = reader.take<std::uint8_t>();
  auto set = reader.take<std::uint8_t>();
  if (set == 0x01) set = sensor;  // as older devices number them
  if (set == 0x02) set = gnss;
  if (set == 0x03) set = filter;
  Stream *active = active_.find(set), *stored = stored_.find(set);
  if (active == nullptr) return bad_parameter;
  switch (function) {
    case write: {
      const auto enable = reader.take<std::uint8_t>();
      if (!reader.is_done() || enable > 1) return bad_parameter;
      active->enabled = enable != 0;
      return ok;
    }
    case read:
      answer.begin(0x85);
      answer.put(set);
      answer.put(static_cast<std::uint8_t>(active->enabled));
      answer.end();
      return ok;
    case save: stored->enabled = active->enabled; return ok;
    case load: active->enabled = stored->enabled; return ok;
    case to_default: active->enabled = factory_.find(set)->enabled; return ok;
    default: return bad_parameter;
  }
}

// Of a receiver.
bool Memory::has(std::uint8_t command) const noexcept {
  return model_.gnss_hz > 0 || (command != 0x02 && command != 0x07 && command != 0x09);
}

void Memory::put_descriptors(Packet& answer) const noexcept {
  for (const int command : {0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x08, 0x09, 0x72, 0x7E})
    answer.put(static_cast<std::uint16_t>(base << 8 | command));
  for (const int command : {0x01, 0x02, 0x03, 0x06, 0x07, 0x08, 0x09, 0x0A, 0x0B, 0x0D, 0x0E, 0x0F, 0x11, 0x30, 0x40})
    if (has(static_cast<std::uint8_t>(command))) answer.put(static_cast<std::uint16_t>(three_dm << 8 | command));
  for (const DataField& field : data_fields())
    if (model_.is(field.models)) answer.put(static_cast<std::uint16_t>(field.set << 8 | field.descriptor));
}

}  // namespace imud::mip
