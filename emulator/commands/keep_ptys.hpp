// The command `imud pty`: holds pseudo-terminals while imud restarts.
#pragma once

#include <string>
#include <vector>

namespace imud {

// Holds ptys until SIGINT, SIGTERM or SIGHUP. With `background` the calling process returns when the ptys are
// ready. Returns the exit code. Throws PortError if a pty cannot be made.
int keep_ptys(const std::vector<std::string>& links, bool background);

}  // namespace imud
