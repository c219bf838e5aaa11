// truth_logs: logs of other programs that have a vehicle's attitude and position, which imu-truth converts.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/quantities/truth_assembly.hpp"

namespace imud {

// The states of a log, in the order of their times if the log has them so.
struct LoggedStates {
  // The components are in the axes that are given below, for N and for the body.
  struct State {
    std::int64_t time_ns;
    Quaternion q_NB;  // need not be one of a rotation
    Vector3 r_BN_N;   // m
    Vector3 v_BN_N;   // m/s, if has_velocity
    Vector3 rate_B;   // rad/s, if has_rate
  };
  std::vector<State> states;
  TruthAssembly::Axes axes;
  bool has_velocity = false, has_rate = false;
  std::uint64_t without_position = 0;  // omitted attitudes: the log has no position near their time
  std::string note;                    // says which topic of the log was read
  std::string damage;                  // empty: none
};

// The last lines of STEM.cpp here are the entry STEM_truth_log.
struct TruthLog {
  std::string_view name, extension;  // "ulog", ".ulg"
  std::span<const Setting> settings;
  // Reads a file. Throws std::runtime_error, with the fault and the remedy, if it cannot be read, is another kind of
  // file, or has no attitude and position; the message names its content.
  LoggedStates (*read)(const std::string& path, const Settings& settings);
};

std::span<const TruthLog* const> truth_logs() noexcept;
// Return the log format; nullptr if there is none.
const TruthLog* find_truth_log(std::string_view name) noexcept;
const TruthLog* truth_log_of_file(std::string_view path) noexcept;

// Makes truths of the states.
class LoggedTruths {
 public:
  explicit LoggedTruths(LoggedStates states);
  // Makes the truth of the next state. Returns ok, or why the state was refused; nullopt at the end.
  std::optional<TruthResult> next(Truth& truth);
  const LoggedStates& log() const noexcept { return log_; }
  // Returns the share of the states that were made into truths, from 0 to 1.
  double progress() const noexcept { return static_cast<double>(next_) / static_cast<double>(log_.states.size()); }

 private:
  LoggedStates log_;
  std::vector<TruthField> fields_;
  TruthAssembly assembly_;
  std::size_t next_ = 0;
};

// Calls `read` with the file's bytes, in pieces. Throws std::runtime_error.
void read_log(const std::string& path, const std::function<void(std::span<const std::byte>)>& read);

}  // namespace imud
