// Reloader: reads the file of a run's configuration again, and prepares the changes.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "emulator/control/change.hpp"
#include "emulator/control/leaving_ports.hpp"
#include "emulator/imu/reload.hpp"
#include "emulator/plan/config.hpp"

namespace imud {

class Engine;

// Runs in the ControlApi's thread.
class Reloader {
 public:
  // `started`: the configuration that the engine was made of. `now`: the run's present one, which a reload changes.
  // `read`: reads the file again, with the overrides of the command line, and throws ConfigError; empty: there is no
  // file. `changed`: called when `now` has changed. All outlive this.
  Reloader(Engine& engine, const Config& started, Config& now, std::function<Config()> read,
           std::function<void()> changed)
      : engine_(engine), started_(started), now_(now), read_(std::move(read)), changed_(std::move(changed)) {}

  // Returns true if there is a file to read.
  bool can_read() const noexcept { return static_cast<bool>(read_); }
  // Returns true from prepare() until finish() or cancel().
  bool is_waiting() const noexcept { return reload_ != nullptr; }
  // Reads the file. Returns the change that the file makes, with its new ports open; nullopt if no key differs.
  // Throws RpcError, with all faults of the file, all keys that cannot change, or all ports that cannot be opened.
  // Requires that is_waiting() is false.
  std::optional<Change> prepare();
  // Called when the sampling thread has executed the change. The replaced ports begin to close.
  void finish();
  // Called if the change cannot be executed.
  void cancel() noexcept;
  // Closes replaced ports as far as possible (LeavingPorts). Called ten times a second.
  void update() { leaving_.update(); }
  // Closes all replaced ports. Called when the sampling thread has ended.
  void close_ports() { leaving_.finish(); }

 private:
  void open_ports(std::vector<PortChange>& opened);

  Engine& engine_;
  const Config& started_;
  Config& now_;
  const std::function<Config()> read_;
  const std::function<void()> changed_;
  std::optional<Config> next_;
  std::unique_ptr<Reload> reload_;
  LeavingPorts leaving_;
};

}  // namespace imud
