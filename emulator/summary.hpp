// Summary: the figures of a run, or of a part of it, for people and as JSON.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/counters.hpp"

namespace imud {

struct Summary {
  double duration_s = 0;  // host time
  struct Truth {
    Snapshot<TruthCounters> counters;
    Snapshot<RefusalCounters> refused;
    Snapshot<TruthQuality> quality;
    bool has_clock = false;  // levels and durations of `quality` are valid
    double rate_hz = 0;      // truths accepted in a second, by their arrivals
    std::string warning;     // how a capture ended, if not well
  } truth;
  struct Imu {
    std::string name;
    Snapshot<ImuCounters> counters;  // its durations are empty where no clock paces
    double line_load_percent = 0;    // 0: the line has no rate
  };
  std::vector<Imu> imus;

  // The part of the run after `before`, an earlier summary of it. Warning, levels and loads are those of this one.
  Summary since(const Summary& before) const;
};

// `line_loads`: in percent, one for each imu. Any thread, at any time.
Summary summarize(const RunCounters& counters, double duration_s, const std::vector<double>& line_loads);

// The count of that name: "imu1.samples", "truth.lost", "truth.refused.crc"; "truth.refused" is the sum of all
// causes, "samples" the sum over all imus. nullopt if no counter or no imu has that name.
std::optional<std::uint64_t> find_count(const Summary& summary, std::string_view name);

// The closing summary: several lines, each with its end.
std::string text(const Summary& summary);
// One line without its end, for the log.
std::string line(const Summary& summary);
// The contract's JSON: indented, or as one line without its end.
enum class JsonLayout : std::uint8_t { indented, line };
std::string json(const Summary& summary, JsonLayout layout);

}  // namespace imud
