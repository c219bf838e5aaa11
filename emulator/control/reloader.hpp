// Reloader: reads the file of a run's configuration again, and prepares what changes.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "emulator/control/change.hpp"
#include "emulator/engine/reload.hpp"
#include "emulator/plan/config.hpp"

namespace imud {

class Session;

// One thread, that of the ControlApi.
class Reloader {
 public:
  // `started`: the configuration that the session was made of. `now`: that of the run now, which a reload changes.
  // `read`: reads the file again, with the overrides of the command line, and throws ConfigError; empty: there is no
  // file. `changed`: called when `now` has changed. All outlive this.
  Reloader(Session& session, const Config& started, Config& now, std::function<Config()> read,
           std::function<void()> changed)
      : session_(session), started_(started), now_(now), read_(std::move(read)), changed_(std::move(changed)) {}

  // Returns true if there is a file to read.
  bool can_read() const noexcept { return static_cast<bool>(read_); }
  // Returns what the file changes now; nullopt if no key differs. Throws RpcError, with all faults of the file or all
  // keys that cannot change. The sampling thread must not execute the change before finish() or cancel() of the one
  // before.
  std::optional<Change> prepare();
  // Called when the sampling thread has executed the change.
  void finish();
  // Called when it cannot.
  void cancel() noexcept;

 private:
  Session& session_;
  const Config& started_;
  Config& now_;
  const std::function<Config()> read_;
  const std::function<void()> changed_;
  std::optional<Config> next_;
  std::unique_ptr<Reload> reload_;
};

}  // namespace imud
