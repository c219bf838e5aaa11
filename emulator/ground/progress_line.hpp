// ProgressLine: shows at a terminal how far long work has come, and the time left.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "core/time.hpp"

namespace imud {

// Returns a time as "90 s", "40 min", "3.5 h".
std::string rough_time(double time_s);
// Returns the time that is left if `done`, from 0 to 1, of the work took `elapsed_s`, as rough_time().
std::string time_left(double elapsed_s, double done);

// A line on standard error that is rewritten at most five times a second, and removed at the end. The line first
// appears half a second after the begin, so that short work shows none. Shows nothing if standard error is no
// terminal. There is one line at a time.
class ProgressLine {
 public:
  // `is_wanted`: false: shows nothing at a terminal either.
  explicit ProgressLine(bool is_wanted = true);
  ~ProgressLine() { clear(); }
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  // Shows no line from now on, for a program that prints rows to the same terminal.
  static void hide_all() noexcept;

  // Returns true if it shows lines at all.
  bool is_active() const noexcept { return is_active_; }
  // Returns true if show() would print.
  bool is_due() const noexcept;
  // Shows `done`, from 0 to 1, if it is due: "42 % of WORK, 90 s left".
  void show(double done, std::string_view work);
  // The share by counts: "42 % of 1000 THINGS, 90 s left".
  void show(std::uint64_t done, std::uint64_t all, std::string_view things);
  // Removes the line, so that other lines may follow. A line of the log removes it by itself.
  void clear() noexcept;
  // Returns the text that removes the line that a terminal shows; empty if no line is shown. Any thread may call
  // this.
  static std::string_view removal() noexcept;

 private:
  const bool is_active_;
  const HostTime begin_;
  HostTime next_;
};

}  // namespace imud
