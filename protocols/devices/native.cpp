// imud's own frame for byte links: all of a sample, bit for bit, one frame per sample, little-endian, 124 bytes.
//
// | offset | type   | field                                                                     |
// |--------|--------|---------------------------------------------------------------------------|
// | 0      | u8[2]  | sync, "IM"                                                                |
// | 2      | u8     | kind and version of the frame, 1                                          |
// | 3      | u8     | length of the frame, 124                                                  |
// | 4      | u32    | sample counter, its low 32 bits                                           |
// | 8      | i64    | device time, ns                                                           |
// | 16     | f64[3] | rate, rad/s                                                               |
// | 40     | f64[3] | specific force, m/s^2                                                     |
// | 64     | f64[3] | delta-angle, rad                                                          |
// | 88     | f64[3] | delta-velocity, m/s                                                       |
// | 112    | f32    | temperature, degrees Celsius                                              |
// | 116    | u32    | status (core/sample.hpp)                                                  |
// | 120    | u32    | CRC-32C of bytes 0 to 119                                                 |
#include <cmath>

#include "protocols/protocol.hpp"
#include "protocols/wire/crc32c.hpp"
#include "protocols/wire/frame_search.hpp"
#include "protocols/wire/wire.hpp"

namespace imud {
namespace {

using namespace boost::endian;

struct Wire {
  std::uint8_t start[4];
  little_uint32_buf_t counter;
  little_int64_buf_t time_ns;
  little_float64_buf_t rate[3];
  little_float64_buf_t specific_force[3];
  little_float64_buf_t delta_angle[3];
  little_float64_buf_t delta_velocity[3];
  little_float32_buf_t temperature_c;
  little_uint32_buf_t status;
  little_uint32_buf_t crc;
};
static_assert(sizeof(Wire) == 124);

constexpr std::uint8_t start[4] = {'I', 'M', 1, sizeof(Wire)};
constexpr std::size_t crc_offset = offsetof(Wire, crc);

// Writes the checksum of a frame.
void seal(std::span<std::byte> frame) noexcept {
  const little_uint32_buf_t crc{crc32c(frame.first(crc_offset))};
  std::memcpy(frame.data() + crc_offset, &crc, sizeof crc);
}

std::span<std::byte> reseal(std::span<std::byte> frame, const CanHeader&) noexcept {
  if (frame.size() != sizeof(Wire) || std::memcmp(frame.data(), start, sizeof start) != 0) return {};
  seal(frame);
  return frame.subspan(sizeof start, crc_offset - sizeof start);
}

class NativeDevice final : public Device {
 public:
  void sample(const Sample& sample, FrameBuffer& out) noexcept override {
    const std::span<std::byte> room = out.room(sizeof(Wire));
    if (room.empty()) return;
    Wire wire;
    std::memcpy(wire.start, start, sizeof start);
    wire.counter = static_cast<std::uint32_t>(sample.counter);
    wire.time_ns = sample.stamp().ns;
    put_vector(sample.rate, wire.rate);
    put_vector(sample.specific_force, wire.specific_force);
    put_vector(sample.delta_angle, wire.delta_angle);
    put_vector(sample.delta_velocity, wire.delta_velocity);
    wire.temperature_c = to_float(sample.temperature_c);
    wire.status = sample.status;
    write_wire(wire, room);
    seal(room);
    out.push(sizeof(Wire));
  }
};

class NativeDecoder final : public FrameDecoder<sizeof(Wire)> {
 private:
  std::size_t parse(std::span<const std::byte> held, MeasurementSink& sink) override {
    if (std::memcmp(held.data(), start, std::min(held.size(), sizeof start)) != 0) return Search::reject;
    if (held.size() < sizeof(Wire)) return Search::need_more;
    const auto wire = read_wire<Wire>(held);
    if (wire.crc.value() != crc32c(held.first(crc_offset))) {
      ++errors_.checksum;
      return Search::reject;
    }
    Measurement measurement;
    measurement.fields = Measurement::all;
    Sample& sample = measurement.sample;
    sample.counter = wire.counter.value();
    sample.time.ns = wire.time_ns.value();
    sample.rate = get_vector(wire.rate);
    sample.specific_force = get_vector(wire.specific_force);
    sample.delta_angle = get_vector(wire.delta_angle);
    sample.delta_velocity = get_vector(wire.delta_velocity);
    sample.temperature_c = wire.temperature_c.value();
    sample.status = wire.status.value();
    if (!is_finite(sample)) {
      ++errors_.malformed;
    } else {
      sink.on_measurement(measurement);
    }
    return sizeof(Wire);
  }

  static bool is_finite(const Sample& s) {
    return s.rate.allFinite() && s.specific_force.allFinite() && s.delta_angle.allFinite() &&
           s.delta_velocity.allFinite() && std::isfinite(s.temperature_c);
  }
};

}  // namespace

extern constexpr Protocol native_protocol = {
    .name = "native",
    .summary = "imud's own frame for byte links: the whole sample, bit for bit, CRC-32C",
    .link = Link::bytes,
    .document = "protocols/devices/native.cpp, version 1",
    .resolution = {.temperature_c = 0x1p-17},
    .range = {.temperature_c = 128.0},
    .counter_bits = 32,
    .has_checksum = true,
    .burst_bits = 32,
    .make_seal = seal_by<reseal>,
    .has_self_test = true,
    .make = [](const Settings&) -> std::unique_ptr<Device> { return std::make_unique<NativeDevice>(); },
    .make_decoder = [](const Settings&) -> std::unique_ptr<Decoder> { return std::make_unique<NativeDecoder>(); },
};

}  // namespace imud
