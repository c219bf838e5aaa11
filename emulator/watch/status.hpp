// `imud status`: what runs on this machine, with its figures.
#pragma once

#include <string>

namespace imud {

struct StatusOptions {
  std::string name;   // of an instance; empty: all
  bool json = false;  // print JSON
};

// Prints the runs of this user, and runs of the service, which another user may own.
// Takes some seconds at most, whatever state they are in. Returns 0; 1 if none runs, the named one does not, or one
// does not answer.
int show_status(const StatusOptions& options);

}  // namespace imud
