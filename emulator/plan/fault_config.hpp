// FaultConfig: a [[fault]] as it is configured: what fails, how, and when.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/numbers/random.hpp"
#include "core/time.hpp"
#include "emulator/plan/fault.hpp"
#include "emulator/plan/host_bytes.hpp"
#include "protocols/settings.hpp"

namespace imud {

// A number that is fixed, or is drawn for each occurrence of a fault from the seed of the run.
struct FaultNumber {
  enum class Law : std::uint8_t { fixed, uniform, normal };
  Law law = Law::fixed;
  double a = 0, b = 0;  // fixed: the value a; uniform: from a to b; normal: mean a and standard deviation b

  // Returns the number for a deviate that is uniform in (0, 1).
  double draw(double uniform) const noexcept;
  bool is_fixed() const noexcept { return law == Law::fixed; }
};

// A fault begins at the first sample that fulfils this, at or after its time.
struct FaultCondition {
  enum class Quantity : std::uint8_t { none, rate, specific_force };
  Quantity quantity = Quantity::none;
  double above = 0;  // SI; the sensor's magnitude without this run's faults is above it
};

// Times are s of simulation from the begin of the run. A fault acts on each sample of its imus whose instant lies in
// [begin, end); with numbers of samples, on the samples [first, first + count).
struct FaultConfig {
  static constexpr std::string_view axis_letters = "xyz";

  std::string name;               // in labels; "fault1" if it has none
  std::vector<std::string> imus;  // the names of the imus; fault_of_truth alone for a fault of truth
  const FaultKind* kind = nullptr;
  std::uint8_t target = 0;  // index into FaultKind::targets
  std::uint8_t axes = 7;    // bits of x, y and z
  std::array<FaultNumber, FaultKind::max_parameters> parameters = {};
  FaultNumber begin_s;
  std::optional<std::uint64_t> begin_sample;  // takes the place of begin_s
  // A fault may wait until the host of its imu has sent these bytes, or until this UTC, ns since 1970. Its times, and
  // its numbers of samples, then count from the next sample of a run.
  std::optional<HostBytes> after_host;
  std::optional<std::int64_t> after_utc_ns;
  std::string after_utc_text = {};  // as it was given
  FaultCondition condition;
  FaultNumber duration_s;                // used if has_duration and there is no number of samples
  bool has_duration = false;             // false: to the end of the run
  bool is_optional = false;              // a run in which the fault never begins is complete
  std::optional<std::uint64_t> samples;  // duration
  double ramp_in_s = 0, ramp_out_s = 0;
  double every_s = 0;       // from one occurrence to the next; 0: there is one
  std::uint64_t times = 1;  // occurrences; 0: any number
  double probability = 1;   // of each occurrence
  // The settings of the other unit of each imu, by its name, for a kind that has settings, and the given settings as
  // text; empty: the settings as delivered.
  std::vector<std::pair<std::string, Settings>> settings = {};
  std::string settings_text = {};

  bool waits() const noexcept { return after_host || after_utc_ns; }
  // Returns true if the fault acts on the imu of this name.
  bool acts_on(std::string_view imu) const noexcept;
  // Returns the settings of the other unit in the place of the imu's; nullptr: there is none.
  const Settings* settings_of(std::string_view imu) const noexcept;
  // Returns the target with its axes: "gyro.x".
  std::string target_text() const;
  // Describes the fault in a sentence with its times, for people.
  std::string text() const;
};

// Returns the random numbers of the first `faults` faults of an imu, by their numbers.
std::vector<Normals> fault_normals(std::string_view imu, std::uint64_t seed, std::size_t faults);

}  // namespace imud
