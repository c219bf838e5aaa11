// Config: what the user wants, read from TOML, checked as a whole.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/imu.hpp"
#include "core/timeline.hpp"
#include "emulator/sync.hpp"
#include "emulator/truth_clock.hpp"
#include "protocols/protocol.hpp"
#include "protocols/truth_format.hpp"
#include "transports/port.hpp"

namespace imud {

// Who says "now": the host's clock, each truth that arrives, or a capture as fast as it can be read.
enum class ClockMode : std::uint8_t { realtime, lockstep, fast };

// What a sensor does when motion is held for want of truth.
enum class WhenStopped : std::uint8_t {
  hold,     // goes on: rate zero, specific force constant; status bits 6 and 7
  flag,     // likewise, and says that it is not valid (status bit 8, or the protocol's own)
  silence,  // sends nothing
};

// What a sensor does in real time until the first truth comes. It has power, and answers its host, in any case.
enum class BeforeFirst : std::uint8_t {
  silence,  // takes no sample: sample 0 is that of the first truth
  rest,     // samples a vehicle at rest from power-on: sample 0 is that of power-on
};

struct TruthConfig {
  std::string port;  // empty only if the command line gives a capture
  const TruthFormat* format = nullptr;
  Settings settings;
  std::optional<std::uint32_t> stream;  // take only this one; otherwise the first that comes
  Timeline::Limits limits;
  TruthClock::Options clock;  // realtime, live
  WhenStopped when_stopped = WhenStopped::hold;
};

// The thread that samples, where the clock is the host's.
struct RealtimeConfig {
  int priority = 70;  // SCHED_FIFO; 0: as any thread
  std::optional<unsigned> cpu;
  bool lock_memory = true;
  Nanoseconds spin{0};
};

struct ImuConfig {
  std::string name;
  double rate_hz = 0;
  Grid grid{1.0};  // of its instants: the rate with the clock's error, and the phase
  const Protocol* protocol = nullptr;
  Settings settings;
  std::string port;
  PortSettings port_settings = Role::device;  // with the device's UART, and whether its characters are paced
  BeforeFirst before_first = BeforeFirst::silence;
  SyncConfig sync;
  ImuModel model;
};

struct Config {
  std::uint64_t seed = 1;
  ClockMode clock = ClockMode::realtime;
  TruthConfig truth;
  RealtimeConfig realtime;
  std::vector<ImuConfig> imus;
};

// All that is wrong with a configuration, a line each: "file:line: key: what is wrong; what would be right".
struct ConfigError : std::runtime_error {
  explicit ConfigError(std::vector<std::string> all);
  std::vector<std::string> faults;
};

// Reads `path`, then sets each override "imu.0.rate_hz=400" (the value as in TOML; a bare word is text). `capture`
// takes the place of truth.port if not empty. Throws ConfigError with every fault.
Config load_config(const std::string& path, std::span<const std::string> overrides = {},
                   const std::string& capture = {});

// Returns true if the truth port's transport ends: the truth is read ahead of the clock.
bool is_capture(const std::string& truth_port) noexcept;

}  // namespace imud
