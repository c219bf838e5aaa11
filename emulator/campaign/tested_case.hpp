// TestedCase: a case with the system under test at the port of an imu.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "emulator/campaign/campaign.hpp"
#include "emulator/campaign/cases/test_command.hpp"
#include "emulator/engine/engine.hpp"
#include "emulator/plan/config.hpp"

namespace imud {

// The command of [test] starts when the port is open, and the first sample leaves after the command has opened this
// port. When the case has ended, the port ends for the command, which may then write its metrics. One thread.
class TestedCase {
 public:
  // Gives the first imu of `config` with a serial line, which load_case() requires, a pseudo-terminal in a folder of
  // its own, and a copy of its bytes. `is_shown`: the output of the command goes to standard error. Throws
  // std::runtime_error as TestCommand does.
  TestedCase(const Campaign& campaign, const CampaignCase& one, Config& config, bool is_shown);
  TestedCase(const TestedCase&) = delete;
  TestedCase& operator=(const TestedCase&) = delete;

  // The number of the imu whose line is opened. The first copy of its port carries the bytes of this line.
  std::size_t imu() const noexcept { return imu_; }
  // Starts the command. Returns when it has opened the port and settled, or has ended, after its time limit, or when
  // `stop` is set.
  void begin(Engine& engine, const std::atomic<bool>& stop);
  // Waits until the command ends; if a signal sets `stop`, the command is killed. Adds the command's faults to
  // `shortfalls`. Returns the member `test` of the row.
  nlohmann::ordered_json end(const std::atomic<bool>& stop, std::vector<std::string>& shortfalls);

 private:
  const double limit_s_;
  const std::chrono::duration<double> settles_;
  TestCommand command_;
  std::string text_;  // of the command
  std::size_t imu_ = 0;
  bool has_opened_ = false;
};

}  // namespace imud
