// MicroStrain MIP, as the 3DM-GX5-25 and the 3DM-CV7-AHRS speak it. The layouts are those of MicroStrain's mip_sdk
// (protocols/mip.hpp), against whose capture the tests hold them.
//
// What the document does not say and a user would expect: out of the box the device streams (ArduPilot sends nothing and
// waits for that); reference time is the device's own time.
#include <algorithm>
#include <stdexcept>

#include "core/units.hpp"
#include "protocols/frame_search.hpp"
#include "protocols/mip.hpp"
#include "protocols/protocol.hpp"

namespace imud {

namespace {

using namespace mip;

class MipDevice final : public Device {
 public:
  MipDevice(const Model& model, const Configuration& configuration) noexcept : fields_(model), memory_(model, configuration) {}

  void sample(const Sample& sample, FrameBuffer& out) noexcept override {
    fields_.take(sample);
    if (memory_.is_idle()) return;
    for (const Stream& stream : memory_.active().streams) {
      if (!stream.enabled || stream.count == 0) continue;
      const auto divisor = static_cast<std::uint64_t>(internal_hz) / stream.base_hz;
      if (sample.counter % divisor != 0) continue;
      Packet packet(out, stream.set);
      for (std::size_t k = 0; k < stream.count; ++k)
        if (sample.counter / divisor % stream.format[k].decimation == 0)
          fields_.put(packet, stream.set, stream.format[k].descriptor);
      packet.finish();
    }
  }

  void receive(const Frame& from_host, FrameBuffer& replies) noexcept override {
    constexpr Nanoseconds patience = std::chrono::milliseconds(500);
    if (fields_.time() - heard_ > patience) search_.finish();
    heard_ = fields_.time();
    search_.feed(from_host.bytes, [&](std::span<const std::byte> held) -> std::size_t {
      const auto size = packet_size(held);
      if (!size) return Search::reject;
      if (held.size() < *size) return Search::need_more;
      if (!is_intact(held.first(*size))) return Search::reject;
      memory_.answer(held.first(*size), fields_, replies);
      return *size;
    });
  }

  LineSettings line() const noexcept override { return {memory_.active().baud}; }

 private:
  using Search = FrameSearch<longest>;

  Fields fields_;
  Memory memory_;
  DeviceTime heard_;
  Search search_;
};

// Of sensor data packets.
class MipDecoder final : public Decoder {
 public:
  void feed(const Frame& frame, MeasurementSink& sink) override {
    errors_.skipped_bytes +=
        search_.feed(frame.bytes, [&](std::span<const std::byte> held) { return judge(held, sink); });
  }
  void finish(MeasurementSink&) override { errors_.skipped_bytes += search_.finish(); }

 private:
  using Search = FrameSearch<longest>;

  std::size_t judge(std::span<const std::byte> held, MeasurementSink& sink) {
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
      const DataField* field = find_field(sensor, descriptor);
      if (field == nullptr || data.size() != field->size) return;
      Reader reader(data);
      const auto vector = [&](double unit, Measurement::Field carried) {
        measurement.fields |= carried;
        const Vector3 v = unit * reader.take_floats();
        is_finite = is_finite && v.allFinite();
        return v;
      };
      switch (descriptor) {
        case 0x04: sample.specific_force = vector(units::standard_gravity, Measurement::specific_force); break;
        case 0x05: sample.rate = vector(1, Measurement::rate); break;
        case 0x07: sample.delta_angle = vector(1, Measurement::delta_angle); break;
        case 0x08: sample.delta_velocity = vector(units::standard_gravity, Measurement::delta_velocity); break;
        case 0x14: sample.temperature_c = vector(1, Measurement::temperature)[2]; break;
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
        default: break;
      }
    });
    if (!is_good || !is_finite)
      ++errors_.malformed;
    else if (measurement.fields != 0)
      sink.on_measurement(measurement);
    return *size;
  }

  Search search_;
};

constexpr std::array<std::string_view, 2> model_names = {"3dm-gx5-25", "3dm-cv7-ahrs"};
constexpr std::array<std::string_view, 7> sensor_defaults = {"reference_time", "acceleration", "rate",     "delta_angle",
                                                             "delta_velocity", "temperature",  "overrange"};
constexpr std::array<std::string_view, 3> filter_defaults = {"filter_reference_time", "filter_status", "filter_euler"};
constexpr Setting declared[] = {
    {.key = "model", .help = "which device", .initial = model_names[0], .choices = model_names},
    {.key = "sensor_rate_hz", .help = "of the sensor data; a divisor of 1000", .initial = std::int64_t{100}, .min = 1, .max = 1000},
    {.key = "sensor_fields", .help = "what is streamed", .initial = std::span<const std::string_view>(sensor_defaults)},
    {.key = "filter_rate_hz", .help = "of the filter data; a divisor of its base rate", .initial = std::int64_t{10}, .min = 1,
     .max = 1000},
    {.key = "filter_fields", .help = "what is streamed", .initial = std::span<const std::string_view>(filter_defaults)},
    {.key = "baud", .help = "bit/s", .initial = std::int64_t{115200}, .min = 9600, .max = 921600},
};

const Model& model_of(const Settings& settings) {
  return settings.text("model") == models[0].keyword ? models[0] : models[1];
}

Configuration configuration(const Settings& settings) {
  Configuration c;
  c.baud = static_cast<std::uint32_t>(settings.integer("baud"));
  const auto fill = [&](Stream& stream, std::uint8_t set, std::uint16_t base_hz, const char* rate, const char* fields) {
    stream.set = set;
    stream.base_hz = base_hz;
    const std::int64_t hz = settings.integer(rate);
    if (hz > base_hz || base_hz % hz != 0)
      throw std::invalid_argument(std::string(rate) + ": give a divisor of " + std::to_string(base_hz));
    for (const std::string& name : settings.list(fields)) {
      const auto field = std::find_if(data_fields().begin(), data_fields().end(),
                                       [&](const DataField& f) { return f.set == set && f.name == name; });
      if (field == data_fields().end()) {
        std::string known;
        for (const DataField& f : data_fields())
          if (f.set == set) known += " " + std::string(f.name);
        throw std::invalid_argument(std::string(fields) + ": there is no \"" + name + "\"; known:" + known);
      }
      stream.add(field->descriptor, static_cast<std::uint16_t>(base_hz / hz));
    }
  };
  fill(c.streams[0], sensor, 1000, "sensor_rate_hz", "sensor_fields");
  fill(c.streams[1], filter, model_of(settings).filter_hz, "filter_rate_hz", "filter_fields");
  return c;
}

Product product(const Settings& settings) {
  const Model& model = model_of(settings);
  Product product;
  product.rate_hz = internal_hz;
  product.gyro = TriadErrors::white(model.gyro_noise, internal_hz, model.gyro_max);
  product.accelerometer = TriadErrors::white(model.accelerometer_noise, internal_hz,
                                             model.accelerometer_max_g * units::standard_gravity);
  return product;
}

}  // namespace

extern const Protocol mip_protocol;
constexpr Protocol mip_protocol = {
    .name = "mip",
    .summary = "MicroStrain 3DM-GX5-25 and 3DM-CV7-AHRS: MIP commands, sensor and filter data",
    .link = Link::bytes,
    .document = "mip_sdk e5a847d, src/c/mip/definitions",
    .settings = declared,
    .fields = Measurement::time | Measurement::rate | Measurement::specific_force | Measurement::delta_angle |
              Measurement::delta_velocity | Measurement::temperature | Measurement::status,
    .resolution = {.rate = 0x1p-21, .specific_force = 0x1p-20 * units::standard_gravity, .delta_angle = 0x1p-24,
                   .delta_velocity = 0x1p-24 * units::standard_gravity, .temperature_c = 0x1p-17},
    .range = {.rate = 8, .specific_force = 15.99 * units::standard_gravity, .delta_angle = 1,
              .delta_velocity = 0.99 * units::standard_gravity, .temperature_c = 128},
    .counter_bits = 0,
    .status_bits = 0x3F,
    .has_checksum = true,
    .burst_bits = 8,
    .product = product,
    .trial = "sensor_rate_hz=1000 filter_fields=",
    .make = [](const Settings& settings) -> std::unique_ptr<Device> {
      return std::make_unique<MipDevice>(model_of(settings), configuration(settings));
    },
    .make_decoder = [](const Settings&) -> std::unique_ptr<Decoder> { return std::make_unique<MipDecoder>(); },
};

}  // namespace imud
