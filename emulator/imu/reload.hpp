// Reload: the changes by another configuration in a run that goes on.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/imu.hpp"
#include "core/navigation/own_solution.hpp"
#include "emulator/imu/command.hpp"
#include "emulator/imu/solution_judge.hpp"
#include "emulator/plan/config.hpp"
#include "protocols/protocol.hpp"
#include "transports/port.hpp"

namespace imud {

class Channel;

// A key whose value differs. The key of an imu is "imu.NAME.KEY".
struct KeyChange {
  std::string key;
  std::string before, after;      // as in TOML; "no value" of a key that is absent
  const char* refusal = nullptr;  // why a run that goes on cannot change it; nullptr: it can
};

// Compares the resolved values of all keys.
std::vector<KeyChange> key_changes(const Config& before, const Config& after);

// The keys of the file that a reload can change; keys of an imu are without "imu.NAME.". A dot at the end stands for
// all keys of a table.
std::span<const std::string_view> reloadable_keys(bool of_imu) noexcept;

// Everything that the sampling thread needs to change over. Another thread makes the Reload. Command::Kind::reload
// exchanges its objects for those in use, and then the other thread destroys the Reload with the replaced objects.
struct Reload {
  // A sensor and a device that replace a channel's sensor and device.
  struct Sensor {
    std::size_t channel = 0;  // its number
    ImuModel model;
    Imu imu;
    Oscillator oscillator;
    std::optional<OwnSolution> solution;  // this solution begins to align
    std::optional<SolutionJudge> judge;   // of that solution
    std::optional<Grid> grid;             // nullopt: the grid does not change
    // The device with other settings, and the device as delivered. nullptr: both devices stay in use.
    std::unique_ptr<Device> device, delivered_device;
    std::array<std::unique_ptr<FrameSeal>, 2> seals;  // of both lines of that device; only used with it
    bool keeps_gyro_bias = false, keeps_accelerometer_bias = false;  // the biases of Channel::set_bias()
  };
  std::vector<Sensor> sensors;
  // A port that replaces a channel's port.
  struct Line {
    std::size_t channel = 0;  // its number
    std::size_t uart = 0;     // 0, or 1 for `second_port`
    std::string key;          // "imu.NAME.port"
    std::string before, after;
    PortSettings settings = Role::device;
    double bit_rate = 0;  // WirePort::Line::bit_rate
    // nullptr until open_ports(), and in a repeated run; afterwards the replaced port.
    std::unique_ptr<Port> port;
    // The frames that the replaced port holds back, and how many of them are not the device's.
    std::uint64_t held = 0, held_of_others = 0;
  };
  std::vector<Line> lines;
  std::vector<Command> commands;  // of the engine
  std::string text;               // the new configuration, Config::resolved, for the record

  // Prepares the change from `before` to `after`, as far as keys are reloadable. `imus`: the imus of the engine's
  // channels, in order; several may have one name. `seed`: the seed of the run.
  Reload(const Config& before, const Config& after, std::span<const ImuConfig> imus, std::uint64_t seed);

  // Opens the ports of `lines` with the filters of `channels`. Returns a line "imu.NAME.port: cause" for each port
  // that cannot be opened. In that case the other ports are closed again.
  std::vector<std::string> open_ports(
      std::span<const std::unique_ptr<Channel>> channels,
      const std::function<std::unique_ptr<Port>(std::string_view, const PortSettings&)>& open = open_port);
};

}  // namespace imud
