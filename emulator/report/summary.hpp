// Summary: the figures of a run, or of an interval of it, as text for people and as JSON.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "emulator/ground/counters.hpp"
#include "emulator/ground/drawn_terms.hpp"
#include "emulator/report/clock_watch.hpp"
#include "emulator/report/outcome.hpp"

namespace imud {

// A figure of an imu's product.
struct DeviceCount {
  std::string_view key, words;  // as DeviceCounter
  std::uint64_t count = 0;
};

std::vector<DeviceCount> device_counts(const DeviceCounters& counters);

struct Summary {
  double duration_s = 0;   // host time
  double simulated_s = 0;  // from the first to the newest truth of each run, summed over the runs
  struct Truth {
    Snapshot<TruthCounters> counters;
    Snapshot<RefusalCounters> refused;
    Snapshot<TruthQuality> quality;
    // The greatest errors that extrapolation has caused in the whole run, TruthQuality::extrapolation_error.
    struct ExtrapolationError {
      std::uint64_t samples = 0;  // samples that were compared with later truth
      double ahead_s = 0, rate_rad_per_s = 0, specific_force_m_per_s2 = 0;
    };
    ExtrapolationError extrapolation_error;
    Snapshot<FitFigures> fit;
    bool has_fit = false;    // `fit` is valid
    bool has_clock = false;  // levels and durations of `quality` are valid
    double rate_hz = 0;      // truths accepted in a second, by their arrivals
    // Host time since the newest accepted truth arrived; nullopt: none has, or truth comes from a capture.
    std::optional<double> since_newest_s;
    double longest_gap_s = 0;
    std::optional<double> progress;    // how much of a capture has been read, from 0 to 1
    std::vector<std::string> remarks;  // of TruthRemarks, and the first refusal of each cause
    std::string warning;               // no truth has come, or how a damaged capture ends; empty: none
  } truth;
  struct Imu {
    std::string name;
    Snapshot<ImuCounters> counters;  // its durations are empty in `lockstep` and `fast`
    std::vector<DeviceCount> device;
    double line_load_percent = 0;   // 0: the line has no bit rate
    std::vector<DrawnTerms> drawn;  // in the summary of the whole run
    // The number of the first sample on the grid from the epoch; nullopt: the grid has no epoch.
    std::optional<std::uint64_t> first_k = std::nullopt;
  };
  std::vector<Imu> imus;
  bool has_record = false;          // the run is recorded
  Snapshot<RecordCounters> record;  // the figures of the record
  bool has_control = false;         // the run can be controlled
  Snapshot<ControlCounters> control;
  std::optional<ClockFigures> clock;  // nullopt: the grids have no epoch

  // Members that only the summary of a whole run has.
  struct Whole {
    Outcome outcome;
    std::uint64_t seed = 0;
    std::string config_sha256;
    // Keys of ports that the system has chosen, with the ports.
    std::vector<std::pair<std::string, std::string>> chosen_ports;
  };
  std::optional<Whole> whole;

  // Returns the figures of the interval since `before`, an earlier summary of the same run. Keeps warning, levels and
  // line loads of this summary.
  Summary since(const Summary& before) const;
};

// Reads the counters. `line_loads`: percent, one for each imu. Any thread may call it at any time.
Summary summarize(const RunCounters& counters, double duration_s, const std::vector<double>& line_loads);

// Returns the count of that name: "imu1.samples", "truth.lost", "truth.refused.crc"; "truth.refused" is the sum of
// all causes, "samples" the sum over all imus. nullopt if no counter or no imu has that name.
std::optional<std::uint64_t> find_count(const Summary& summary, std::string_view name);
// Returns the names of all counts; an imu's counts are without its name.
std::vector<std::string> count_names(const Summary& summary);

// Returns "rate of poses with 0.5 mrad of noise, over 30 to 480 ms (mean 210) to either side: 0.001 rad/s of it", and
// the same of the force.
std::string fit_text(const Snapshot<FitFigures>& fit);
// Returns the closing summary: several lines, each with its line feed.
std::string text(const Summary& summary);
// Returns one line for the log, without a line feed.
std::string line(const Summary& summary);
// The JSON of `--summary` (indented) and of `--quality` (one line, without its line feed).
enum class JsonLayout : std::uint8_t { indented, line };
std::string json(const Summary& summary, JsonLayout layout);

// Describes the greatest errors of extrapolation: "extrapolated by up to 10.0 ms; at this truth rate and motion the
// rate error was up to 0.5 rad/s ...".
std::string extrapolation_text(double ahead_s, double rate_rad_per_s, double specific_force_m_per_s2);
// Returns true if a user should know of such errors: above 1e-3 rad/s, or 1e-2 m/s^2.
bool is_noticeable(double rate_rad_per_s, double specific_force_m_per_s2) noexcept;

}  // namespace imud
