// Machine: the properties of this computer that delay a thread, and advice on them.
#pragma once

#include <string>
#include <vector>

namespace imud {

// Lines of text for people.
struct Machine {
  std::vector<std::string> facts;
  std::vector<std::string> advice;  // the most helpful first; empty if nothing can be improved
};

// Inspects /proc and /sys below `root` ("", or the folder of a copy); unreadable values are left out. The advice is
// for a thread with priority that sleeps, or `spins`, until each instant, and writes to the devices `serial`, such
// as /dev/ttyUSB0.
Machine inspect_machine(const std::string& root, bool spins, const std::vector<std::string>& serial);

}  // namespace imud
