// The command `imud pty`: holds pseudo-terminals while imud restarts.
#pragma once

#include <string>
#include <vector>

namespace imud {

// Makes a pty for each of `links`, and holds the ptys until SIGINT, SIGTERM or SIGHUP. If `background`, the calling
// process ends when the ptys are ready, and a child process holds them. Returns the exit code. Throws PortError if a
// pty cannot be made, and std::runtime_error if there can be no child process.
int keep_ptys(const std::vector<std::string>& links, bool background);

}  // namespace imud
