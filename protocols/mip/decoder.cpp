#include "core/units.hpp"
#include "protocols/mip/mip.hpp"
#include "protocols/wire/frame_search.hpp"

namespace imud::mip {
namespace {

// Decodes sensor data packets. Packets of other sets are checked, and then ignored.
class MipDecoder final : public FrameDecoder<longest> {
 private:
  std::size_t parse(std::span<const std::byte> held, MeasurementSink& sink) override {
    const auto size = packet_size(held);
    if (!size) return Search::reject;
    if (held.size() < *size) return Search::need_more;
    const std::span<const std::byte> packet = held.first(*size);
    if (!is_intact(packet)) {
      ++errors_.checksum;
      return Search::reject;
    }
    if (packet[2] != std::byte{sensor}) return *size;
    Measurement measurement;
    Sample& sample = measurement.sample;
    bool is_finite = true;
    const bool is_good = for_each_field(packet, [&](std::uint8_t descriptor, std::span<const std::byte> data) {
      const DataField* field = find_field(models.back(), sensor, descriptor);
      if (field == nullptr || data.size() != field->size) return;
      Reader reader(data);
      const auto vector = [&](double unit, Measurement::Field carried) {
        measurement.fields |= carried;
        const Vector3 v = unit * reader.take_floats();
        is_finite = is_finite && v.allFinite();
        return v;
      };
      switch (descriptor) {
        case 0x04:
          sample.specific_force = vector(units::standard_gravity, Measurement::specific_force);
          break;
        case 0x05:
          sample.rate = vector(1, Measurement::rate);
          break;
        case 0x07:
          sample.delta_angle = vector(1, Measurement::delta_angle);
          break;
        case 0x08:
          sample.delta_velocity = vector(units::standard_gravity, Measurement::delta_velocity);
          break;
        case 0x14:
          sample.temperature_c = vector(1, Measurement::temperature)[2];
          break;
        case 0x18: {
          const unsigned bits = reader.take<std::uint16_t>();
          sample.status = (bits >> 4 & 7U) | (bits & 7U) << 3;
          measurement.fields |= Measurement::status;
          break;
        }
        case 0xD5:
          sample.time.ns = static_cast<std::int64_t>(reader.take<std::uint64_t>());
          measurement.fields |= Measurement::time;
          break;
        default:
          break;
      }
    });
    if (!is_good || !is_finite)
      ++errors_.malformed;
    else if (measurement.fields != 0)
      sink.on_measurement(measurement);
    return *size;
  }
};

}  // namespace

std::unique_ptr<Decoder> make_decoder() { return std::make_unique<MipDecoder>(); }

}  // namespace imud::mip
