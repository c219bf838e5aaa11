// Summary: what a run has done, for people and as JSON.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "emulator/session.hpp"

namespace imud {

struct Summary {
  double duration_s = 0;  // host time
  struct Truth {
    std::uint64_t received = 0, accepted = 0, no_state = 0, runs = 0, resumed = 0, truncated = 0;
    std::map<std::string, std::uint64_t> refused;  // by cause; only what happened
    std::string warning;                           // how a capture ended, if not well
  } truth;
  struct Imu {
    std::string name;
    std::uint64_t samples = 0, frames = 0, dropped = 0, extrapolated = 0, held = 0;
    double p50_us = 0, p99_us = 0, p999_us = 0, max_us = 0;  // lateness; 0 where no clock paces
  };
  std::vector<Imu> imus;
};

// Only when the thread that samples has ended.
Summary summarize(const Session& session, double duration_s);

std::string text(const Summary& summary);
// The contract's JSON.
std::string json(const Summary& summary);

}  // namespace imud
