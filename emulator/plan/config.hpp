// Config: the configuration of a run, checked as a whole. Keys, units and ranges:
// emulator/CONFIGURATION.md.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/imu.hpp"
#include "core/navigation/navigator_model.hpp"
#include "core/pose/pose_fit.hpp"
#include "core/timeline.hpp"
#include "emulator/ground/truth_bounds.hpp"
#include "emulator/ground/words.hpp"
#include "emulator/plan/epoch.hpp"
#include "emulator/plan/expect_config.hpp"
#include "emulator/plan/fault_config.hpp"
#include "emulator/plan/line_load.hpp"
#include "emulator/plan/sync_config.hpp"
#include "emulator/plan/truth_delay.hpp"
#include "emulator/plan/web_config.hpp"
#include "protocols/protocol.hpp"
#include "protocols/truth_format.hpp"
#include "transports/file/files_in_use.hpp"
#include "transports/port.hpp"

namespace imud {

inline constexpr const char* default_truth_format = "native";
inline constexpr int first_year_of_start = 2017;  // of the key earth.start

// The clock that paces the samples: the host's, each truth that arrives, or a capture as fast as it can be read.
enum class ClockMode : std::uint8_t { realtime, lockstep, fast };
inline constexpr auto clock_words = std::to_array<Word<ClockMode>>(
    {{ClockMode::realtime, "realtime"}, {ClockMode::lockstep, "lockstep"}, {ClockMode::fast, "fast"}});

// The output of a sensor while motion is held because truth has stopped.
enum class WhenStopped : std::uint8_t {
  hold,     // rate 0 and constant specific force, with status bits 6 and 7
  flag,     // as `hold`, and marked as not valid (status bit 8, or the protocol's own mark)
  silence,  // nothing
};
inline constexpr auto when_stopped_words = std::to_array<Word<WhenStopped>>(
    {{WhenStopped::hold, "hold"}, {WhenStopped::flag, "flag"}, {WhenStopped::silence, "silence"}});

// The output of a sensor in real time until the first truth comes. The sensor has power and answers its host in
// any case.
enum class BeforeFirst : std::uint8_t {
  silence,  // no sample: sample 0 is at the first truth
  rest,     // samples of a vehicle at rest: sample 0 is at power-on
};

struct TruthConfig {
  std::string port;                             // empty only if the command line gives a capture
  PortSettings port_settings = Role::listener;  // with the only sender that is admitted
  const TruthFormat* format = nullptr;
  Settings settings;
  std::optional<std::uint32_t> stream;  // the vehicle whose truth is used; nullopt: the first that arrives
  Timeline::Limits limits;
  TruthDelay clock;  // for realtime with live truth
  WhenStopped when_stopped = WhenStopped::hold;
  std::optional<PoseFit::Options> fit;  // nullopt: nothing is derived
  GravitationModel gravitation;         // of the truth's world
  bool ignores_force = false;           // no specific force is used or derived
  TruthFrame frame;                     // as far as the format and its settings determine it
  EarthModel earth;                     // the Earth of every imu
  bool is_earth_angle_given = false;    // by the key; otherwise the angle is the truth's, or the start's
  bool is_place_needed = false;         // an imu measures a magnetic field, pressure or headings, or has a receiver
  TruthBounds bounds;                   // the probable limits of the truth
  Vector3 r_RB_B = Vector3::Zero();     // m; the point whose motion the truth gives. The imus' lever arms begin there
};

// The thread that samples and its clock, for ClockMode::realtime.
struct RealtimeConfig {
  int priority = 70;            // SCHED_FIFO; 0: an ordinary thread
  std::optional<unsigned> cpu;  // nullopt: any
  bool lock_memory = true;
  // Time for which the thread spins before each instant, or at the begin of a wait where no clock of the host paces.
  Nanoseconds spin{0};                               // not negative
  Nanoseconds skip_after = std::chrono::seconds(1);  // frames of samples later than this are not sent; positive
  Epoch epoch = Epoch::none;                         // of the grids of samples, where the truth is live
  bool allow_unsynchronised = false;                 // the epoch's clock need not be synchronised
};

struct ImuConfig {
  static constexpr double max_internal_rate_hz = 1e5;

  std::string name;
  std::optional<std::uint64_t> seed;  // nullopt: the run's seed
  double rate_hz = 0;
  Grid grid{1.0};  // the instants of its samples: the rate with the clock's error, and the phase
  const Protocol* protocol = nullptr;
  Settings settings;
  std::string port;
  PortSettings port_settings = Role::device;  // with the device's UART, and whether its characters are paced
  std::string second_port;                    // of the product's other UART; empty: not connected
  PortSettings second_port_settings = Role::device;
  std::vector<std::string> also;  // further ports that carry the bytes of `port`
  std::vector<PortSettings> also_settings;
  LineLoad load, second_load;                       // of the lines at `port` and `second_port`
  BeforeFirst before_first = BeforeFirst::silence;  // always silence unless live truth drives it in realtime
  SyncConfig sync;
  std::string errors_model;  // the key `model`: the source of the errors in `model`
  ImuModel model;
  NavigatorModel navigator;     // the unit's own solution, with the gravitation of the truth's world
  bool device_filters = false;  // the product's settings choose the filters of `model`
};

// Returns the ports of the imu's lines and copies with their keys; an absent one is empty.
std::vector<std::pair<std::string_view, std::string>> ports_of(const ImuConfig& imu);
// Returns the imus' names, in their order.
std::vector<std::string> names_of(std::span<const ImuConfig> imus);

// The name of the model without errors. ideal() returns sensors or an imu with this model, which sample the same
// truth at the same instants, place and axes, and keep their ranges and their protocol.
inline constexpr std::string_view model_without_errors = "ideal";
TriadErrors ideal(const TriadErrors& errors) noexcept;
ImuConfig ideal(const ImuConfig& imu);

// The name of the model of an imu without_errors(), on which no fault acts.
inline constexpr std::string_view model_of_truth = "truth";
// Returns an ideal() imu without ranges, whose samples are sent bit for bit (`native`).
ImuConfig without_errors(const ImuConfig& imu);

// Who may control a run (control/README.md).
struct ControlConfig {
  std::string name;             // of this instance; empty: the number of its process
  std::string socket = "auto";  // a path; "auto": in the folder for sockets, by the name; "none"
  std::string listen;           // ADDRESS:PORT of a loopback interface; empty: none
  std::string token_file;       // its first line is the secret of clients at `listen`
  bool faults = false;          // faults can be begun
  // No key. If false, begun faults that change frames or their transmission do not act when a record is repeated.
  bool frame_faults = true;
};

struct Config {
  std::uint64_t seed = 1;
  ClockMode clock = ClockMode::realtime;
  TruthConfig truth;
  RealtimeConfig realtime;
  ControlConfig control;
  WebConfig web;
  std::vector<ImuConfig> imus;
  std::vector<FaultConfig> faults;
  std::vector<ExpectConfig> expectations;
  // The SHA-256, in hexadecimal, of the file, followed by a line for each override if there are any.
  std::string sha256;
  // Returns the value of every key, including absent ones, as TOML; each call makes the text. load_config() reads it
  // as this configuration. Any thread may call it.
  std::function<std::string()> resolved = [] { return std::string(); };
  // Each describes a valid value that is probably not meant: "file:line: key: what".
  std::vector<std::string> warnings;
  // The regular files that the configuration was read from, and the files that a run reads truth from, or writes.
  FilesInUse files;
};

// Every fault of a configuration, a line each: "file:line: key: what is wrong; what would be right".
struct ConfigError : std::runtime_error {
  explicit ConfigError(std::vector<std::string> all);
  std::vector<std::string> faults;
};

// Returns true if the truth port is a capture, whose truth can be read ahead of the clock.
bool is_capture(const std::string& truth_port) noexcept;
// Returns true if the host's clock paces the run, and the truth port is no capture (is_capture()).
bool has_live_truth(const Config& config) noexcept;
// Returns the epoch of the grids of samples: none without live truth.
Epoch epoch_of(const Config& config) noexcept;

}  // namespace imud
