#include "emulator/config/line_load.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "core/attitude.hpp"
#include "protocols/frames/frame_device.hpp"
#include "protocols/measurements/measured_quantities.hpp"
#include "protocols/protocol.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

void add(std::vector<SentFrames>& all, const Frame& frame, double per_s) {
  const auto same = std::ranges::find_if(
      all, [&](const SentFrames& sent) { return sent.can == frame.can && sent.bytes == frame.bytes.size(); });
  if (same != all.end())
    same->per_s += per_s;
  else
    all.push_back({frame.can, frame.bytes.size(), per_s});
}

// Calls `take` with the frames that a product makes of typical samples from 1 s after power on until `end`, because
// the first second contains the start-up.
template <class Take>
void make_typical(const ImuConfig& imu, std::uint8_t uart, Nanoseconds end, Take take,
                  std::int32_t stamp_error_ns = 0) {
  constexpr Nanoseconds begin = std::chrono::seconds(1);
  const std::unique_ptr<Device> device = imu.protocol->make(imu.settings);
  if (uart != 0) device->connect_second_uart();
  const auto frames = std::make_unique<FrameBuffer>();
  const Grid grid(imu.rate_hz);
  Sample sample = typical_sample();
  sample.stamp_error_ns = stamp_error_ns;
  for (std::uint64_t k = 0; grid.nominal_offset(k) < end; ++k) {
    const auto count = [&] {
      if (grid.nominal_offset(k) >= begin)
        for (const Frame& frame : frames->frames())
          if (frame.uart == uart) take(frame);
      frames->clear();
    };
    sample.time = DeviceTime{} + grid.nominal_offset(k);
    sample.counter = k;
    for (auto deadline = device->deadline(); deadline && *deadline <= sample.time; deadline = device->deadline()) {
      device->poll(*deadline, *frames);
      count();
    }
    device->sample(sample, *frames);
    count();
  }
}

// Counts the frames of one second, or of ten samples if ten samples take longer.
std::vector<SentFrames> sent_by_product(const ImuConfig& imu, std::uint8_t uart) {
  std::vector<SentFrames> all;
  const auto counted = std::chrono::seconds(std::max<std::int64_t>(1, std::llround(10 / imu.rate_hz)));
  const double per_s = 1 / seconds(counted);
  make_typical(imu, uart, std::chrono::seconds(1) + counted, [&](const Frame& frame) { add(all, frame, per_s); });
  return all;
}

// The number of frames of one identifier, and the sums of their own bits and seconds on the wire.
struct Typical {
  CanHeader can;
  double frames = 0, bits = 0, seconds = 0;
};

// Returns the sums for each identifier that the device sends in 100 periods of typical samples, but in no less than
// 0.1 s and no more than 1 s.
std::vector<Typical> typical_frames(const Transport& transport, const PortSpec& spec, const ImuConfig& imu) {
  std::vector<Typical> all;
  const Nanoseconds end = std::chrono::seconds(1) + nanoseconds(std::max(0.1, std::min(1.0, 100 / imu.rate_hz)));
  make_typical(imu, 0, end, [&](const Frame& frame) {
    auto same = std::ranges::find_if(all, [&](const Typical& t) { return t.can == frame.can; });
    if (same == all.end()) same = all.insert(all.end(), Typical{.can = frame.can});
    const WireTime time = transport.wire_time(spec, imu.port_settings, frame);
    same->frames += 1;
    same->bits += time.own_bits;
    same->seconds += time.own_seconds;
  });
  return all;
}

// Counts the frames of the second sample; the first sample may have more frames, such as a header row.
std::vector<SentFrames> sent_by_sample(const ImuConfig& imu) {
  const auto frames = std::make_unique<FrameBuffer>();
  const std::unique_ptr<Device> device = imu.protocol->make(imu.settings);
  Sample sample = typical_sample();
  if (imu.model.inclinometer) sample.inclination = sample.specific_force;
  device->sample(sample, *frames);
  frames->clear();
  device->sample(sample, *frames);
  std::vector<SentFrames> all;
  for (const Frame& frame : frames->frames()) add(all, frame, imu.rate_hz);
  return all;
}

// Returns a typical sample whose place is known. Each number that depends on the place differs from its value in a
// sample without a place.
Sample sample_at_place() {
  Sample sample = typical_sample();
  sample.q_LP = exp(Vector3(0.3, -0.4, 0.5));
  sample.navigation = {.is_known = true,
                       .gps_ns = 1'420'000'000'123'456'789,
                       .latitude = 0.8,
                       .longitude = 0.1,
                       .height = 500,
                       .r_E = {4e6, 5e5, 5e6},
                       .v_L = {3, -4, 12},
                       .antennas = {.direction_L = {0.6, 0.8, 0}, .sigma = 0.01}};
  sample.magnetic_field = {2e-5, 1e-5, 4e-5};
  sample.pressure = 9e4;
  return sample;
}

// Returns true if an answer or any message of the description, whenever it is sent, may have such a number.
bool carries_place(const FrameDescription& description) {
  if (FrameRequests(description).needs_samples()) return true;
  const Sample without = typical_sample(), at_place = sample_at_place();
  return std::ranges::any_of(frame_messages(description), [&](const FrameMessage& message) {
    return std::ranges::any_of(message.layout->fields(), [&](const std::string& field) {
      const auto found = find_measured(field);
      return found && found->quantity->get != nullptr &&
             found->quantity->get({without}) != found->quantity->get({at_place});
    });
  });
}

}  // namespace

Sample typical_sample() {
  Sample sample;
  sample.time = DeviceTime{1'234'567'891'234};
  sample.counter = 1'234'567;
  sample.rate = {0.0123456789012345, -0.123456789012345, 1.23456789012345};
  sample.specific_force = {0.123456789012345, -1.23456789012345, -9.80665012345678};
  sample.delta_angle = 1e-3 * sample.rate;
  sample.delta_velocity = 1e-3 * sample.specific_force;
  return sample;
}

bool carries_place(const ImuConfig& imu) {
  // A host, or the settings, may choose the messages.
  if (imu.protocol == nullptr || imu.protocol->product != nullptr || imu.protocol->fields != Measurement::all)
    return true;
  if (imu.settings.frames() != nullptr) return carries_place(*imu.settings.frames());
  const auto bytes_of = [&](Sample sample) {
    const auto frames = std::make_unique<FrameBuffer>();
    imu.protocol->make(imu.settings)->sample(sample, *frames);
    std::vector<std::byte> bytes;
    for (const Frame& frame : frames->frames()) bytes.insert(bytes.end(), frame.bytes.begin(), frame.bytes.end());
    return bytes;
  };
  const std::vector<std::byte> bytes = bytes_of(typical_sample());
  return bytes.empty() || bytes != bytes_of(sample_at_place());
}

// Nothing is known of other formats: an interchange format carries everything, whether the user wants it or not.
bool needs_place(const ImuConfig& imu) {
  if (imu.settings.frames() != nullptr) return carries_place(*imu.settings.frames());
  if (imu.protocol->solves != nullptr && imu.protocol->solves(imu.settings) != Solves::nothing) return true;
  return imu.protocol->product != nullptr && imu.protocol->product(imu.settings).magnetometer.max < TriadErrors{}.max;
}

bool carries_status(const ImuConfig& imu, std::uint32_t bits) {
  struct Sink final : MeasurementSink {
    void on_measurement(const Measurement& measurement) override {
      if ((measurement.fields & Measurement::status) != 0) seen |= measurement.sample.status;
    }
    std::uint32_t seen = 0;
  } sink;
  if (imu.protocol->product != nullptr) return (imu.protocol->status_bits & bits) == bits;
  Sample sample = typical_sample();
  sample.status = bits;
  const auto frames = std::make_unique<FrameBuffer>();
  imu.protocol->make(imu.settings)->sample(sample, *frames);
  const std::unique_ptr<Decoder> decoder = imu.protocol->make_decoder(imu.settings);
  for (const Frame& frame : frames->frames()) decoder->feed(frame, sink);
  decoder->finish(sink);
  return (sink.seen & bits) == bits;
}

bool carries_stamp(const ImuConfig& imu) {
  // A product whose host sets its time may have no time in typical samples.
  if (imu.protocol->product != nullptr && imu.protocol->resolution.time_s > 0) return true;
  const auto bytes_of = [&](std::int32_t stamp_error_ns) {
    std::vector<std::byte> bytes;
    const auto append = [&](const Frame& frame) {
      bytes.insert(bytes.end(), frame.bytes.begin(), frame.bytes.end());
    };
    const std::uint8_t uarts = imu.protocol->has_second_uart ? 2 : 1;
    for (std::uint8_t uart = 0; uart < uarts; ++uart)
      make_typical(imu, uart, std::chrono::seconds(2) + nanoseconds(2 / imu.rate_hz), append, stamp_error_ns);
    return bytes;
  };
  constexpr std::int32_t second = 1'000'000'000;  // many LSB of any field
  return bytes_of(second) != bytes_of(0);
}

std::set<std::uint32_t> fixed_identifiers(const ImuConfig& imu) {
  std::set<std::uint32_t> identifiers;
  if (imu.protocol->link != Link::can) return identifiers;
  for (const CanMessage& sent : imu.protocol->can_messages(imu.settings, imu.rate_hz))
    if (!sent.is_assigned) identifiers.insert(sent.can.id | (sent.can.extended ? 1U << 31U : 0U));
  return identifiers;
}

std::vector<SentFrames> sent_frames(const ImuConfig& imu, std::uint8_t uart) {
  if (imu.protocol->link == Link::can) {
    std::vector<SentFrames> all;
    for (const CanMessage& message : imu.protocol->can_messages(imu.settings, imu.rate_hz))
      all.push_back({message.can, message.max_size, message.max_frames_per_s});
    return all;
  }
  const bool varies = imu.protocol->product != nullptr || imu.protocol->sends_some_samples;
  return varies ? sent_by_product(imu, uart) : sent_by_sample(imu);
}

namespace {

// `spec`: the spec of the port, or a spec with the bit rate of the port's bus.
LineLoad load_on(const PortSpec& spec, const ImuConfig& imu, std::uint8_t uart) {
  const PortSettings& settings = uart == 0 ? imu.port_settings : imu.second_port_settings;
  const Transport& transport = *find_transport(spec.scheme);
  const std::vector<std::byte> data(FrameBuffer::max_bytes);
  LineLoad load;
  double frames_per_sample = 0, bytes_per_sample = 0, busy = 0, average_busy = 0;
  const bool is_can = imu.protocol->link == Link::can && transport.wire_time != nullptr;
  const std::vector<Typical> typical = is_can ? typical_frames(transport, spec, imu) : std::vector<Typical>();
  for (const SentFrames& sent : sent_frames(imu, uart)) {
    const Frame frame{std::span(data).first(sent.bytes), sent.can};
    WireTime time;
    if (transport.wire_time != nullptr)
      time = transport.wire_time(spec, settings, frame);
    else
      time.bits = time.average_bits = 8.0 * static_cast<double>(sent.bytes);
    for (const Typical& frames : typical)
      if (frames.can == sent.can) {
        time.average_bits = frames.bits / frames.frames;
        time.average_seconds = frames.seconds / frames.frames;
      }
    load.frames_per_s += sent.per_s;
    load.bits_per_s += time.bits * sent.per_s;
    load.average_bits_per_s += time.average_bits * sent.per_s;
    load.line_bits_per_s = time.bit_rate;
    busy += time.seconds * sent.per_s;
    average_busy += time.average_seconds * sent.per_s;
    frames_per_sample += sent.per_s / imu.rate_hz;
    bytes_per_sample += static_cast<double>(sent.bytes) * sent.per_s / imu.rate_hz;
  }
  load.percent = 100.0 * busy;
  load.average_percent = 100.0 * average_busy;
  if (imu.protocol->product == nullptr) {
    load.frames_per_sample = static_cast<std::size_t>(std::lround(frames_per_sample));
    load.bytes_per_sample = static_cast<std::size_t>(std::lround(bytes_per_sample));
  }
  return load;
}

}  // namespace

LineLoad line_load(const ImuConfig& imu, std::uint8_t uart) {
  return load_on(PortSpec::parse(uart == 0 ? imu.port : imu.second_port), imu, uart);
}

std::vector<BusLoad> bus_loads(std::span<const ImuConfig> imus) {
  std::vector<BusLoad> buses;
  std::vector<PortSpec> specs;  // of each bus, with its bit rate
  const auto load_of = [](const PortSpec& spec, const ImuConfig& imu) { return load_on(spec, imu, 0); };
  const auto bus_of = [&](const std::string& address) {
    return std::ranges::find_if(buses, [&](const BusLoad& bus) { return bus.address == address; });
  };
  for (std::size_t i = 0; i < imus.size(); ++i) {
    const Transport* transport = transport_of(imus[i].port);
    if (!transport->is_shared || !transport->carries_can) continue;
    const PortSpec spec = PortSpec::parse(imus[i].port);
    const std::string address = fmt::format("{}:{}", spec.scheme, spec.address);
    auto bus = bus_of(address);
    if (bus == buses.end()) {
      bus = buses.insert(buses.end(), BusLoad{.address = address, .imus = {}});
      specs.push_back(spec);
    }
    PortSpec& of_bus = specs[static_cast<std::size_t>(bus - buses.begin())];
    if (load_of(of_bus, imus[i]).line_bits_per_s == 0) of_bus = spec;
    bus->imus.push_back(i);
  }
  for (std::size_t b = 0; b < buses.size(); ++b)
    for (const std::size_t i : buses[b].imus) {
      const LineLoad load = load_of(specs[b], imus[i]);
      buses[b].line_bits_per_s = load.line_bits_per_s;
      buses[b].percent += load.percent;
      buses[b].average_percent += load.average_percent;
    }
  std::erase_if(buses, [](const BusLoad& bus) { return bus.line_bits_per_s == 0; });
  return buses;
}

}  // namespace imud
