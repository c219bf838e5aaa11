// Command: one change that is made while a run goes on, between two samples.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace imud {

// A change that the sampling thread makes. Trivially copyable, because it goes through a queue. The values of Kind
// stand in records: they do not change.
struct Command {
  enum class Kind : std::uint8_t {
    mark = 0,         // changes nothing; states the samples that are next. Its text goes into the record
    power_off = 1,    // of an imu's supply
    power_on = 2,     // of an imu's supply; no effect if it is on
    power_cycle = 3,  // off and on at once
    pause = 4,        // the frames of an imu are discarded; its sensor and its device go on
    resume = 5,
    seed = 6,                // `number`: Imu::set_seed()
    gyro_bias = 7,           // `value`: rad/s, of the axis `number`
    accelerometer_bias = 8,  // `value`: m/s^2, of the axis `number`
    delay = 9,               // of the truth; `value`: s
    automatic_delay = 10,    // of the truth; `value`: TruthClock::Options::automatic_percent
    extrapolate = 11,        // of the truth; `value`: s
    when_stopped = 12,       // `number`: WhenStopped
    log_level = 13,          // changes nothing in the sampling thread; `number`: LogLevel
    fault_begin = 14,        // `number`: of the fault in the FaultBook
    fault_end = 15,          // `number`: of the fault
    fault_clear = 16,        // ends all faults
    servo = 17,              // of the truth format: TruthIntake::set_servo() of the servo `number`; `value`: us
    reload = 18,             // RunControl::reload has the changes; in a record `number` is the size of its text
  };
  static constexpr std::uint16_t all_imus = 0xFFFF;
  static constexpr std::size_t longest_text = 120;  // bytes

  Kind kind = Kind::mark;
  std::uint8_t text_size = 0;
  std::uint16_t imu = all_imus;  // the number of the imu in the configuration
  double value = 0;
  std::uint64_t number = 0;
  std::array<char, longest_text> text = {};  // of a mark
};

// Returns true if the event of such a command in a record has Command::value, which kinds that do not use it leave 0.
// The events of the other kinds have in its place when deadlines were polled last (RecordEvent::b): these kinds
// change the output of a device, or are marks.
constexpr bool records_value(Command::Kind kind) noexcept {
  using Kind = Command::Kind;
  switch (kind) {
    case Kind::mark:
    case Kind::power_off:
    case Kind::power_on:
    case Kind::power_cycle:
    case Kind::pause:
    case Kind::resume:
    case Kind::reload:
      return false;
    case Kind::seed:
    case Kind::gyro_bias:
    case Kind::accelerometer_bias:
    case Kind::delay:
    case Kind::automatic_delay:
    case Kind::extrapolate:
    case Kind::when_stopped:
    case Kind::log_level:
    case Kind::fault_begin:
    case Kind::fault_end:
    case Kind::fault_clear:
    case Kind::servo:
      return true;
  }
  return true;  // of a damaged record
}

// The first sample of an imu that a batch of commands applies to, if it changes that imu.
struct Applied {
  std::uint64_t batch = 0;
  std::uint16_t imu = 0;
  bool is_last = false;      // the answer to the batch ends here
  bool has_time = false;     // the sample's time is known; false before the first truth of a run
  std::uint64_t sample = 0;  // Sample::counter
  std::int64_t time_ns = 0;  // its time stamp by the device's clock
};

}  // namespace imud
