// The simulators of `imud init`: the [truth] that each needs, and how it is started.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "emulator/plan/config.hpp"

namespace imud {

// A file of emulator/simulators, which CMake builds in: a comment with the simulator's name and way, the comment
// "start: " with what to start, optionally "file: " with the file that contains the simulator's destination port,
// and "place: inertial" if the simulator's N is not Earth-fixed, then TOML.
struct Simulator {
  std::string_view name;
  std::string_view text;

  std::string_view summary() const noexcept;
  std::string_view start() const noexcept;
  std::string_view file() const noexcept;  // empty: there is none
  bool is_inertial() const noexcept;
  std::string_view toml() const noexcept;
};

// Returns all simulators, sorted by name.
std::span<const Simulator> simulators() noexcept;

// The truth of a new configuration.
struct ChosenTruth {
  std::string toml;   // clock, if it is not the default, and [truth], with comments
  std::string start;  // what the user starts; empty: nothing
  bool is_inertial = false;
  std::string remark = {};  // what the user should check
};

// Returns the truth of a simulator, of a truth format or of a capture called `from`. `port` replaces the port of
// the truth, or, if `port` is a number, the number in that port; empty: the simulator's own port. Throws OpenError
// if there is no such name or file, or if no truth format fits the capture.
ChosenTruth choose_truth(const std::string& from, const std::string& port);

}  // namespace imud
