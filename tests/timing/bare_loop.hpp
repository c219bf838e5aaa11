// The limit of every loop that writes to ptys: one that does nothing else.
#pragma once

#include "tests/timing/rig.hpp"

namespace imud::timing {

struct BareRun {
  Percentiles lateness;  // from the instant to the beginning of the write, of the worst pty
  double cpu_s = 0;      // of the loop's thread
};
// Sleeps until each instant, and writes a frame to each pty that is due, 1000 times a second for `duration_s` with
// the priority of imud. Each pty has a reader. The instants of pty i are i / ptys ms later if the ptys `are_apart`.
BareRun bare_loop(const Folder& folder, int ptys, bool are_apart, double duration_s);

}  // namespace imud::timing
