// FaultSchedule: which faults act on a sample.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/numbers/random.hpp"
#include "core/sample.hpp"
#include "emulator/faults/fault_log.hpp"
#include "emulator/plan/fault_config.hpp"

namespace imud {

// The faults of one imu, sample by sample. Begins and ends are a function of the faults, the seed and the samples. No
// allocation after construction, no lock; one thread.
class FaultSchedule {
 public:
  // `faults` and `normals` must outlive this. The number of a fault is its index in both; `normals` has elements for
  // faults that are added later, too. Faults that do not act on the imu are ignored. `log` receives begins and ends.
  // `rate_hz` is the rate of the samples.
  FaultSchedule(std::span<const FaultConfig> faults, std::span<const Normals> normals, std::string_view imu,
                std::uint16_t imu_number, double rate_hz, FaultLog& log);
  // Sets the rate of the samples from the next sample on.
  void set_rate(double rate_hz) noexcept;

  bool empty() const noexcept { return states_.empty(); }
  // Returns true if a fault acts on the sample.
  bool acts() const noexcept { return !active_.empty(); }
  // Begins a run. Active faults end with the last sample of the old run. Configured faults begin again. Added faults
  // are removed; faults added before the first run go on in it.
  void begin_run() noexcept;
  // Adds a fault, whose times begin with the next sample. It must outlive this; its number is above all earlier ones.
  void add(const FaultConfig& fault, std::uint32_t number) noexcept;
  // end() ends the fault of this number, end_all() all faults, with the last sample. They do not begin again in this
  // run.
  void end(std::uint32_t number) noexcept;
  void end_all() noexcept;
  // Determines the faults of a sample, `since_begin` after the first sample of its run. `sample` must be without
  // faults, and later than the sample of the last call. `utc_ns`: UTC of the sample, ns since 1970; nullopt if no
  // clock of the host paces the samples.
  void take(const Sample& sample, Nanoseconds since_begin,
            std::optional<std::int64_t> utc_ns = std::nullopt) noexcept;
  // Determines the faults of a sample before the first truth, on which only added faults act. `since` is the time of
  // the sample since any instant.
  void take_at_rest(const Sample& sample, Nanoseconds since,
                    std::optional<std::int64_t> utc_ns = std::nullopt) noexcept;
  // Counts `errors`, of the unit's own solution at the last sample, as effects of the faults that act on that sample
  // or have acted within FaultEvent::effect_s before it. Must not be called if the unit has no solution of its own.
  void judge(const SolutionErrors& errors) noexcept;
  // Returns whether there are added faults.
  bool has_added() const noexcept {
    return std::any_of(states_.begin(), states_.end(), [](const State& state) { return state.is_added; });
  }
  // Returns whether a sample of the truth has been taken.
  bool has_taken() const noexcept { return has_taken_; }
  // The host of the imu has sent bytes. Bytes before the first run count for that run.
  void host_sent(std::span<const std::byte> bytes) noexcept;
  // Ends all faults that act, with the last sample. Called when the run has ended.
  void finish() noexcept;

  // Returns the faults of the sample that act at `seam`, in the order of the configuration.
  std::span<const ActiveFault> active(FaultSeam seam) const noexcept {
    const Range range = ranges_[static_cast<std::size_t>(seam)];
    return std::span(active_).subspan(range.begin, range.size);
  }
  // Returns whether a fault of this name acts on the last sample: of the configuration, or begun by control.
  bool is_active(std::string_view name) const noexcept {
    return std::any_of(states_.begin(), states_.end(),
                       [&](const State& state) { return state.is_active && state.fault->name == name; });
  }
  // Returns the number of the sample in its run, from 0.
  std::uint64_t sample() const noexcept { return next_ - 1; }

 private:
  static constexpr std::size_t seams = 5;

  // The effect of an occurrence on the unit's own solution.
  struct Effect {
    std::uint64_t occurrence;
    bool is_logged;  // the begin of the occurrence
    double until_s;
    SolutionErrors largest = {};
  };
  // Begins and ends are compared in whole ns.
  struct State {
    const FaultConfig* fault;
    std::uint32_t number;
    std::uint64_t occurrence = 0;
    // The number and the time of the sample from which the times of the fault count. nullopt: the sample is not known
    // yet; it will be the next one at which `waits` is false.
    std::optional<std::uint64_t> zero = {};
    Nanoseconds zero_time{0};
    bool is_ended = false;
    bool is_added = false;  // by add()
    bool waits = false;     // for the host
    HostBytesSearch search = {};
    bool is_active = false;
    bool is_logged = false;         // the begin of the occurrence, if `is_active`
    bool is_above = false;          // the condition held at the last sample
    Nanoseconds from{0};            // the time from which begin and end count
    double begin_s = 0, end_s = 0;  // of the occurrence, s after `from`
    Nanoseconds end{0};             // the same end as a time
    std::uint64_t first = 0;        // its first sample
    std::uint64_t earlier = 0;      // active.since at the last change of the rate
    double earlier_s = 0;           // active.since_s at that change
    ActiveFault active = {};
    std::optional<Effect> effect = {};  // of the last occurrence, as long as it is judged
  };
  struct Range {
    std::size_t begin = 0, size = 0;
  };
  double draw(const State& state, const FaultNumber& number, std::uint64_t parameter) const noexcept;
  bool begins(State& state, const Sample& sample, Nanoseconds time) noexcept;
  void take_at(Nanoseconds time, const Sample& sample, std::optional<std::int64_t> utc_ns) noexcept;
  void go_on_after_rest(State& state) const noexcept;
  void insert(const State& state) noexcept;
  void begin(State& state) noexcept;
  void end(State& state) noexcept;
  static State state_of(const FaultConfig& fault, std::uint32_t number) noexcept;
  static bool is_over(const State& state, std::uint64_t sample, Nanoseconds time) noexcept;
  bool log(const State& state, FaultEvent::Kind kind) noexcept;
  void log_effect(State& state) noexcept;

  const std::span<const Normals> normals_;
  const std::uint16_t imu_;
  double rate_hz_, period_s_;
  FaultLog& log_;
  std::vector<State> states_;        // by seam, then by number
  std::vector<ActiveFault> active_;  // by seam, then by number
  Range ranges_[seams];
  std::uint64_t next_ = 0;     // the number of the next sample of the run, or since the fault before the first truth
  std::uint64_t at_rest_ = 0;  // how many samples were taken at rest
  std::uint64_t counter_ = 0;  // Sample::counter of the last sample
  DeviceTime device_time_;     // of that sample
  Nanoseconds time_{0};        // since the begin of the run
  bool is_resting_ = false;    // before the first truth
  bool has_taken_ = false;     // a sample of the truth
  std::int32_t run_ = 0;
};

}  // namespace imud
