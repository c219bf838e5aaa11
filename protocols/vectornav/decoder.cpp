#include <algorithm>
#include <cmath>

#include "core/units.hpp"
#include "protocols/vectornav/vectornav.hpp"
#include "protocols/wire/frame_search.hpp"

namespace imud::vectornav {
namespace {

class VectorNavDecoder final : public FrameDecoder<longest> {
 private:
  std::size_t parse(std::span<const std::byte> held, MeasurementSink& sink) override {
    if (held[0] == std::byte{0xFA}) return parse_binary(held, sink);
    if (held[0] == std::byte{'$'}) return parse_text(held, sink);
    return Search::reject;
  }

  std::size_t parse_binary(std::span<const std::byte> held, MeasurementSink& sink) {
    const auto head = binary_head(held);
    if (!head) return Search::reject;
    const auto& [masks, fields, size] = *head;
    if (held.size() < size) return Search::need_more;
    if (crc16(held.subspan(1, size - 1)) != 0) {
      ++errors_.checksum;
      return Search::reject;
    }
    Measurement measurement;
    bool finite = true;
    std::size_t at = fields;
    for (unsigned g = 0; g < groups; ++g)
      for (unsigned bit = 0; bit < mask_bits; ++bit)
        if ((masks[g] >> bit & 1U) != 0) {
          finite = read_field(g << 4 | bit, held.subspan(at, field_size(g, bit)), measurement) && finite;
          at += field_size(g, bit);
        }
    if (!finite)
      ++errors_.malformed;
    else if (measurement.fields != 0)
      sink.on_measurement(measurement);
    return size;
  }

  // Returns false if a number is not finite.
  static bool read_field(unsigned field, std::span<const std::byte> data, Measurement& m) noexcept {
    FieldReader<boost::endian::order::little> reader(data);
    Sample& s = m.sample;
    switch (field) {
      case common << 4 | 0:
      case time_group << 4 | 0:
        s.time.ns = static_cast<std::int64_t>(reader.take<std::uint64_t>());
        m.fields |= Measurement::time;
        return true;
      case common << 4 | 5:
      case imu << 4 | 10:
        s.rate = reader.take_floats();
        m.fields |= Measurement::rate;
        return s.rate.allFinite();
      case common << 4 | 8:
      case imu << 4 | 9:
        s.specific_force = reader.take_floats();
        m.fields |= Measurement::specific_force;
        return s.specific_force.allFinite();
      case common << 4 | 11:
      case imu << 4 | 6:
        reader.take<float>();  // the time step
        s.delta_angle = units::degree * reader.take_floats();
        m.fields |= Measurement::delta_angle;
        if (field == (imu << 4 | 6)) return s.delta_angle.allFinite();
        s.delta_velocity = reader.take_floats();
        m.fields |= Measurement::delta_velocity;
        return s.delta_angle.allFinite() && s.delta_velocity.allFinite();
      case imu << 4 | 7:
        s.delta_velocity = reader.take_floats();
        m.fields |= Measurement::delta_velocity;
        return s.delta_velocity.allFinite();
      case imu << 4 | 4:
        s.temperature_c = static_cast<double>(reader.take<float>());
        m.fields |= Measurement::temperature;
        return std::isfinite(s.temperature_c);
      case imu << 4 | 11: {
        const unsigned bits = reader.take<std::uint16_t>();
        s.status = (bits >> 6 & 7U) | (bits >> 3 & 7U) << 3;
        m.fields |= Measurement::status;
        return true;
      }
      default:
        return true;
    }
  }

  std::size_t parse_text(std::span<const std::byte> held, MeasurementSink& sink) {
    constexpr std::size_t longest_text = 300;
    const std::string_view text(reinterpret_cast<const char*>(held.data()), std::min(held.size(), longest_text));
    const std::size_t end = text.find('\n');
    if (end == std::string_view::npos) return text.size() == longest_text ? Search::reject : Search::need_more;
    const std::size_t star = text.substr(0, end).rfind('*');
    if (star == std::string_view::npos || end < star + 4) return Search::reject;
    const std::string_view body = text.substr(1, star - 1), sum = text.substr(star + 1, end - star - 2);
    if (!is_checksum_of(body, sum)) {
      ++errors_.checksum;
      return Search::reject;
    }
    measure(Words(body), sink);
    return end + 1;
  }

  static void measure(const Words& words, MeasurementSink& sink) {
    // The index of the word with the first number of each quantity; 0: the message does not have it.
    struct Layout {
      std::string_view name;
      std::size_t count, acceleration, rate, temperature = 0, delta_angle = 0, delta_velocity = 0;
    };
    constexpr std::array<Layout, 9> layouts = {{{"VNQMR", 14, 8, 11},
                                                {"VNACC", 4, 1, 0},
                                                {"VNGYR", 4, 0, 1},
                                                {"VNMAR", 10, 4, 7},
                                                {"VNYMR", 13, 7, 10},
                                                {"VNIMU", 12, 4, 7, 10},
                                                {"VNYBA", 10, 0, 7},
                                                {"VNDTV", 8, 0, 0, 0, 2, 5},
                                                {"VNISL", 16, 10, 13}}};
    std::size_t count = std::min(words.count, words.words.size());
    const auto is_appended = [](std::string_view word) { return word.starts_with('T') || word.starts_with('S'); };
    while (count > 1 && is_appended(words[count - 1]))
      --count;  // count and status, appended as register 30 configures
    for (const Layout& layout : layouts) {
      if (words[0] != layout.name || count != layout.count) continue;
      Measurement m;
      Sample& sample = m.sample;
      const auto number = [&](std::size_t at) { return real_in(words[at]).value_or(0); };
      const auto get = [&](std::size_t at, Measurement::Field field, Vector3& quantity, double unit = 1) {
        if (at == 0) return;
        quantity = unit * Vector3(number(at), number(at + 1), number(at + 2));
        m.fields |= field;
      };
      get(layout.acceleration, Measurement::specific_force, sample.specific_force);
      get(layout.rate, Measurement::rate, sample.rate);
      get(layout.delta_angle, Measurement::delta_angle, sample.delta_angle, units::degree);
      get(layout.delta_velocity, Measurement::delta_velocity, sample.delta_velocity);
      if (layout.temperature != 0) {
        sample.temperature_c = number(layout.temperature);
        m.fields |= Measurement::temperature;
      }
      sink.on_measurement(m);
    }
  }
};

}  // namespace

std::optional<BinaryHead> binary_head(std::span<const std::byte> held) noexcept {
  BinaryHead head;
  head.size = 2;
  if (!held.empty() && held[0] != std::byte{0xFA}) return std::nullopt;
  if (held.size() < head.size) return head;
  const auto bits = std::to_integer<unsigned>(held[1]);
  if (bits == 0 || bits > 0x7F) return std::nullopt;
  head.size += 2 * static_cast<std::size_t>(std::popcount(bits));
  if (held.size() < head.size) return head;
  std::size_t at = 2;
  head.fields = head.size;
  for (unsigned g = 0; g < groups; ++g) {
    if ((bits >> g & 1U) == 0) continue;
    head.masks[g] = std::to_integer<unsigned>(held[at]) | std::to_integer<unsigned>(held[at + 1]) << 8;
    at += 2;
    for (unsigned bit = 0; bit < mask_bits; ++bit) {
      if ((head.masks[g] >> bit & 1U) == 0) continue;
      if (field_size(g, bit) == 0) return std::nullopt;
      head.size += field_size(g, bit);
    }
  }
  head.size += 2;
  if (head.size > longest) return std::nullopt;
  return head;
}

std::unique_ptr<Decoder> make_decoder() { return std::make_unique<VectorNavDecoder>(); }

}  // namespace imud::vectornav
