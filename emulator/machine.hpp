// Machine: what about this computer keeps a thread from its instants, and what to do about it.
#pragma once

#include <string>
#include <vector>

namespace imud {

// What the kernel says of itself, from the files below `root` ("" or a copy of /proc and /sys), and the advice that
// follows for a thread with priority that sleeps, or `spins`, until each instant, and writes to `serial` devices.
struct Machine {
  std::vector<std::string> facts;   // a line each, for people
  std::vector<std::string> advice;  // likewise, the most helpful first; empty: nothing left to do
};
Machine look_at_machine(const std::string& root, bool spins, const std::vector<std::string>& serial);

}  // namespace imud
