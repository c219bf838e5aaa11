// Executes commands on the sampling thread.
#pragma once

#include "core/time.hpp"
#include "emulator/engine/command.hpp"

namespace imud {

class Host;
class Session;

// Executes a command now, and records it. It must be called where each sample that was taken has been transmitted.
void execute(Session& session, const Command& command, HostTime now) noexcept;
// Executes the batches that wait, but not more than a few. Called where execute() may be. A batch for whose results
// there is no room keeps waiting.
void execute_commands(Session& session, Host& host) noexcept;

}  // namespace imud
