#include "emulator/line_load.hpp"

#include <fmt/format.h>

#include <memory>

#include "protocols/protocol.hpp"
#include "transports/port_spec.hpp"

namespace imud {

Sample ordinary_sample() {
  Sample sample;
  sample.time = DeviceTime{1'234'567'891'234};
  sample.counter = 1'234'567;
  sample.rate = {0.0123456789012345, -0.123456789012345, 1.23456789012345};
  sample.specific_force = {0.123456789012345, -1.23456789012345, -9.80665012345678};
  sample.delta_angle = 1e-3 * sample.rate;
  sample.delta_velocity = 1e-3 * sample.specific_force;
  return sample;
}

namespace {

// The frames of one sample in the middle of a stream (a first one may carry more, such as a header row).
std::unique_ptr<FrameBuffer> one_sample(const ImuConfig& imu) {
  auto frames = std::make_unique<FrameBuffer>();
  const std::unique_ptr<Device> device = imu.protocol->make(imu.settings);
  const Sample sample = ordinary_sample();
  device->sample(sample, *frames);
  frames->clear();
  device->sample(sample, *frames);
  return frames;
}

}  // namespace

std::vector<CanHeader> can_headers(const ImuConfig& imu) {
  const auto buffer = one_sample(imu);
  std::vector<CanHeader> headers;
  for (const Frame& frame : buffer->frames()) headers.push_back(frame.can);
  return headers;
}

// Classic: 47 (11-bit identifier) or 67 (29-bit) bits and the data with interframe space; a stuff bit after at worst
// every fourth of the 34 or 54 bits and the data from start of frame to CRC (ISO 11898-1; Tindell's bound). FD: the
// same rule over what is sent before the CRC; the CRC field with its fixed stuff bits is sent at the data rate.
CanBits can_bits(const CanHeader& header, std::size_t bytes) {
  const auto n = static_cast<double>(bytes);
  const double id = header.extended ? 20.0 : 0.0;
  if (!header.fd) {
    const double stuffed = 34.0 + id + 8.0 * n;
    return {47.0 + id + 8.0 * n + static_cast<double>(static_cast<int>((stuffed - 1.0) / 4.0)), 0.0};
  }
  const double arbitration = 17.0 + id;                                  // start of frame to bit rate switch
  const double tail = 12.0;                                              // CRC delimiter to interframe space
  const double data = 5.0 + 8.0 * n;                                     // error state, length, data
  const double crc = bytes <= 16 ? 17.0 + 4.0 + 6.0 : 21.0 + 4.0 + 7.0;  // with stuff count and fixed stuff bits
  CanBits bits{arbitration * 1.25 + tail, data * 1.25 + crc};
  if (!header.bit_rate_switch) bits = {bits.nominal + bits.data, 0.0};
  return bits;
}

namespace {

// A product sends less often than it samples: what it sends in its second second.
LineLoad product_load(const ImuConfig& imu) {
  const std::unique_ptr<Device> device = imu.protocol->make(imu.settings);
  const auto frames = std::make_unique<FrameBuffer>();
  const Grid grid(imu.rate_hz);
  Sample sample = ordinary_sample();
  LineLoad load;
  std::size_t bytes = 0;
  for (std::uint64_t k = 0; grid.nominal_offset(k) < std::chrono::seconds(2); ++k) {
    sample.time = DeviceTime{} + grid.nominal_offset(k);
    sample.counter = k;
    frames->clear();
    device->sample(sample, *frames);
    if (grid.nominal_offset(k) < std::chrono::seconds(1)) continue;
    for (const Frame& frame : frames->frames()) bytes += frame.bytes.size();
    load.frames_per_s += static_cast<double>(frames->frames().size());
  }
  const UartSettings line = device->uart();
  load.bits_per_s = static_cast<double>(bytes) * line.bits_per_character();
  load.line_bits_per_s = line.baud;
  if (line.baud != 0) load.percent = 100.0 * load.bits_per_s / line.baud;
  return load;
}

}  // namespace

LineLoad line_load(const ImuConfig& imu) {
  if (imu.protocol->product != nullptr) return product_load(imu);
  const PortSpec spec = PortSpec::parse(imu.port);
  const auto buffer = one_sample(imu);
  LineLoad load;
  load.frames_per_sample = buffer->frames().size();
  double seconds_per_sample = 0.0;
  constexpr std::int64_t any = 1'000'000'000;
  if (spec.scheme == "can") {
    const auto nominal = static_cast<double>(spec.integer("bitrate", 1, any).value_or(0));
    const auto data =
        static_cast<double>(spec.integer("data_bitrate", 1, any).value_or(static_cast<std::int64_t>(nominal)));
    for (const Frame& frame : buffer->frames()) {
      const CanBits bits = can_bits(frame.can, frame.bytes.size());
      load.bytes_per_sample += frame.bytes.size();
      load.bits_per_s += (bits.nominal + bits.data) * imu.rate_hz;
      if (nominal > 0.0) seconds_per_sample += bits.nominal / nominal + bits.data / data;
    }
    load.line_bits_per_s = nominal;
  } else {
    for (const Frame& frame : buffer->frames()) load.bytes_per_sample += frame.bytes.size();
    const double bits_per_byte = 1.0 + static_cast<double>(spec.integer("bits", 5, 8).value_or(8)) +
                                 (spec.text("parity").value_or("none") == "none" ? 0.0 : 1.0) +
                                 static_cast<double>(spec.integer("stop", 1, 2).value_or(1));
    const std::int64_t unset = spec.scheme == "serial" ? 115'200 : 0;
    load.line_bits_per_s = static_cast<double>(spec.integer("baud", 1, any).value_or(unset));
    load.bits_per_s = static_cast<double>(load.bytes_per_sample) * bits_per_byte * imu.rate_hz;
    if (load.line_bits_per_s > 0.0) seconds_per_sample = load.bits_per_s / imu.rate_hz / load.line_bits_per_s;
  }
  load.percent = 100.0 * seconds_per_sample * imu.rate_hz;
  return load;
}

std::string LineLoad::text() const {
  std::string line = frames_per_s > 0
                         ? fmt::format("{:.0f} frames/s, {:.0f} bit/s", frames_per_s, bits_per_s)
                         : fmt::format("{} frame{} of {} bytes together per sample, {:.0f} bit/s", frames_per_sample,
                                       frames_per_sample == 1 ? "" : "s", bytes_per_sample, bits_per_s);
  if (line_bits_per_s > 0.0) line += fmt::format(", {:.1f} % of the line's {:.0f} bit/s", percent, line_bits_per_s);
  return line;
}

}  // namespace imud
