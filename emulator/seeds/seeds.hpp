// Seeds: replays of one capture with many seeds, in processes that share the cores.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "emulator/plan/config.hpp"
#include "emulator/run/run.hpp"

namespace imud {

struct SeedRange {
  std::uint64_t first = 1, last = 1;  // both included
  std::uint64_t size() const noexcept { return last - first + 1; }
  // Returns the range of "1..1000", or "7"; nullopt if the text is neither, or of more than ten million seeds.
  static std::optional<SeedRange> parse(std::string_view text) noexcept;
};

struct SeedsOptions {
  std::optional<SeedRange> seeds;  // nullopt: the configuration's seed
  unsigned jobs = 0;               // processes; 0: one for each processor
  std::string npy;                 // path of the arrays, with `{imu}` for the imu's name; empty: none
  bool quiet = false;              // no progress
};

// Replays the capture of `config`, whose clock is `fast`, once for each seed. A run with a seed has the same bytes
// as run() with that seed. In the imus' ports `{seed}` stands for the seed, with leading zeros up to the length of
// the last seed. With `npy` no port of an imu is opened. With fewer seeds than processes, each imu has processes
// of its own. There are two exceptions: runs with a requirement; and captures with truths out of order, because
// the insertion of such truths depends on the samples of all imus.
//
// With `npy`, FILE is a structured array of (seeds, measurements) in the form of imu-decode: each imu's messages,
// decoded. The file with `_truth` before its suffix has the truth at the sample of each measurement. It is an array
// of (measurements), or of (seeds, measurements) where the instants or the order of the measurements depend on the
// seed.
//
// Prints a summary, and the progress on standard error; writes RunOptions::summary_file with a list by seed.
// Returns the worst exit code of a run. Throws as run() does, and PortError if the ports do not suit seeds.
int replay_seeds(const Config& config, const RunOptions& options, const SeedsOptions& seeds);

}  // namespace imud
