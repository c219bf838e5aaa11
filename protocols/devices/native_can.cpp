// imud's own frames for CAN: classic, seven frames of 8 bytes per sample, or FD, one of 64. All little-endian.
// native_can.dbc and native_can_fd.dbc beside this file describe the same layouts for CAN tools.
//
// Classic: identifiers `can_id` + 0 to + 6, sent in this order. All seven frames carry the sample's counter, so that
// a decoder never mixes two samples.
//
// | frame  | bits    | type | field                                                       |
// |--------|---------|------|-------------------------------------------------------------|
// | 0      | 0..7    | u8   | sample counter, its low 8 bits                              |
// |        | 8..39   | u32  | device time, us; wraps after 71.6 min                       |
// |        | 40..55  | i16  | temperature, LSB 1/256 degree Celsius                       |
// |        | 56..63  | u8   | status, its low 8 bits (core/sample.hpp)                    |
// | 1 to 6 | 0..27   | i28  | first value                                                 |
// |        | 28..55  | i28  | second value                                                |
// |        | 56..63  | u8   | sample counter                                              |
//
// | frame | first value      | second value     |   | quantity       | LSB              | range     |
// |-------|------------------|------------------|   |----------------|------------------|-----------|
// | 1     | rate x           | rate y           |   | rate           | 2^-22 rad/s      | +-32      |
// | 2     | rate z           | specific force x |   | specific force | 2^-17 m/s^2      | +-1024    |
// | 3     | specific force y | specific force z |   | delta-angle    | 2^-27 rad        | +-1       |
// | 4     | delta-angle x    | delta-angle y    |   | delta-velocity | 2^-20 m/s        | +-128     |
// | 5     | delta-angle z    | delta-velocity x |
// | 6     | delta-velocity y | delta-velocity z |   Rounded to nearest, clamped at the ends of the range.
//
// FD: identifier `can_id`, with a switched bit rate; struct FdWire has the layout.
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>

#include "protocols/protocol.hpp"
#include "protocols/wire/wire.hpp"

namespace imud {
namespace {

using namespace boost::endian;

constexpr std::uint32_t head_frame = 0;
constexpr std::uint32_t classic_frames = 7;
constexpr std::size_t classic_size = 8;
constexpr int value_bits = 28;
constexpr double value_limit = 0x1p27;
constexpr double rate_lsb = 0x1p-22;
constexpr double specific_force_lsb = 0x1p-17;
constexpr double delta_angle_lsb = 0x1p-27;
constexpr double delta_velocity_lsb = 0x1p-20;
constexpr double temperature_lsb = 0x1p-8;

// A vector of the sample, sent as three integers in units of `lsb` (SI). `quantities` has the order of the wire.
struct Quantity {
  Vector3 Sample::*vector;
  double lsb;
};
constexpr Quantity quantities[4] = {{&Sample::rate, rate_lsb},
                                    {&Sample::specific_force, specific_force_lsb},
                                    {&Sample::delta_angle, delta_angle_lsb},
                                    {&Sample::delta_velocity, delta_velocity_lsb}};

struct HeadWire {
  std::uint8_t counter;
  little_uint32_buf_t time_us;
  little_int16_buf_t temperature;
  std::uint8_t status;
};
static_assert(sizeof(HeadWire) == classic_size);

struct FdWire {
  little_int64_buf_t time_ns;
  little_uint32_buf_t counter;
  little_int16_buf_t temperature;  // LSB 1/256 degree Celsius
  little_uint16_buf_t status;
  little_float32_buf_t rate[3];            // rad/s
  little_float32_buf_t specific_force[3];  // m/s^2
  little_float32_buf_t delta_angle[3];     // rad
  little_float32_buf_t delta_velocity[3];  // m/s
};
static_assert(sizeof(FdWire) == 64);

std::int64_t quantise(double value, double lsb, double limit) noexcept {
  return std::llrint(std::clamp(value / lsb, -limit, limit - 1.0));
}

std::int16_t wire_temperature(double temperature_c) noexcept {
  return static_cast<std::int16_t>(quantise(temperature_c, temperature_lsb, 0x1p15));
}

std::int64_t microseconds(DeviceTime time) noexcept {
  const std::int64_t remainder = time.ns % 1000;
  return time.ns / 1000 + (remainder >= 500 ? 1 : remainder < -500 ? -1 : 0);
}

// Packs two values, with the counter in the bits above the values.
std::uint64_t pack(std::int64_t first, std::int64_t second, std::uint8_t counter) noexcept {
  constexpr std::uint64_t mask = (std::uint64_t{1} << value_bits) - 1;
  return (static_cast<std::uint64_t>(first) & mask) | (static_cast<std::uint64_t>(second) & mask) << value_bits |
         std::uint64_t{counter} << (2 * value_bits);
}

// Returns value `index` (0, 1) of a packed frame.
std::int64_t unpack(std::uint64_t frame, int index) noexcept {
  return static_cast<std::int64_t>(frame << (64 - value_bits * (index + 1))) >> (64 - value_bits);
}

// The identifiers of the frames. Throws std::invalid_argument if an identifier exceeds the range.
struct Identifiers {
  explicit Identifiers(const Settings& settings)
      : id(static_cast<std::uint32_t>(settings.integer("can_id"))),
        extended(settings.flag("extended")),
        fd(settings.flag("fd")) {
    const std::uint32_t highest = (extended ? 0x1FFF'FFFFU : 0x7FFU) - (fd ? 0 : classic_frames - 1);
    if (id > highest)
      throw std::invalid_argument("can_id: must be at most " + std::to_string(highest) +
                                  (extended ? "" : "; with extended = true it may be higher"));
  }

  CanHeader header(std::uint32_t frame) const noexcept {
    return {.id = id + frame, .extended = extended, .fd = fd, .bit_rate_switch = fd};
  }

  std::uint32_t id;
  bool extended;
  bool fd;
};

class NativeCanDevice final : public Device {
 public:
  explicit NativeCanDevice(const Settings& settings) : identifiers_(settings) {}

  void sample(const Sample& sample, FrameBuffer& out) noexcept override {
    if (identifiers_.fd) {
      sample_fd(sample, out);
    } else {
      sample_classic(sample, out);
    }
  }

 private:
  template <WireLayout T>
  void push(const T& wire, std::uint32_t frame, FrameBuffer& out) const noexcept {
    const std::span<std::byte> room = out.room(sizeof(T));
    if (room.empty()) return;
    write_wire(wire, room);
    out.push(sizeof(T), identifiers_.header(frame));
  }

  void sample_classic(const Sample& sample, FrameBuffer& out) const noexcept {
    const auto counter = static_cast<std::uint8_t>(sample.counter);
    HeadWire head;
    head.counter = counter;
    head.time_us = static_cast<std::uint32_t>(microseconds(sample.stamp()));
    head.temperature = wire_temperature(sample.temperature_c);
    head.status = static_cast<std::uint8_t>(sample.status);
    push(head, head_frame, out);
    for (std::uint32_t frame = 1; frame < classic_frames; ++frame) {
      std::int64_t values[2];
      for (std::uint32_t i = 0; i < 2; ++i) {
        const std::uint32_t n = 2 * (frame - 1) + i;
        const Quantity& quantity = quantities[n / 3];
        values[i] = quantise((sample.*quantity.vector)[n % 3], quantity.lsb, value_limit);
      }
      push(little_uint64_buf_t{pack(values[0], values[1], counter)}, frame, out);
    }
  }

  void sample_fd(const Sample& sample, FrameBuffer& out) const noexcept {
    FdWire wire;
    wire.time_ns = sample.stamp().ns;
    wire.counter = static_cast<std::uint32_t>(sample.counter);
    wire.temperature = wire_temperature(sample.temperature_c);
    wire.status = static_cast<std::uint16_t>(sample.status);
    put_vector(sample.rate, wire.rate);
    put_vector(sample.specific_force, wire.specific_force);
    put_vector(sample.delta_angle, wire.delta_angle);
    put_vector(sample.delta_velocity, wire.delta_velocity);
    push(wire, head_frame, out);
  }

  Identifiers identifiers_;
};

// Decodes classic and FD frames, whatever the setting `fd`.
class NativeCanDecoder final : public Decoder {
 public:
  explicit NativeCanDecoder(const Settings& settings) : identifiers_(settings) {}

  void feed(const Frame& frame, MeasurementSink& sink) override {
    const CanHeader& can = frame.can;
    if (can.remote || can.error || can.extended != identifiers_.extended || can.id < identifiers_.id) return;
    const std::uint32_t index = can.id - identifiers_.id;
    if (can.fd ? index != head_frame : index >= classic_frames) return;
    if (frame.bytes.size() != (can.fd ? sizeof(FdWire) : classic_size)) {
      ++errors_.malformed;
    } else if (can.fd) {
      decode_fd(frame.bytes, sink);
    } else if (index == head_frame) {
      decode_head(frame.bytes);
    } else {
      decode_values(index, frame.bytes, sink);
    }
  }

  void finish(MeasurementSink&) override { abandon(); }

 private:
  // Drops an unfinished set, if there is one, and counts it as incomplete.
  void abandon() noexcept {
    if (next_ == head_frame) return;
    ++errors_.incomplete;
    next_ = head_frame;
    refused_ = static_cast<std::uint8_t>(set_.sample.counter);
  }

  void decode_head(std::span<const std::byte> bytes) noexcept {
    abandon();
    const auto wire = read_wire<HeadWire>(bytes);
    // Unwraps the time: takes the time with these low 32 bits that is nearest to the previous time. The first time is
    // taken unchanged.
    const std::uint32_t low = wire.time_us.value();
    const auto step = static_cast<std::int32_t>(low - static_cast<std::uint32_t>(time_us_.value_or(low)));
    time_us_ = time_us_.value_or(low) + static_cast<std::uint64_t>(std::int64_t{step});
    set_ = {};
    set_.fields = Measurement::all;
    set_.sample.counter = wire.counter;
    set_.sample.time.ns = static_cast<std::int64_t>(*time_us_ * 1000);
    set_.sample.temperature_c = wire.temperature.value() * temperature_lsb;
    set_.sample.status = wire.status;
    next_ = 1;
    refused_.reset();
  }

  void decode_values(std::uint32_t index, std::span<const std::byte> bytes, MeasurementSink& sink) {
    const std::uint64_t frame = read_wire<little_uint64_buf_t>(bytes).value();
    const auto counter = static_cast<std::uint8_t>(frame >> (2 * value_bits));
    if (index != next_ || counter != set_.sample.counter) {
      abandon();
      if (refused_ != counter) ++errors_.incomplete;  // a set whose first frame is missing
      refused_ = counter;
      return;
    }
    for (std::uint32_t i = 0; i < 2; ++i) {
      const std::uint32_t n = 2 * (index - 1) + i;
      const Quantity& quantity = quantities[n / 3];
      (set_.sample.*quantity.vector)[n % 3] = static_cast<double>(unpack(frame, static_cast<int>(i))) * quantity.lsb;
    }
    next_ = (index + 1) % classic_frames;
    if (next_ == head_frame) sink.on_measurement(set_);
  }

  void decode_fd(std::span<const std::byte> bytes, MeasurementSink& sink) {
    const auto wire = read_wire<FdWire>(bytes);
    Measurement measurement;
    measurement.fields = Measurement::all;
    Sample& sample = measurement.sample;
    sample.time.ns = wire.time_ns.value();
    sample.counter = wire.counter.value();
    sample.temperature_c = wire.temperature.value() * temperature_lsb;
    sample.status = wire.status.value();
    sample.rate = get_vector(wire.rate);
    sample.specific_force = get_vector(wire.specific_force);
    sample.delta_angle = get_vector(wire.delta_angle);
    sample.delta_velocity = get_vector(wire.delta_velocity);
    for (const Quantity& quantity : quantities) {
      if ((sample.*quantity.vector).allFinite()) continue;
      ++errors_.malformed;
      return;
    }
    sink.on_measurement(measurement);
  }

  Identifiers identifiers_;
  Measurement set_;
  std::uint32_t next_ = head_frame;       // the next frame of the set; head_frame: no set has begun
  std::optional<std::uint8_t> refused_;   // the counter of the set last refused, so that it is counted once
  std::optional<std::uint64_t> time_us_;  // unwrapped, modulo 2^64
};

std::vector<CanMessage> can_messages(const Settings& settings, double rate_hz) {
  const Identifiers identifiers(settings);
  std::vector<CanMessage> messages;
  for (std::uint32_t frame = 0; frame < (identifiers.fd ? 1 : classic_frames); ++frame)
    messages.push_back({identifiers.header(frame), identifiers.fd ? sizeof(FdWire) : classic_size, rate_hz});
  return messages;
}

constexpr Setting settings[] = {
    integer_setting("can_id", "identifier of the first frame; the others follow it", 0x100, 0, 0x1FFF'FFFF),
    flag_setting("extended", "29-bit identifiers", false),
    flag_setting("fd", "one CAN FD frame of 64 bytes per sample, in float32, in place of seven", false),
};

}  // namespace

extern constexpr Protocol native_can_protocol = {
    .name = "native-can",
    .summary = "imud's own frames for CAN: seven classic frames per sample, or one FD frame",
    .link = Link::can,
    .document = "protocols/devices/native_can.cpp and .dbc, version 1",
    .settings = settings,
    .resolution = {.time_s = 1e-6,
                   .rate = rate_lsb,
                   .specific_force = specific_force_lsb,
                   .delta_angle = delta_angle_lsb,
                   .delta_velocity = delta_velocity_lsb,
                   .temperature_c = temperature_lsb},
    .range = {.rate = (value_limit - 1.0) * rate_lsb,
              .specific_force = (value_limit - 1.0) * specific_force_lsb,
              .delta_angle = (value_limit - 1.0) * delta_angle_lsb,
              .delta_velocity = (value_limit - 1.0) * delta_velocity_lsb,
              .temperature_c = 0x1p7 - temperature_lsb},
    .time_period_ns = (std::int64_t{1} << 32) * 1000,
    .counter_bits = 8,
    .status_bits = 0xFF,
    .can_messages = can_messages,
    .can_filters = [](const Settings&) { return std::vector<CanFilter>{}; },
    .make = make_as<Device, NativeCanDevice>,
    .make_decoder = make_as<Decoder, NativeCanDecoder>,
};

}  // namespace imud
