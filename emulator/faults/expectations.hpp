// Expectations: what a scenario expects of the flight computer, its [[expect]].
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "emulator/faults/fault_schedule.hpp"
#include "emulator/plan/expect_config.hpp"
#include "transports/port.hpp"

namespace imud {

// The outcome of an expectation.
struct Expected {
  std::string name, text;
  bool holds = false;
  std::string seen = {};  // what happened: "the host sent it 0.24 s after the begin of the time"
  double duration_s = 0;
};

// Watches the host of one imu. No allocation after construction; one thread.
class Expectations {
 public:
  // `all`: the run's expectations; only the imu's own are used.
  Expectations(std::span<const ExpectConfig> all, std::string_view imu);

  bool empty() const noexcept { return watches_.empty(); }
  // A run of the truth begins: undecided expectations begin again.
  void begin_run() noexcept;
  // A sample is taken, `time_s` after the begin of the run; called after FaultSchedule::take().
  void take(const FaultSchedule& schedule, double time_s) noexcept;
  // The host has sent bytes, after the last sample.
  void host_sent(std::span<const std::byte> bytes) noexcept;
  // The state of the port, without the faults of its wire.
  void port_is(PortState state) noexcept;
  // Called after the last sample.
  std::vector<Expected> results() const;

 private:
  struct Watch {
    const ExpectConfig* config;
    bool was_active = false;             // the fault
    std::optional<double> begin_s = {};  // of the time
    std::optional<double> met_s = {};    // when the host did it
    bool is_over = false;                // the time is over
    HostBytesSearch search = {};
  };
  void meet(Watch& watch) noexcept;

  std::vector<Watch> watches_;
  double now_s_ = 0;
  bool had_no_reader_ = false;
};

// Returns the results as JUnit XML. `name`: the suite's name.
std::string junit_xml(std::span<const Expected> results, const std::string& name);

}  // namespace imud
