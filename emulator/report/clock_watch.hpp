// ClockWatch: the state of the clock on which the grids of samples are.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "emulator/ground/counters.hpp"
#include "emulator/plan/config.hpp"

namespace imud {

// The state that the kernel has of its clock (adjtimex(2)). CLOCK_TAI and CLOCK_REALTIME are one clock apart from
// whole seconds.
struct ClockState {
  int error = 0;  // errno, if the kernel does not give its state; otherwise 0
  bool is_synchronised = false;
  // The estimated and the greatest possible error, as the service that sets the clock has reported them.
  std::int64_t error_us = 0, max_error_us = 0;
  int tai_offset_s = 0;  // TAI less UTC; 0: the kernel has not been given it
};
ClockState read_clock_state() noexcept;

// Returns why grids must not be on the epoch's clock in this state, and the remedy; empty if they may be.
std::string epoch_fault(const RealtimeConfig& config, const ClockState& state);

// The figures of the epoch's clock in a run.
struct ClockFigures {
  Epoch epoch = Epoch::none;
  Snapshot<ClockCounters> counters;
  std::optional<ClockState> state;  // of now; nullopt for Epoch::monotonic, which needs no synchronisation
  // The greatest estimated error of the run, and the seconds in which the clock was not known to be synchronised, of
  // which a part counts as a whole one.
  std::uint64_t largest_error_us = 0, unsynchronised_s = 0;
};
// Returns "clock error 12 us", or "clock not synchronised"; empty without a state.
std::string clock_error_text(const ClockFigures& clock);
// Returns "tai, clock error 12 us (at most 340 us), 0 steps".
std::string text(const ClockFigures& clock);
nlohmann::ordered_json json(const ClockFigures& clock);
// The names of the counts that a limit may be about: the steps, and the figures of the run.
inline constexpr std::array<std::string_view, 3> clock_count_names = {"clock.steps", "clock.error_us",
                                                                      "clock.unsynchronised_s"};
// Returns nullopt for another name, for a figure that the epoch does not have, and for one that is not known because
// the kernel does not give it.
std::optional<std::uint64_t> find_count(const ClockFigures& clock, std::string_view name);

// Reads the state once a second, and logs its changes and the steps of the clock. One thread.
class ClockWatch {
 public:
  // `counters`: nullptr: the grids have no epoch, and there is nothing to watch. `read`: reads the state.
  ClockWatch(const RealtimeConfig& config, const ClockCounters* counters,
             std::function<ClockState()> read = read_clock_state);
  void update(HostTime now);
  std::optional<ClockFigures> figures() const;

 private:
  void count_unsynchronised() noexcept;

  const ClockCounters* const counters_;
  const std::function<ClockState()> read_;
  ClockFigures figures_;
  std::optional<HostTime> last_;  // update
  Nanoseconds unsynchronised_{0};
  HostTime next_;
  std::uint64_t steps_ = 0;  // as logged
};

}  // namespace imud
