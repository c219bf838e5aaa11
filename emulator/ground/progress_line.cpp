#include "emulator/ground/progress_line.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string_view>

#include "transports/host_clock.hpp"

namespace imud {
namespace {

bool is_hidden = false;
std::atomic<bool> is_line_shown = false;

// Returns true if standard error is a terminal that can erase the end of a line.
bool is_terminal() {
  const char* const kind = std::getenv("TERM");
  return ::isatty(STDERR_FILENO) == 1 && kind != nullptr && std::string_view(kind) != "dumb";
}

constexpr Nanoseconds first = std::chrono::milliseconds(500), interval = std::chrono::milliseconds(200);

}  // namespace

std::string rough_time(double time_s) {
  constexpr double minute = 60, hour = 3600, many = 100;
  return time_s < many            ? fmt::format("{:.0f} s", time_s)
         : time_s < many * minute ? fmt::format("{:.0f} min", time_s / minute)
                                  : fmt::format("{:.1f} h", time_s / hour);
}

std::string time_left(double elapsed_s, double done) { return rough_time(elapsed_s * (1 - done) / done); }

ProgressLine::ProgressLine(bool is_wanted)
    : is_active_(is_wanted && !is_hidden && is_terminal()), begin_(host_now()), next_(begin_ + first) {}

void ProgressLine::hide_all() noexcept { is_hidden = true; }

bool ProgressLine::is_due() const noexcept { return is_active_ && host_now() >= next_; }

void ProgressLine::show(double done, std::string_view work) {
  if (!is_due()) return;
  const HostTime now = host_now();
  next_ = now + interval;
  std::string line = fmt::format("{}{:.0f} % of {}", removal(), 100 * done, work);
  if (done > 0) line += fmt::format(", {} left", time_left(seconds(now - begin_), done));
  is_line_shown = true;
  std::fputs(line.c_str(), stderr);
  std::fflush(stderr);
}

void ProgressLine::show(std::uint64_t done, std::uint64_t all, std::string_view things) {
  if (is_due()) show(static_cast<double>(done) / static_cast<double>(all), fmt::format("{} {}", all, things));
}

void ProgressLine::clear() noexcept {
  if (const std::string_view text = removal(); !text.empty()) std::fwrite(text.data(), 1, text.size(), stderr);
}

std::string_view ProgressLine::removal() noexcept {
  return is_line_shown.exchange(false) ? std::string_view("\r\033[K") : std::string_view();
}

}  // namespace imud
