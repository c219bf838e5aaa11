// Executes commands on the sampling thread.
#pragma once

#include "core/time.hpp"
#include "emulator/engine/command.hpp"

namespace imud {

class Host;
class Engine;

// Executes a command now, and records it. It must be called where each sample that was taken has been transmitted.
void execute(Engine& engine, const Command& command, HostTime now) noexcept;
// Executes the batches that wait, but not more than a few. Called where execute() may be. A batch for whose results
// there is no room keeps waiting.
void execute_commands(Engine& engine, Host& host) noexcept;

}  // namespace imud
