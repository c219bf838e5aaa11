// Summary: what a run, or a part of it, has done, for people and as JSON.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "emulator/session.hpp"

namespace imud {

// Of a live run in real time: TruthQuality.
struct ClockSummary {
  double rate = 1, offset_s = 0, delay_s = 0;
  std::uint64_t stops = 0, returns = 0, resumed = 0;
  DurationHistogram jitter, age;
};

struct Summary {
  using Clock = ClockSummary;
  double duration_s = 0;  // host time
  struct Truth {
    std::uint64_t received = 0, accepted = 0, no_state = 0, runs = 0, truncated = 0, inserted = 0, lost = 0;
    std::array<std::uint64_t, static_cast<std::size_t>(Refusal::count)> refused = {};
    double rate_hz = 0;   // truths accepted in a second, by their arrivals
    std::string warning;  // how a capture ended, if not well
  } truth;
  std::optional<Clock> clock;
  struct Imu {
    std::string name;
    std::uint64_t samples = 0, frames = 0, dropped = 0, extrapolated = 0, held = 0, silent = 0, missed = 0;
    DurationHistogram lateness, write;  // empty where no clock paces
    double line_load_percent = 0;       // 0: the line has no rate
  };
  std::vector<Imu> imus;

  // What was done since `before`, an earlier summary of the same run; warning, estimates and loads as they are now.
  Summary since(const Summary& before) const;
};

// `line_loads`: in percent, of each imu. Any thread, at any time.
Summary summarize(const Session& session, double duration_s, const std::vector<double>& line_loads);

std::string text(const Summary& summary);
// One line without its end, for the log.
std::string line(const Summary& summary);
// The contract's JSON: indented, or as one line without its end.
enum class JsonLayout : std::uint8_t { indented, line };
std::string json(const Summary& summary, JsonLayout layout);

}  // namespace imud
