// `imud status`: what runs on this machine, with its figures.
#pragma once

#include <string>

namespace imud {

struct StatusOptions {
  std::string name;   // of an instance; empty: all
  bool json = false;  // print JSON
};

// Prints the runs of this user, and runs of the service, which another user may own. Takes some seconds at most,
// whatever state the runs are in. Returns 0; 1 if there is no run, no run of that name, or a run that does not
// answer.
int show_status(const StatusOptions& options);

}  // namespace imud
