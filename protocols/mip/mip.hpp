// MicroStrain MIP: the declarations shared by the device (device.cpp), its models (model.hpp), its packets (mip.cpp),
// its data fields (field_table.hpp, fields.cpp, navigation_fields.cpp), its commands (commands.cpp), its streams
// (streams.cpp), its settings (settings.cpp), its filter (filter_requests.cpp), its low-pass filters (low_pass.hpp,
// low_pass.cpp), its pins (pins.hpp, pins.cpp) and the decoder (decoder.cpp). Source: MicroStrain's mip_sdk
// (github.com/LORD-MicroStrain/mip_sdk e5a847d, src/c/mip/definitions).
//
// A packet is big-endian: 0x75 0x65, descriptor set, length of the fields, fields, two bytes of checksum (Fletcher,
// modulo 256). A field is its own length, a descriptor, and data. The answer to a command is a packet of the same
// set: field 0xF1 {command, code} for each command, followed by its data.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

#include "core/sample.hpp"
#include "protocols/mip/low_pass.hpp"
#include "protocols/mip/model.hpp"
#include "protocols/protocol.hpp"
#include "protocols/wire/frame_writer.hpp"

namespace imud::mip {

inline constexpr std::uint8_t sync[2] = {0x75, 0x65};
inline constexpr std::size_t header_size = 4, checksum_size = 2, longest = header_size + 255 + checksum_size;
inline constexpr std::int64_t second_ns = 1'000'000'000;
inline constexpr double internal_hz = 1000;  // the internal sample rate
// Descriptor sets of commands.
enum Set : std::uint8_t { base = 0x01, three_dm = 0x0C, filter_command = 0x0D, aiding = 0x13 };
inline constexpr std::uint8_t reply = 0xF1;

// Returns the two bytes of checksum of the bytes before them.
std::array<std::uint8_t, checksum_size> checksum_of(std::span<const std::byte> bytes) noexcept;
// Returns the size of the whole packet that begins with `held`; the size of the header while the header is
// incomplete. Returns nullopt if no packet begins with these bytes.
std::optional<std::size_t> packet_size(std::span<const std::byte> held) noexcept;
// Returns true if the checksum is right. `packet`: a whole packet.
bool is_intact(std::span<const std::byte> packet) noexcept;

// FrameSeal::reseal().
std::span<std::byte> reseal(std::span<std::byte> packet, const CanHeader&) noexcept;

// Calls `act(descriptor, data)` for each field of a whole packet. Returns false if the lengths of the fields do not
// add up to the packet's.
template <class Act>
bool for_each_field(std::span<const std::byte> packet, Act&& act) {
  std::span<const std::byte> rest = packet.subspan(header_size, packet.size() - header_size - checksum_size);
  while (rest.size() >= 2) {
    const auto length = std::to_integer<std::size_t>(rest[0]);
    if (length < 2 || length > rest.size()) return false;
    act(std::to_integer<std::uint8_t>(rest[1]), rest.subspan(2, length - 2));
    rest = rest.subspan(length);
  }
  return rest.empty();
}

using Reader = FieldReader<boost::endian::order::big>;

// Writes a packet. Write each field between begin() and end(). finish() completes and sends the packet, unless it has
// no fields.
class Packet : public FrameWriter<boost::endian::order::big> {
 public:
  Packet(FrameBuffer& out, std::uint8_t set) noexcept;
  void begin(std::uint8_t descriptor) noexcept;
  void end() noexcept { set_byte(field_, size() - field_); }
  void put_padded(std::string_view text, std::size_t width) noexcept;  // padded with blanks
  // Returns true if a field with `data` bytes of data fits.
  bool has_room_for(std::size_t data) const noexcept { return size() + 2 + data <= longest - checksum_size; }
  void finish() noexcept;

 private:
  std::size_t field_ = 0;
};

struct DataField {
  std::string_view name;               // in the configuration; empty: the configuration cannot name the field
  std::uint8_t set, descriptor, size;  // of the data; the set gnss stands for any receiver's set
  unsigned models;                     // the models that have this field
};
std::span<const DataField> data_fields() noexcept;
// A field of the filter that is sent once for each aid of the model, 5 at most.
inline constexpr std::uint8_t aiding_summary = 0x46;
inline constexpr std::size_t most_aids = 5;
// Returns nullptr if the model has no such field.
const DataField* find_field(const Model& model, std::uint8_t set, std::uint8_t descriptor) noexcept;

// The place of a descriptor set among the streams of a device.
inline constexpr std::size_t streams_of_a_device = 5;
constexpr std::size_t slot_of(std::uint8_t set) noexcept {
  return set == sensor ? 0U : set == filter ? 1U : set == gnss || set == gnss_1 ? 2U : set == gnss_2 ? 3U : 4U;
}

// The stream of a descriptor set. Set 0: the model does not have this stream.
struct Stream {
  struct Rate {
    std::uint8_t descriptor = 0;
    std::uint16_t decimation = 1;
  };
  std::uint8_t set = 0;
  std::uint16_t base_hz = 0;
  bool enabled = true;
  std::uint8_t count = 0;
  std::array<Rate, 32> format = {};

  void add(std::uint8_t descriptor, std::uint16_t decimation) noexcept {
    if (count < format.size()) format[count++] = {descriptor, decimation};
  }
};

// Returns true if all fields of the stream fit in one packet, as at sample 0, at which all fields are due.
bool fits_a_packet(const Model& model, const Stream& stream) noexcept;

class Memory;

// The source of the pulse per second.
enum class PulseSource : std::uint8_t { disabled, receiver_1, receiver_2, gpio, generated };

// The use of a user GPIO pin.
struct Pin {
  enum Feature : std::uint8_t { unused, gpio, pps, encoder, timestamp };
  // The meaning depends on the feature.
  enum Behavior : std::uint8_t { input = 1, output = 2, output_low = 2, output_high = 3 };
  enum Edges : std::uint8_t { rising = 1, falling, either };
  std::uint8_t feature = unused, behavior = 0;
  bool operator==(const Pin&) const = default;
};
inline constexpr std::uint8_t events = 8;  // triggers, and actions

// Writes data fields from the newest sample. The configured biases are subtracted, and vectors are in the axes V of
// the vehicle.
class Fields {
 public:
  explicit Fields(const Memory& memory) noexcept : memory_(memory) {}
  void set_figures(const OwnFigures& figures) noexcept { figures_ = figures; }
  void set_sample(const Sample& sample) noexcept;
  // Call this at power-on or reset. Discards the measurements; reference time and ticks then count from `now`. The
  // very first sample of a device sets the reference time to the sensor's own clock, so that sample 0 carries its own
  // time.
  void restart(DeviceTime now) noexcept;
  // Restarts the increments and time differences of the set's stream (0: of every stream) at the newest sample. If
  // samples have ceased, they restart one sample period before `now`.
  void begin(std::uint8_t set, DeviceTime now) noexcept;
  void reset_filter() noexcept;  // the filter initializes again
  NavigationRequests& requests() noexcept { return requests_; }
  const NavigationRequests& requests() const noexcept { return requests_; }
  void step_clock(Nanoseconds by) noexcept;
  // Returns the time since power-on or reset; before both, the time by the sensor's own clock.
  Nanoseconds since_start(DeviceTime at) const noexcept { return at - restarted_.value_or(DeviceTime{}); }
  // Returns a time, ns, by the clock of a source of pulses: a pulse begins at each full second of this clock. Returns
  // nullopt if the source sends no pulses.
  std::optional<std::int64_t> seconds_clock(PulseSource source, DeviceTime at) const noexcept;
  bool has_pulse(DeviceTime at) const noexcept;  // a valid pulse per second
  const Sample& newest() const noexcept { return sample_; }
  std::uint64_t samples() const noexcept { return sample_.counter - restarted_tick_; }  // since power-on or reset
  // Returns the GPS time that the device reports for `at`, ns since 1980-01-06. `at`: at most one sample period
  // before the newest sample.
  std::int64_t gps_ns(DeviceTime at) const noexcept;
  // Appends a streamed field. Appends nothing if there is no such field, or no room for the field.
  void put(Packet& packet, std::uint8_t set, std::uint8_t descriptor) const noexcept {
    put(packet, set, descriptor, since_[slot_of(set)], stamp());
  }
  // Appends a field that the host polls at `now`, or that an event sends. `event`: the number of the event's trigger;
  // 0: polled. Times are taken at `now`; increments and time differences span the last base period of the set.
  void poll(Packet& packet, std::uint8_t set, std::uint8_t descriptor, DeviceTime now,
            std::uint8_t event = 0) const noexcept;
  // Restarts the increments and time differences of a streamed field. Call this after the packet is finished, because
  // a packet may contain a field twice.
  void sent(std::uint8_t set, std::uint8_t descriptor) noexcept;

 private:
  // The stamp of the newest sample, not before power-on or reset.
  DeviceTime stamp() const noexcept { return restarted_ ? std::max(sample_.stamp(), *restarted_) : sample_.stamp(); }
  struct Since {  // the time of the last transmission, and the sums since then
    DeviceTime delta_time, reference;
    std::uint64_t tick = 0;
    std::uint8_t event = 0;  // the trigger that sends the field; 0: none
    Vector3 delta_angle = Vector3::Zero(), delta_velocity = Vector3::Zero();
  };

  // The states as a device of the 7 series numbers them (mip_sdk, data_filter.h). A GX5 has only 1, and 2 for
  // running.
  enum class FilterState : std::uint16_t { initialization = 1, vertical_gyro, ahrs, full_navigation };
  FilterState filter_state() const noexcept;
  // Returns true if the unit has its own solution, and this is in `state`.
  bool is_in(Solution::State state) const noexcept { return sample_.solution && sample_.solution->state == state; }
  struct Warnings;
  unsigned flags_of_gx5(FilterState state, const Warnings& high) const noexcept;
  unsigned flags_of_series_7(FilterState state, const Warnings& high, bool has_pulse) const noexcept;

  void put(Packet& packet, std::uint8_t set, std::uint8_t descriptor, const Since& since,
           DeviceTime at) const noexcept;
  void put_shared(Packet& packet, std::uint8_t descriptor, const Since& since, DeviceTime at) const noexcept;
  void put_sensor(Packet& packet, std::uint8_t descriptor, const Since& since, DeviceTime at) const noexcept;
  void put_filter(Packet& packet, std::uint8_t descriptor, DeviceTime at) const noexcept;
  void put_filter_status(Packet& packet, DeviceTime at) const noexcept;
  void put_aiding_summaries(Packet& packet, DeviceTime at) const noexcept;
  void put_dual_antenna(Packet& packet, DeviceTime at) const noexcept;
  void put_gnss(Packet& packet, std::uint8_t descriptor, DeviceTime at) const noexcept;
  void put_system(Packet& packet, std::uint8_t descriptor, DeviceTime at) const noexcept;
  void put_quaternion(Packet& packet) const noexcept;
  void put_euler(Packet& packet) const noexcept;
  static void put_gps_time(Packet& packet, std::int64_t ns) noexcept;
  static void put_position(Packet& packet, const Navigation& navigation) noexcept;
  bool is_known() const noexcept { return sample_.navigation.is_known; }
  bool knows_time() const noexcept { return sample_.timed().is_known; }
  std::int64_t true_gps_ns(DeviceTime at) const noexcept;    // GPS time of a receiver; 0 if the truth has none
  std::int64_t fix_gps_ns(DeviceTime at) const noexcept;     // the same at its fix; without a fix at `at`
  std::int64_t gnss_updates(DeviceTime at) const noexcept;   // GPS time, s, up to the last fix; 0 before the first
  std::int64_t since_pulse_s(DeviceTime at) const noexcept;  // 255: longer ago, or there was none
  bool has_week() const noexcept;
  bool has_time_of_week() const noexcept;
  Vector3 gravity() const noexcept;  // m/s^2, in V

  const Memory& memory_;
  OwnFigures figures_;
  Sample sample_;  // in V
  bool has_sampled_ = false;
  Quaternion antennas_q_LV_ = Quaternion::Identity();  // the attitude at the receivers' last epoch
  std::optional<Navigation> last_fix_;                 // since power-on or reset, of a unit with a filter of its own
  NavigationRequests requests_;
  std::array<Since, streams_of_a_device> since_;  // since each stream was last sent
  std::optional<DeviceTime> filter_began_;        // the first sample at which the filter could begin
  std::optional<DeviceTime> restarted_;           // nullopt: reference time is the sensor's own clock
  std::uint64_t restarted_tick_ = 0;
};

// A setting that can be written and read. Some settings have an effect (filter_requests.cpp, pins.cpp,
// navigation_fields.cpp). The data of the command are a function, a key (which selects one of several slots) and a
// value.
struct KeptSetting {
  enum Kind : std::uint8_t { any, flag, numbers, source, pin };  // numbers: finite; source, pin: see pins.hpp

  std::uint8_t set, command, reply;
  unsigned models;
  std::uint8_t key_size, first_key, slots;
  std::uint8_t least, most;               // fewest and most bytes of key and value
  std::span<const std::uint8_t> initial;  // value; missing bytes are 0
  Kind kind = any;                        // values of another kind are refused
};
std::span<const KeptSetting> kept_settings() noexcept;

// A command that changes nothing, and is acknowledged if its data have `size` bytes.
struct Acknowledged {
  std::uint8_t set, command, size;
  unsigned models;
};
std::span<const Acknowledged> acknowledged_commands() noexcept;

// One slot of a kept setting: its key and value.
struct Kept {
  std::uint8_t size = 0;
  std::array<std::uint8_t, 40> bytes = {};
};

struct Configuration {
  Configuration() noexcept;

  std::array<Stream, streams_of_a_device> streams;  // index: slot_of() the set
  std::uint32_t baud = 115200;
  Vector3 gyro_bias = Vector3::Zero(), accelerometer_bias = Vector3::Zero();  // rad/s, m/s^2; subtracted in P
  Quaternion q_PV = Quaternion::Identity();                                   // v_P = q_PV * v_V, V: the vehicle
  LowPasses low_passes = as_delivered;
  std::array<Kept, 65> kept;  // the slots of all kept settings, one after another

  const Stream* find(std::uint8_t set) const noexcept;  // nullptr if there is none
  Stream* find(std::uint8_t set) noexcept { return const_cast<Stream*>(std::as_const(*this).find(set)); }
  // Returns the cut-off of a quantity's low-pass filter, Hz; in automatic mode, half of the rate at which the
  // quantity is sent. Returns 0 if the quantity is not filtered, and in automatic mode if it is not sent.
  double cut_off_hz(const LowPass& low_pass) const noexcept;
  // Returns how the unit's own filter uses its aids, and the compensation of the magnetic field.
  NavigationAids aids(const Model& model) const noexcept;
  // Returns a slot of a kept setting; nullptr if the model has no such setting, or the setting no such key.
  const Kept* find_kept(const Model& model, std::uint8_t set, std::uint8_t command, unsigned key = 0) const noexcept;
};

// The settings of a unit as delivered, as saved, and as active. Executes the host's commands. Times are by the
// sensor's clock.
class Memory {
 public:
  Memory(const Model& model, const Configuration& configuration) noexcept
      : model_(model), factory_(configuration), stored_(configuration), active_(configuration) {}

  // The GPS time that the host has set: device time plus `offset_ns`. `count`: how often the host has set it; 0: the
  // time is not set.
  struct GpsUpdate {
    std::int64_t offset_ns = 0;
    bool has_week = false, has_time_of_week = false;
    unsigned count = 0;
  };

  const Model& model() const noexcept { return model_; }
  const Configuration& active() const noexcept { return active_; }
  const GpsUpdate& gps_update() const noexcept { return gps_update_; }
  // The edges of the pulse-per-second input that were valid.
  struct Pulses {
    std::uint32_t count = 0;
    std::optional<DeviceTime> last;
  };
  const Pulses& pulses() const noexcept { return pulses_; }
  PulseSource pulse_source() const noexcept;
  Pin pin(std::uint8_t number) const noexcept;                      // numbered from 1
  bool has_pin(Pin wanted) const noexcept;                          // at least one pin is configured so
  bool sends_pulses() const noexcept { return sends_pulses_; }      // some pin is the pulse-per-second output
  std::uint8_t pin_states() const noexcept { return pin_states_; }  // bit 0: pin 1 is high
  void set_pin_state(std::uint8_t number, bool is_high) noexcept;
  // Processes an edge of the pulse-per-second input. Returns false if no input is configured.
  bool pps(DeviceTime at) noexcept;
  // Counts the bytes on the line.
  void count_bytes(std::size_t received, std::size_t sent) noexcept;
  bool is_idle() const noexcept { return is_idle_; }
  void restart(Fields& fields, DeviceTime now) noexcept;  // keeps only what was saved
  // Executes an intact packet of the host; appends the answer and the polled data.
  void execute(std::span<const std::byte> packet, DeviceTime now, Fields& fields, FrameBuffer& replies) noexcept;
  // Adds the sample to a capture of the gyro bias; appends the answer if the capture ends with this sample.
  void capture(const Sample& sample, FrameBuffer& out) noexcept;
  // If the last sample of a capture does not arrive, poll() ends the capture at deadline() and appends the answer.
  std::optional<DeviceTime> deadline() const noexcept;
  void poll(DeviceTime now, FrameBuffer& out) noexcept;
  void step_clock(Nanoseconds by) noexcept;

 private:
  enum Code : std::uint8_t { ok = 0, unknown_command = 1, bad_parameter = 3, failed = 4 };
  enum Function : std::uint8_t { write = 1, read, save, load, to_default };
  using Data = std::span<const std::byte>;
  struct Poll {
    Code code = bad_parameter;
    bool is_silent = false;  // no acknowledgement, whatever the code
    Stream stream;           // the polled fields
  };

  struct Context {  // of the command being executed
    DeviceTime now;
    Packet& answer;
    Fields& fields;
  };

  Code execute(std::uint8_t set, std::uint8_t command, Data data, const Context& context) noexcept;
  Code execute_base(std::uint8_t command, Reader& reader, const Context& context) noexcept;
  Code execute_3dm(std::uint8_t command, Reader& reader, const Context& context) noexcept;
  Code execute_kept(const KeptSetting& setting, Data data, Packet& answer) noexcept;
  Code act_on_filter(std::uint8_t command, Data data, Fields& fields) noexcept;  // set 0x0D, up to 0x03
  Code baud(std::uint8_t function, Reader& reader, Packet& answer, std::uint8_t descriptor, bool with_port) noexcept;
  Code update_gps_time(Reader& reader, const Context& context) noexcept;
  Code device_settings(Reader& reader, const Context& context) noexcept;
  Code device_status(Reader& reader, const Context& context) noexcept;
  Code pin_state(Reader& reader, Packet& answer) noexcept;
  void configure_pin(std::uint8_t number) noexcept;
  void reset_pins() noexcept;  // to the states of the configuration
  Poll parse_poll(std::uint8_t command, Data data) const noexcept;
  bool is_poll(std::uint8_t set, std::uint8_t command) const noexcept;
  Code base_rate(std::uint8_t set, std::uint8_t descriptor, Reader& reader, Packet& answer, bool with_set) noexcept;
  Code format(std::uint8_t function, std::uint8_t set, std::uint8_t descriptor, Reader& reader,
              const Context& context, bool with_set) noexcept;
  Code stream_control(Reader& reader, Packet& answer) noexcept;
  // `unit`: one unit of the wire, in SI.
  Code vector(Vector3 Configuration::*vector, double unit, std::uint8_t descriptor, Reader& reader,
              Packet& answer) noexcept;
  Code rotation(std::uint8_t set, std::uint8_t command, Reader& reader, Packet& answer) noexcept;
  // A device of the 7 series gives the descriptor set as well.
  Code low_pass(Reader& reader, Packet& answer, bool with_set) noexcept;
  bool is_streaming(const Stream& stream) const noexcept { return !is_idle_ && stream.enabled; }
  bool begins_capture(Data data, DeviceTime now) noexcept;
  void end_capture(FrameBuffer& out) noexcept;
  bool has(std::uint8_t set, std::uint8_t command) const noexcept;
  void put_device_info(Packet& answer) const noexcept;
  void put_descriptors(Packet& answer, bool extended) const noexcept;

  // Executes the function save, load or default by a call of copy(to, from).
  template <class Copy>
  Code transfer(std::uint8_t function, Copy&& copy) noexcept {
    switch (function) {
      case save:
        copy(stored_, std::as_const(active_));
        return ok;
      case load:
        copy(active_, std::as_const(stored_));
        return ok;
      case to_default:
        copy(active_, factory_);
        return ok;
      default:
        return bad_parameter;
    }
  }

  const Model& model_;
  const Configuration factory_;
  Configuration stored_, active_;
  GpsUpdate gps_update_;
  Pulses pulses_;
  std::uint8_t pin_states_ = 0;
  bool sends_pulses_ = false;
  std::uint32_t bytes_read_ = 0, bytes_written_ = 0;
  bool is_idle_ = false;
  std::optional<DeviceTime> capture_end_;  // nullopt: no capture is running; a sample at this time is the last one
  unsigned capture_count_ = 0;             // samples in the sum
  Vector3 capture_sum_ = Vector3::Zero();  // rad/s
};

// Decodes sensor data (set 0x80) into measurements; its resolution and range are in the table entry.
std::unique_ptr<Decoder> make_decoder();

}  // namespace imud::mip
