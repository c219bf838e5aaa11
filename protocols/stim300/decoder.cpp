#include <optional>

#include "core/units.hpp"
#include "protocols/stim300/datagram.hpp"
#include "protocols/wire/frame_search.hpp"

namespace imud::stim300 {
namespace {

std::optional<unsigned> content_of(unsigned id) noexcept {
  for (unsigned content = 0; content < 16; ++content)
    if (identifier(content, false) == id || identifier(content, true) == id) return content;
  return std::nullopt;
}

class DatagramDecoder final : public FrameDecoder<longest_datagram> {
 public:
  explicit DatagramDecoder(const Configuration& configuration) : c_(configuration) {}

 private:
  static std::uint64_t get(std::span<const std::byte>& bytes, unsigned count) noexcept {
    std::uint64_t number = 0;
    for (unsigned i = 0; i < count; ++i) number = number << 8 | std::to_integer<std::uint64_t>(bytes[i]);
    bytes = bytes.subspan(count);
    return number;
  }
  static double get_number(std::span<const std::byte>& bytes, unsigned count) noexcept {
    const unsigned shift = 64 - 8 * count;
    return static_cast<double>(static_cast<std::int64_t>(get(bytes, count) << shift) >> shift);
  }

  std::size_t parse(std::span<const std::byte> held, MeasurementSink& sink) override {
    const auto id = std::to_integer<unsigned>(held[0]);
    const std::size_t size = datagram_size_of(id);
    if (size == 0) return Search::reject;
    if (held.size() < size) return Search::need_more;
    std::span<const std::byte> rest = held.subspan(size - 4, 4);
    if (get(rest, 4) != crc_of(held.first(size - 4))) {
      ++errors_.checksum;
      return Search::reject;
    }
    const bool special = size == 20 || size == 26 || size == 40 || size == 21;
    // The identifier of a special datagram tells whether CR LF follows. Other datagrams end like the last special
    // one.
    if (special) c_.cr_lf = id == 0xB3 || id == 0xB7 || id == 0xBD || id == 0xD2 || id == 0xBF;
    if (c_.cr_lf && held.size() < size + 2) return Search::need_more;
    if (size == 26) set_units(held);
    if (!special) measure(held.subspan(1, size - 5), id, sink);
    return c_.cr_lf ? size + 2 : size;
  }

  void set_units(std::span<const std::byte> held) noexcept {
    const auto at = [&](std::size_t i) { return std::to_integer<unsigned>(held[i]); };
    c_.units = {at(5) & 15U, at(8) & 15U, at(11) & 15U};
    c_.accelerometer_range = at(17) >> 4;
  }

  void measure(std::span<const std::byte> rest, unsigned id, MeasurementSink& sink) {
    c_.content = content_of(id).value_or(0);
    Measurement measurement;
    Sample& sample = measurement.sample;
    measurement.fields = Measurement::counter | Measurement::status;
    unsigned all = 0;
    for (const Cluster cluster : clusters) {
      if (!c_.has(cluster)) continue;
      const unsigned unit = c_.units[cluster] % delayed;
      Vector3 axes;
      for (int i = 0; i < 3; ++i) axes[i] = get_number(rest, 3) * lsb(c_, cluster, unit);
      const auto bits = static_cast<unsigned>(get(rest, 1));
      all |= bits;
      const bool plain = unit == value || unit == average;
      if (cluster == inclinometer) {
        if (plain) sample.inclination = axes * units::standard_gravity;
        continue;
      }
      const unsigned overloaded = (bits & status_bit::overload) != 0 ? bits & 7U : 0;
      if (cluster == gyro) {
        sample.status |= overloaded;
        if (plain) sample.rate = axes * units::degree;
        if (unit == increment) sample.delta_angle = axes * units::degree;
        measurement.fields |= plain ? Measurement::rate : unit == increment ? Measurement::delta_angle : 0U;
      } else {
        sample.status |= overloaded * status::accelerometer_saturated_x;
        if (plain) sample.specific_force = axes * units::standard_gravity;
        if (unit == increment) sample.delta_velocity = axes;
        measurement.fields |= plain               ? Measurement::specific_force
                              : unit == increment ? Measurement::delta_velocity
                                                  : 0U;
      }
    }
    if ((all & status_bit::integrity) != 0) sample.status |= status::not_valid;
    if (c_.has_temperature()) {
      sample.temperature_c = get_number(rest, 2) / 256;
      measurement.fields |= Measurement::temperature;
    }
    // The counter is the third byte from the end.
    rest = rest.last(3);
    sample.counter = get(rest, 1);
    sink.on_measurement(measurement);
  }

  Configuration c_;
};

}  // namespace

std::size_t datagram_size_of(unsigned id) noexcept {
  switch (id) {
    case 0xB1:
    case 0xB3:
    case 0xB5:
    case 0xB7:
      return 20;
    case 0xBC:
    case 0xBD:
      return 26;
    case 0xD1:
    case 0xD2:
      return 40;
    case 0xBE:
    case 0xBF:
      return 21;
    default:
      break;
  }
  const auto content = content_of(id);
  return content ? datagram_size(*content) : 0;
}

std::span<std::byte> reseal(std::span<std::byte> datagram, const CanHeader&) noexcept {
  if (datagram.empty()) return {};
  const std::size_t size = datagram_size_of(std::to_integer<unsigned>(datagram[0]));
  const bool is_whole = size != 0 && (datagram.size() == size || datagram.size() == size + 2);  // with CR LF
  if (!is_whole) return {};
  std::uint32_t crc = crc_of(datagram.first(size - 4));
  for (std::size_t i = size; i > size - 4; crc >>= 8) datagram[--i] = static_cast<std::byte>(crc);
  return datagram.subspan(1, size - 5);
}

std::unique_ptr<Decoder> make_decoder(const Configuration& configuration) {
  return std::make_unique<DatagramDecoder>(configuration);
}

}  // namespace imud::stim300
