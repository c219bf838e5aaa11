// The processor time of a process or a thread.
#pragma once

#include <unistd.h>

#include <sstream>
#include <stdexcept>
#include <string>

#include "tests/tools/run_program.hpp"

namespace imud {

// Returns user and system time, s, by the file `stat` of proc(5): /proc/PID/stat, or /proc/PID/task/TID/stat.
inline double processor_time_s(const std::string& stat_file) {
  const std::string stat = read_file(stat_file);
  std::istringstream fields(stat.substr(stat.rfind(')') + 1));
  std::string skipped;
  for (int i = 0; i < 11; ++i) fields >> skipped;
  double user = -1, system = -1;
  if (!(fields >> user >> system)) throw std::runtime_error(stat_file + ": " + stat);
  return (user + system) / static_cast<double>(::sysconf(_SC_CLK_TCK));
}

}  // namespace imud
