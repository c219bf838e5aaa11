// Expectations: what a scenario expects of the flight computer, its [[expect]].
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/time.hpp"
#include "emulator/faults/fault_schedule.hpp"
#include "emulator/ground/table_reader.hpp"
#include "emulator/plan/fault_config.hpp"
#include "emulator/plan/host_bytes.hpp"
#include "transports/port.hpp"

namespace imud {

struct ExpectConfig {
  enum class What : std::uint8_t {
    host_sends,      // the host sends bytes, or those of `pattern`, within the time
    host_is_silent,  // it sends none, or not those of `pattern`, during the time
    host_reopens,    // after the port had no reader, it has one, within the time
  };
  std::string name;  // "expect1" if it has none
  std::string imu;   // whose host
  What what = What::host_sends;
  HostBytes pattern;
  std::optional<std::size_t> fault;  // the number of the fault after which the time begins
  bool after_end = false;            // after its end; false: after its begin
  double at_s = 0;                   // else: s after the begin of the run
  double within_s = 0;               // the length of the time, above 0

  // Describes it in a sentence.
  std::string text() const;
};

// The outcome of an expectation.
struct Expected {
  std::string name, text;
  bool holds = false;
  std::string seen = {};  // what happened: "the host sent it 0.24 s after the begin of the time"
  double duration_s = 0;
};

// Reads an [[expect]]. `imus`: the names of all imus; `faults`: those of the run.
ExpectConfig read_expect(TableReader& table, std::size_t index, const std::vector<std::string>& imus,
                         std::span<const FaultConfig> faults);

// Watches the host of one imu. No allocation after construction; one thread.
class Expectations {
 public:
  // `all`: those of the run; others than those of the imu are ignored.
  Expectations(std::span<const ExpectConfig> all, std::string_view imu);

  bool empty() const noexcept { return watches_.empty(); }
  // A run of the truth begins: what is not decided begins again.
  void begin_run() noexcept;
  // A sample is taken, `time_s` after the begin of the run; called after FaultSchedule::take().
  void take(const FaultSchedule& schedule, double time_s) noexcept;
  // The host has sent bytes, after the last sample.
  void host_sent(std::span<const std::byte> bytes) noexcept;
  // The state of the port.
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

// Returns the results as JUnit XML. `name`: that of the suite.
std::string junit_xml(std::span<const Expected> results, const std::string& name);

}  // namespace imud
