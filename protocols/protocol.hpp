// Protocol: the wire behaviour of one product. A Device emulates the product; a Decoder decodes its frames.
#pragma once

#include <cfloat>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/frame.hpp"
#include "core/imu.hpp"
#include "core/navigation/navigation_requests.hpp"
#include "core/sample.hpp"
#include "core/uart.hpp"
#include "protocols/frame_seal.hpp"
#include "protocols/settings.hpp"

namespace imud {

enum class Link : std::uint8_t { bytes, can };  // bytes: serial lines, ptys, UDP, files

// The figures that a unit itself has for its errors: its maker has measured them, or its filter and receivers
// estimate them. 0: the unit has no such error.
struct OwnFigures {
  Matrix3 g_sensitivity = Matrix3::Zero();  // of the gyros, rad/s/(m/s^2)
  // Standard deviations of the position, m, the velocity, m/s, and the attitude, rad, that the unit reports: about or
  // along north, east, down; not negative.
  Vector3 position = Vector3::Zero(), velocity = Vector3::Zero(), attitude = Vector3::Zero();
};
// Returns the figure, or `otherwise` where it is 0.
inline double figure_or(double figure, double otherwise) noexcept { return figure > 0 ? figure : otherwise; }
inline Vector3 figure_or(const Vector3& figure, const Vector3& otherwise) noexcept {
  return (figure.array() > 0).select(figure, otherwise);
}

// One emulated product: a pure state machine that turns samples, and bytes of the host, into frames. It has no clock
// and no port, and allocates nothing after it is made. One thread.
//
// Every call carries the time of the sensor's own clock. The clock runs whenever the sensor has power, even while
// there is neither truth nor sample. Times never decrease, except by step_clock(). A device is made with its
// supply on at time 0.
class Device {
 public:
  virtual ~Device() = default;
  // Switches the supply off and on: the product starts up with its non-volatile settings. Default: does nothing, for
  // a device without state.
  virtual void power_on(DeviceTime now) noexcept;
  // Appends the frames of one sample (none, one or several) to `out`. The time is sample.time.
  virtual void sample(const Sample& sample, FrameBuffer& out) noexcept = 0;
  // Processes bytes of the host, which come in pieces of any length, or a CAN frame; appends the answers to
  // `replies`, with the UART at which the bytes arrived (Frame::uart). Default: ignores them, for a product that
  // has no receiver.
  virtual void receive(const Frame& from_host, DeviceTime now, FrameBuffer& replies) noexcept;
  // Returns the time at which poll() must be called next (a step of the start-up, a timeout, a heartbeat), or nullopt
  // if nothing is scheduled. Any other call may change it.
  virtual std::optional<DeviceTime> deadline() const noexcept;
  // Performs all actions due up to `now`, which is deadline() or later; appends the frames that the product
  // sends on its own to `out`. Afterwards deadline() is later than `now`. A deadline at a sample's time is
  // polled before that sample.
  virtual void poll(DeviceTime now, FrameBuffer& out) noexcept;
  // Reports that the sensor's clock was stepped by `by` (negative: back). The device shifts all times that it
  // stores, so that no duration changes. Default: does nothing, for a device that stores no times.
  virtual void step_clock(Nanoseconds by) noexcept;
  // Sets the figures that the unit has of its own errors; called once, before all other calls. Default: does nothing,
  // for a product that neither reports such figures nor corrects by them.
  virtual void set_figures(const OwnFigures& figures) noexcept;
  // Returns the settings of the product's UART. A change applies to later frames. Default: a UartSettings{}, for a
  // product whose UART cannot be set.
  virtual UartSettings uart() const noexcept;
  // Returns the product's own figures since it was made, in the order of Protocol::counters. The span stays valid as
  // long as the device. Default: none.
  virtual std::span<const std::uint64_t> counts() const noexcept;
  // Returns the low-pass filters that the product's settings choose. They run at the product's sample rate and
  // follow power_on() and receive(). Boxcars have one stage and at most `longest_boxcar` samples. A device returns
  // nullopt either always or never. Default: nullopt, for a product without filters.
  static constexpr int longest_boxcar = 256;
  virtual std::optional<SensorFilters> filters() const noexcept;
  // Returns what the host has asked of the unit's own navigation filter, if the unit has one. The requests follow
  // power_on() and receive(); power_on() alone does not request a restart of the filter. Default: no requests.
  virtual NavigationRequests navigation_requests() const noexcept;

  // --- The second UART of a product that has two (Protocol::has_second_uart) ---
  // Connects the second UART: from now on the device also makes the frames of that UART, with Frame::uart 1.
  // Default: does nothing.
  virtual void connect_second_uart() noexcept;
  // Returns the settings of the second UART, as uart() does for the first. Default: a UartSettings{}.
  virtual UartSettings second_uart() const noexcept;

  // --- Synchronisation pins (Protocol::has_sync_pins) ---
  // Report a valid edge on the trigger input, or on the pulse-per-second input. Requires `time` in (last sample,
  // next sample], and calls in order of time, before the next sample. Default: do nothing, for a product without
  // these inputs.
  virtual void trigger(DeviceTime time) noexcept;
  virtual void pps(DeviceTime time) noexcept;
  // Returns the pulse on the output pin (time of validity, data ready) that the last sample or poll() causes.
  // Default: none.
  struct Pulse {
    DeviceTime begin, end;
  };
  virtual std::optional<Pulse> pulse() const noexcept;
};

// A decoded sample. `fields` is the set of quantities (bits of Field) that the frame carries; all others are zero in
// `sample`. Of a carried vector, a component that the product does not send is NaN.
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

// Counters of input that yielded no measurement.
struct DecodeErrors {
  std::uint64_t checksum = 0;       // framed, but the checksum was wrong
  std::uint64_t malformed = 0;      // framed, checksum right or absent, but the content is impossible
  std::uint64_t incomplete = 0;     // samples sent as several frames, of which at least one is missing
  std::uint64_t skipped_bytes = 0;  // bytes that belong to no good frame
};

// Decodes a port's input, in pieces of any length (byte links) or frame by frame (CAN); no input is harmful.
// Allocates nothing after it is made. One thread.
class Decoder {
 public:
  virtual ~Decoder() = default;
  virtual void feed(const Frame& frame, MeasurementSink& sink) = 0;
  // Ends the input: an unfinished frame is decoded, or counted in errors().
  virtual void finish(MeasurementSink& sink);
  const DecodeErrors& errors() const noexcept { return errors_; }

 protected:
  DecodeErrors errors_;
};

// A product's own counter beside the counters of every imu, such as conflicts of its address, or
// transfers that timed out.
struct DeviceCounter {
  std::string_view key;           // in the summary's JSON, and in limits: "imu1.KEY"
  std::string_view words;         // follow the number: "3 transfers timed out"
  std::string_view warning = "";  // logged when it is first counted: the meaning and the remedy; empty: nothing
};

// One identifier under which a product sends on a CAN bus. Where a transfer consists of several frames with this
// identifier, each of these frames counts.
struct CanMessage {
  CanHeader can;
  std::size_t max_size = 0;     // data bytes of its longest frame
  double max_frames_per_s = 0;  // averaged over a second, at the highest load that the settings allow
  // The address in the identifier is assigned on the bus during the run. No other node has the assigned address,
  // whatever address `can` holds.
  bool is_assigned = false;
};

// A product as delivered: the values that its configuration may omit.
struct Product {
  double rate_hz = 0;  // its internal sample rate, whatever it sends
  TriadErrors gyro, accelerometer, magnetometer;
  std::optional<TriadErrors> inclinometer;  // nullopt: it has no inclinometers
  BarometerErrors barometer;
};

// The solution that a unit computes from its sensors.
enum class Solves : std::uint8_t {
  nothing,   // the unit is no navigation system, or is not known to be one
  attitude,  // an attitude and heading reference system (AHRS)
  place,     // also velocity and position, with a receiver (INS)
};

// One entry of the table. The conformance test (tests/protocols/conformance_test.cpp) verifies all that an entry
// declares.
struct Protocol {
  std::string_view name;     // keyword in the configuration: the file's stem with '-' for '_'
  std::string_view summary;  // one line
  Link link = Link::bytes;
  std::string_view document;  // the document and revision followed
  std::span<const Setting> settings = {};

  std::uint32_t fields = Measurement::all;  // carried by every measurement

  // The LSB of each quantity, SI: decode(encode(x)) differs from x by half of it at most. 0: not at all.
  struct Resolution {
    double time_s = 0, rate = 0, specific_force = 0, delta_angle = 0, delta_velocity = 0, temperature_c = 0;
  } resolution = {};
  // The magnitudes, SI, up to which the resolution holds. Beyond, a value saturates or loses digits: the decoded
  // value has the same sign and at least this magnitude, less one LSB.
  struct Range {
    double rate = DBL_MAX, specific_force = DBL_MAX, delta_angle = DBL_MAX, delta_velocity = DBL_MAX,
           temperature_c = DBL_MAX;
  } range = {};
  std::int64_t time_period_ns = 0;  // period after which the time on the wire wraps; 0: never
  unsigned counter_bits = 64;       // number of the counter's low bits that the wire carries
  bool sends_some_samples = false;  // the counter counts unsent samples, too, and so advances in steps above 1
  std::uint32_t status_bits = ~0U;  // bits of Sample::status that the wire carries

  bool has_checksum = false;  // every one-bit error of a frame is detected; false: some one-bit errors are not
  // The longest burst of errors that is always detected, in bits; each byte is counted from its LSB.
  unsigned burst_bits = 0;
  // Makes the seal of a unit with these settings; returns nullptr if no frame of that unit has a check. A null
  // pointer here: no frame of any unit has a check. Throws as make does.
  std::unique_ptr<FrameSeal> (*make_seal)(const Settings& settings) = nullptr;

  bool has_sync_pins = false;                    // Device's trigger(), pps() and pulse()
  bool has_second_uart = false;                  // Device's connect_second_uart() and second_uart()
  bool takes_inclinometers = false;              // no product, but it sends Sample::inclination where there is one
  bool has_self_test = false;                    // it reports status::self_test_failed, in its status or by an answer
  std::span<const DeviceCounter> counters = {};  // of Device::counts()

  // Set if, and only if, the link is Link::can; both throw as make does. can_messages: every identifier that the
  // product ever sends with these settings, to compute the bus load and to find two products that use the same
  // identifier; `rate_hz` is the sample rate. can_filters: the frames that the product receives; empty if it only
  // sends.
  std::vector<CanMessage> (*can_messages)(const Settings& settings, double rate_hz) = nullptr;
  std::vector<CanFilter> (*can_filters)(const Settings& settings) = nullptr;
  // Returns, as text for people, the name by which the other nodes of a CAN bus know the unit, beside its
  // identifiers, and the key that changes the name. Two units on one bus must not have the same name. Empty: the unit
  // has none. nullptr: no unit has one. Throws as make does.
  std::string (*bus_name)(const Settings& settings) = nullptr;
  // If a unit with these settings sends no measurements before a host's message, returns the setting with which it
  // sends them, as "KEY = VALUE". Empty: the unit sends them. nullptr: it is not known. Throws as make does.
  std::string_view (*waits_for_host)(const Settings& settings) = nullptr;

  // nullptr: this is no product, and its configuration must be complete. Throws as make does.
  Product (*product)(const Settings& settings) = nullptr;
  // Returns the name of the model (a preset of the emulator, or "white") whose errors a unit with these settings has
  // unless its configuration names another. nullptr: "white", the errors of `product`.
  std::string_view (*preset)(const Settings& settings) = nullptr;

  // Returns the solution that a unit with these settings computes. nullptr: nothing.
  Solves (*solves)(const Settings& settings) = nullptr;

  // Returns the layout of the frames that a unit with these settings sends, as lines for people. Throws as make
  // does. nullptr: the product's document gives the layout.
  std::vector<std::string> (*layout)(const Settings& settings) = nullptr;

  // Throws std::invalid_argument, whose message is "KEY: ", the fault and the remedy, if a unit cannot
  // work as these settings and this sample rate ask. nullptr: it always can. This checks a
  // configuration, not a device.
  void (*check)(const Settings& settings, double rate_hz) = nullptr;

  // Every entry of the table has both. They throw std::invalid_argument if the settings exclude one another; the
  // message gives the remedy. They have no default, so that an entry that omits one does not compile.
  std::unique_ptr<Device> (*make)(const Settings& settings);
  std::unique_ptr<Decoder> (*make_decoder)(const Settings& settings);
};

// Returns the seal of a unit with these settings; nullptr if no frame of the unit has a check. Throws as make
// does.
std::unique_ptr<FrameSeal> make_seal(const Protocol& protocol, const Settings& settings);

// The table, made by the build from the files in protocols/devices, sorted by name.
std::span<const Protocol* const> protocols() noexcept;
// Returns nullptr if no protocol has that name.
const Protocol* find_protocol(std::string_view name) noexcept;

}  // namespace imud
