// The commands that set, read and poll the data streams.
#include "protocols/mip/mip.hpp"

namespace imud::mip {

bool Memory::is_poll(std::uint8_t set, std::uint8_t command) const noexcept {
  return set == three_dm && (command <= 0x03 || command == 0x0D) && has(set, command);
}

// 0C:01, 0C:02 and 0C:03 poll sensor, GNSS and filter data, with a rate beside each descriptor; 0C:0D polls the set
// that it names.
Memory::Poll Memory::parse_poll(std::uint8_t command, Data data) const noexcept {
  Reader reader(data);
  const bool is_named = command == 0x0D;
  Poll poll;
  poll.stream.set = is_named ? reader.take<std::uint8_t>() : static_cast<std::uint8_t>(sensor + command - 1);
  const bool is_silent = reader.take<std::uint8_t>() != 0;
  const auto count = reader.take<std::uint8_t>();
  const Stream* stored = active_.find(poll.stream.set);
  bool is_short = true;
  for (unsigned i = 0; i < count; ++i) {
    const auto descriptor = reader.take<std::uint8_t>();
    if (!is_named) reader.take<std::uint16_t>();
    if (find_field(model_, poll.stream.set, descriptor) == nullptr) continue;  // unknown ones are ignored
    is_short = is_short && poll.stream.count < poll.stream.format.size();
    poll.stream.add(descriptor, 1);
  }
  if (!reader.is_done()) return poll;
  poll.is_silent = is_silent;
  if (stored == nullptr || !is_short || !fits_a_packet(model_, poll.stream)) return poll;
  if (count == 0) poll.stream = *stored;
  poll.code = count == 0 && stored->count == 0 ? failed : ok;
  return poll;
}

Memory::Code Memory::base_rate(std::uint8_t set, std::uint8_t descriptor, Reader& reader, Packet& answer,
                               bool with_set) noexcept {
  const Stream* stream = active_.find(set);
  if (stream == nullptr || !reader.is_whole()) return bad_parameter;
  answer.begin(descriptor);
  if (with_set) answer.put(set);
  answer.put(stream->base_hz);
  answer.end();
  return ok;
}

Memory::Code Memory::format(std::uint8_t function, std::uint8_t set, std::uint8_t descriptor, Reader& reader,
                            const Context& context, bool with_set) noexcept {
  Packet& answer = context.answer;
  Stream* active = active_.find(set);
  const bool is_every = with_set && set == 0 && function != write && function != read;
  if ((active == nullptr && !is_every) || !reader.is_whole()) return bad_parameter;
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
      if (!reader.is_done() || !fits_a_packet(model_, wanted)) return bad_parameter;
      *active = wanted;
      context.fields.begin(set, context.now);
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
    default:
      if (function == load || function == to_default) context.fields.begin(set, context.now);
      return transfer(function, [&](Configuration& to, const Configuration& from) {
        for (std::size_t i = 0; i < to.streams.size(); ++i) {
          if (!is_every && to.streams[i].set != set) continue;
          to.streams[i].count = from.streams[i].count;
          to.streams[i].format = from.streams[i].format;
        }
      });
  }
}

Memory::Code Memory::stream_control(Reader& reader, Packet& answer) noexcept {
  const auto function = reader.take<std::uint8_t>();
  const auto named = reader.take<std::uint8_t>();
  constexpr std::uint8_t as_older_devices_number_them[] = {0, sensor, gnss, filter};
  const std::uint8_t set =
      named < std::size(as_older_devices_number_them) ? as_older_devices_number_them[named] : named;
  Stream* active = active_.find(set);
  const bool is_every = set == 0 && function != read;
  if ((active == nullptr && !is_every) || !reader.is_whole()) return bad_parameter;
  switch (function) {
    case write: {
      const auto enable = reader.take<std::uint8_t>();
      if (!reader.is_done() || enable > 1) return bad_parameter;
      for (Stream& stream : active_.streams)
        if (is_every || stream.set == set) stream.enabled = enable != 0;
      return ok;
    }
    case read:
      answer.begin(0x85);
      answer.put(named);
      answer.put(static_cast<std::uint8_t>(active->enabled));
      answer.end();
      return ok;
    default:
      return transfer(function, [&](Configuration& to, const Configuration& from) {
        for (std::size_t i = 0; i < to.streams.size(); ++i)
          if (is_every || to.streams[i].set == set) to.streams[i].enabled = from.streams[i].enabled;
      });
  }
}

}  // namespace imud::mip
