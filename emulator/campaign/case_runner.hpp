// CaseRunner: runs cases of a campaign in this process, one after another.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "emulator/campaign/campaign.hpp"
#include "emulator/campaign/cases/integrated_errors.hpp"
#include "emulator/plan/config.hpp"
#include "emulator/seeds/seed_run.hpp"

namespace imud {

// Keeps the configuration and the decoded capture of the last case, so that a next case which differs in the seed
// alone reads neither again. One thread.
class CaseRunner {
 public:
  // `campaign` must outlive this.
  explicit CaseRunner(const Campaign& campaign) : campaign_(campaign) {}

  // Reads the configuration and the capture of a case. Returns the configuration, valid until the next call. Throws
  // ConfigError or PortError, and OpenError if the capture changes while it is read.
  const Config& prepare(const CampaignCase& one);

  struct Result {
    std::string row;  // JSON in one line (shards/shard.hpp)
    int exit_code = 0;
  };
  struct Shown {
    std::string record = {};  // a file that gets the record of the case; empty: none
    bool of_test = false;     // the output of [test] goes to standard error
    // Receives the rows of each imu, if the campaign has arrays; nullptr: the rows are not kept.
    ShardArrays::Write rows = nullptr;
  };
  // Runs a case. Opens no port but the port of [test]. If the case cannot be run, its row has `error`. Returns
  // nullopt if `stop` has ended the case.
  std::optional<Result> run(std::uint64_t index, const std::atomic<bool>& stop, const Shown& shown);
  // Returns the row of a case that could not be run.
  std::string row_of_failure(std::uint64_t index, const std::string& error) const;

 private:
  struct Prepared {
    std::vector<std::size_t> at;        // the value of each axis
    std::optional<std::uint64_t> draw;  // its number
    Config config;
    std::string identity;                        // identity_without_seed()
    std::shared_ptr<const StoredTruths> truths;  // nullptr: each run reads the capture
    TruthConfig truth;                           // the keys with which the capture was read
    std::string capture;                         // capture_digest() of `truth`
    bool repeats = false;                        // the capture is a record, whose run is repeated
    std::vector<double> line_loads;
    std::vector<TrueSumsOverTime> sums;  // of each imu; empty: to be computed
  };
  void compute_true_sums();
  void check_capture_is_same() const;

  const Campaign& campaign_;
  std::optional<Prepared> prepared_;
};

}  // namespace imud
