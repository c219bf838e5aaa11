// Protocol: what one product says on the wire. A Device speaks it, a Decoder understands it.
#pragma once

#include <cfloat>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/frame.hpp"
#include "core/imu.hpp"
#include "core/sample.hpp"
#include "core/uart.hpp"
#include "protocols/settings.hpp"

namespace imud {

enum class Link : std::uint8_t { bytes, can };  // bytes: serial lines, ptys, UDP, files

// One emulated product: a pure state machine from samples, and bytes of the host, to frames. It knows no clock and no
// port, and allocates nothing after it is made. One thread.
//
// Every call carries the time of the sensor's own clock, which runs from the moment it has power, also while there is
// neither truth nor sample. Times never decrease, except by step_clock(). A device is made with its supply on at time
// 0.
class Device {
 public:
  virtual ~Device() = default;
  // Switches the supply off and on: the product starts up with what it keeps without power. Default: nothing happens,
  // as the device has no state to lose.
  virtual void power_on(DeviceTime now) noexcept;
  // Appends the frames of one sample (none, one or several) to `out`. The time is sample.time.
  virtual void sample(const Sample& sample, FrameBuffer& out) noexcept = 0;
  // Executes what the host sent, in pieces of any length; appends the answers to `replies`. Default: it has no
  // receiver.
  virtual void receive(const Frame& from_host, DeviceTime now, FrameBuffer& replies) noexcept;
  // When poll() is to be called next: a step of the start-up, a time-out, a heartbeat. nullopt: not before another
  // call.
  virtual std::optional<DeviceTime> deadline() const noexcept;
  // Does what is due at `now`, which is deadline() or later; appends what the product sends by itself to `out`.
  // Afterwards deadline() is later than `now`. A deadline at a sample's time is polled before that sample.
  virtual void poll(DeviceTime now, FrameBuffer& out) noexcept;
  // The clock is set: every later time is `by` later than it would have been (negative: earlier). Times that the
  // device keeps move along, so that no duration changes. Default: it keeps none.
  virtual void step_clock(Nanoseconds by) noexcept;
  // How its UART is set; a change holds for what is sent after it. Default: it has none.
  virtual UartSettings uart() const noexcept;

  // A valid edge on its trigger input, or on its pulse-per-second input. `time` is in (last sample, next sample];
  // called in order of time, before the next sample. Default: not connected.
  virtual void trigger(DeviceTime time) noexcept;
  virtual void pps(DeviceTime time) noexcept;
  // The pulse on its output pin (time of validity, data ready) that follows from the last sample. Default: none.
  struct Pulse {
    DeviceTime begin, end;
  };
  virtual std::optional<Pulse> pulse() const noexcept;
};

// A decoded sample. `fields` has the quantities that the protocol carries; all others are zero in `sample`.
struct Measurement {
  enum Field : std::uint32_t {
    time = 1,
    counter = 2,
    rate = 4,
    specific_force = 8,
    delta_angle = 16,
    delta_velocity = 32,
    temperature = 64,
    status = 128,
    all = 255,
  };
  Sample sample;
  std::uint32_t fields = 0;
};

// Receives the decoder's measurements, in order.
class MeasurementSink {
 public:
  virtual void on_measurement(const Measurement& measurement) = 0;

 protected:
  ~MeasurementSink() = default;
};

// Counts of what was not a measurement.
struct DecodeErrors {
  std::uint64_t checksum = 0;       // framed, but the checksum was wrong
  std::uint64_t malformed = 0;      // framed, checksum right or absent, but the content cannot be
  std::uint64_t incomplete = 0;     // sets of several frames with a part missing
  std::uint64_t skipped_bytes = 0;  // bytes that belonged to no good frame
};

// Fed whatever the port gives, in pieces of any length (byte links) or frame by frame (CAN); any bytes are
// harmless. Allocates nothing after it is made.
class Decoder {
 public:
  virtual ~Decoder() = default;
  virtual void feed(const Frame& frame, MeasurementSink& sink) = 0;
  // No more input will come: whatever is still held back is decided.
  virtual void finish(MeasurementSink& sink);
  const DecodeErrors& errors() const noexcept { return errors_; }

 protected:
  DecodeErrors errors_;
};

// One identifier under which a product sends on a CAN bus. A transfer of several frames with the same identifier
// counts each of them.
struct CanMessage {
  CanHeader can;
  std::size_t max_size = 0;     // data bytes of its longest frame
  double max_frames_per_s = 0;  // over a second, at its busiest with these settings
};

// A product as delivered: the values that its configuration may omit.
struct Product {
  double rate_hz = 0;  // at which it samples internally, whatever it sends
  TriadErrors gyro, accelerometer, magnetometer;
  BarometerErrors barometer;
};

struct Protocol;

// A configuration that the conformance test runs.
struct ConformanceSettings {
  // "key=value key=value ...", with which each sample gives a frame at once. The others are as initially.
  std::string_view settings = "";
  // Changes a copy of the entry, where its fields, resolution, range or the like differ with these settings.
  void (*adapt)(Protocol& entry) = nullptr;
};

// Inputs of the host's that the fuzz test starts from. A body is an input without its framing.
struct HostInputs {
  std::string (*frame)(std::string_view body) = nullptr;
  std::span<const std::string_view> bodies = {};  // of every kind
  // Sent one after another, in any state, these bring the device to where it answers the body `last` with bytes that
  // have `answer` among them; after a pause in which what was cut off is forgotten.
  std::span<const std::string_view> revive = {};
  std::string_view last = "", answer = "";
};

// One entry of the table. The conformance test (tests/protocols/conformance_test.cpp) verifies all that an entry
// states here, with each of its conformance settings.
struct Protocol {
  std::string_view name;     // keyword in the configuration: the file's stem with '-' for '_'
  std::string_view summary;  // one line
  Link link;
  std::string_view document;  // the document and revision followed
  std::span<const Setting> settings;

  std::uint32_t fields = Measurement::all;  // what every measurement carries

  // The LSB of each quantity, SI: decode(encode(x)) is within half of it; 0 where bits are kept.
  struct Resolution {
    double time_s = 0, rate = 0, specific_force = 0, delta_angle = 0, delta_velocity = 0, temperature_c = 0;
  } resolution = {};
  // The magnitudes, SI, up to which the resolution holds. Beyond, a value saturates or loses digits: what comes back
  // has its sign and at least this magnitude, less one LSB.
  struct Range {
    double rate = DBL_MAX, specific_force = DBL_MAX, delta_angle = DBL_MAX, delta_velocity = DBL_MAX,
           temperature_c = DBL_MAX;
  } range = {};
  std::int64_t time_period_ns = 0;  // after which the time on the wire overflows; 0: never
  unsigned counter_bits = 64;       // this many low bits of the counter come back
  bool sends_some_samples = false;  // of many that it counts: steps of the counter are some multiple
  std::uint32_t status_bits = ~0U;  // these bits of Sample::status come back; the others mean nothing

  bool has_checksum = false;  // every one-bit error of a frame is refused; false: some are not
  unsigned burst_bits = 0;    // so is every burst of errors up to this long, bits counted from the LSB of each byte

  bool has_sync_pins = false;  // Device's trigger(), pps() and pulse()

  // Link::can, and only there; throw as make. can_messages: every identifier that the product ever sends with these
  // settings, for the bus's load and to find two products that use the same; `rate_hz` is that of its samples.
  // can_filters: the frames that it listens to, none if it only sends.
  std::vector<CanMessage> (*can_messages)(const Settings& settings, double rate_hz) = nullptr;
  std::vector<CanFilter> (*can_filters)(const Settings& settings) = nullptr;

  // nullptr: no product, the configuration says all. Throws as make.
  Product (*product)(const Settings& settings) = nullptr;
  // None: the initial settings alone.
  std::span<const ConformanceSettings> conformance_settings = {};
  // With bodies if, and only if, the device overrides receive().
  HostInputs host_inputs = {};

  // Both throw std::invalid_argument that says what would be right, for settings that exclude one another.
  std::unique_ptr<Device> (*make)(const Settings& settings);
  std::unique_ptr<Decoder> (*make_decoder)(const Settings& settings);
};

// The table, made by the build from the files in protocols/devices, sorted by name.
std::span<const Protocol* const> protocols() noexcept;
// nullptr if there is none of that name.
const Protocol* find_protocol(std::string_view name) noexcept;

}  // namespace imud
