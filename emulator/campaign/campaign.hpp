// Campaign: a plan of many cases, each of which is a replay. A case is a pure function of the plan and its number.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "emulator/campaign/cases/draws.hpp"
#include "emulator/campaign/shards/shard_arrays.hpp"
#include "emulator/plan/config.hpp"
#include "emulator/seeds/seeds.hpp"

namespace imud {

// One quantity that the cases vary, with its values in the order of the plan.
struct CampaignAxis {
  struct Value {
    std::string text;                    // in tables: a number in its shortest exact form, or a file as in the plan
    std::vector<std::string> overrides;  // as load_config() takes them
    std::string capture;                 // empty: the campaign's
    std::vector<std::string> scenarios;  // after the campaign's
  };
  std::string name;           // a key of the configuration, "capture", "scenario" or "model", or any name
  std::vector<Value> values;  // at least one
  std::uint32_t line = 0;     // in the plan
};

// The system under test, which runs beside each case.
struct CampaignTest {
  std::string command;
  ClockMode clock = ClockMode::fast;  // of the cases; or realtime
  double time_limit_s = 60;
  double settle_s = 0;  // from the opening of the port to the first sample
};

// The request to the job scheduler; an empty text, and 0, leave it to the scheduler.
struct CampaignSlurm {
  std::string partition, account, time_limit;
  unsigned max_running = 0;          // tasks of the array at the same time
  std::vector<std::string> options;  // further options of sbatch
};

struct Campaign {
  static constexpr std::uint64_t most_cases = 1'000'000'000;
  static constexpr std::uint64_t most_array_rows = 1'000'000;

  std::string file;                    // of the plan; absolute
  std::string base;                    // configuration; absolute
  std::string capture;                 // as load_replay() takes it, its path absolute; empty: by an axis
  std::vector<std::string> overrides;  // [set]
  std::vector<std::string> scenarios;  // absolute
  std::vector<CampaignAxis> axes;      // the slowest first; then come the draws, then the seeds
  std::optional<CampaignDraws> draws;
  SeedRange seeds;
  std::uint64_t batch = 0;         // cases of a shard; 0: `campaign run` chooses
  std::string until;               // the text of a StopRule; empty: all cases are run
  bool integrated_errors = false;  // rows have the errors of each imu, integrated over the run
  double errors_every_s = 0;       // rows also have the errors up to instants at these distances; 0: none
  std::uint64_t arrays = 0;        // measurements of each case and imu that are kept as rows; 0: none
  std::optional<CampaignTest> test;
  CampaignSlurm slurm;
  std::string sha256;  // of the plan's text, in hexadecimal
  std::string build;   // of the imud that runs the cases: program_build()

  // Returns the product of the numbers of values, draws and seeds: 1 to most_cases.
  std::uint64_t cases() const noexcept;
};

// Reads a plan, whose keys emulator/campaign/README.md lists. Throws ConfigError with every fault of the plan,
// such as a file that does not exist. Keys of the configuration are not checked here (try_cases()).
Campaign read_campaign(const std::string& path);

// Returns how many figures of integrated errors a case has. `config`: config_of() the case. Reads the capture.
std::size_t error_figures(const Campaign& campaign, const Config& config);

// Returns the shape of the arrays of a campaign. Throws ConfigError.
ArrayShape arrays_of(const Campaign& campaign);
// Returns the bytes of the arrays of a case. `config`: config_of() the case.
std::uint64_t array_bytes(const Campaign& campaign, const Config& config);

struct CampaignCase {
  std::uint64_t index = 0;
  std::uint64_t seed = 0;
  std::vector<std::size_t> at;        // the number of the value of each axis
  std::optional<std::uint64_t> draw;  // its number; nullopt: the plan has no draws
  std::string capture;
  std::vector<std::string> overrides;  // without the seed and the clock
  std::vector<std::string> scenarios;
};

// Returns the case of a number below cases(); throws std::out_of_range for another one. Seeds vary fastest.
CampaignCase case_of(const Campaign& campaign, std::uint64_t index);

// Returns the columns of a table that identify the case, each with its text: every axis in the order of the plan,
// then, if there are draws, "draw" with the number of the draw, and every key that is drawn. All cases have the same
// columns.
std::vector<std::pair<std::string, std::string>> columns_of(const Campaign& campaign, const CampaignCase& c);

// Returns the campaign in which the axis has the value `text` where case `index` has its own value. `text` must have
// the form for tables. Throws OpenError if there is no axis of that name, or if the axis sets other keys than its
// name.
Campaign with_axis_value(const Campaign& campaign, std::uint64_t index, const std::string& axis,
                         const std::string& text);

// Loads the configuration of a case for a replay by the clock `fast`, or by the clock of [test]. Throws ConfigError,
// whose faults name the case. It also throws this if there is a [test] and no imu has a serial line, if by the clock
// `realtime` the capture takes longer than the time limit, or if the errors over time have too many figures for the
// columns of a table.
Config config_of(const Campaign& campaign, const CampaignCase& c);
// Does the same as config_of(), but the errors in a ConfigError do not name the case.
Config load_case(const Campaign& campaign, const CampaignCase& c);

// Returns the SHA-256, in hexadecimal, of everything on which the output bytes of a case depend: the value of every
// key, the content of each file that the configuration names, the version and the build of imud, and [test] as it is
// declared. Paths, the ports of imus (no case opens these), and the tables [control] and [web] are left out.
// `config`: config_of() the case. The digest of a file is computed again only if the file's size or time of change
// differs. Throws OpenError if a file cannot be read. Any thread may call this.
std::string identity_of(const Campaign& campaign, const Config& config);
std::string identity_of(const Campaign& campaign, const CampaignCase& c);
// identity_without_seed() returns a digest that is equal for all cases which differ in the seed alone.
// identity_with_seed() returns the identity of one of these cases.
std::string identity_without_seed(const Campaign& campaign, const Config& config);
std::string identity_with_seed(const std::string& without_seed, std::uint64_t seed);
// Returns a text that changes with the content of the capture. Throws OpenError if the capture cannot be read.
std::string capture_digest(const TruthConfig& truth);

}  // namespace imud
