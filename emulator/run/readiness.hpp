// Readiness: reports that a run is ready or ends, and waits for the readers of its ptys.
#pragma once

#include <boost/asio/io_context.hpp>
#include <functional>
#include <optional>
#include <string_view>

#include "emulator/engine/closing.hpp"
#include "emulator/plan/config.hpp"

namespace imud {

// Reports that the ports are open and the links of ptys stand: by a line "ready" in the log, with the UDP ports that
// the system has chosen; by READY=1 to the service manager (sd_notify(3)); and by "ready\n" to the descriptor
// `ready_fd`, which is then closed.
void report_ready(const ChosenPorts& chosen, std::optional<int> ready_fd);

// Sends a state, such as "WATCHDOG=1", to the service manager's socket, as sd_notify(3) specifies; without one does
// nothing.
void notify_manager(std::string_view state);

// Report to the service manager that a reload of the configuration begins, and that it has been made or refused, as
// Type=notify-reload requires (systemd.service(5)).
void report_reloading();
void report_reloaded();

// Reports to the service manager that the run ends.
void report_stopping();

// Waits until each pty of the engine's imus has a reader, or `stopped` returns true, and handles the events of `io`.
// Logs which ptys it waits for. Called before the sampling thread begins.
void wait_for_readers(Engine& engine, const Config& config, boost::asio::io_context& io,
                      const std::function<bool()>& stopped);

}  // namespace imud
