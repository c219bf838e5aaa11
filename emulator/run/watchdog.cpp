#include "emulator/run/watchdog.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>

#include "core/numbers/number_text.hpp"
#include "emulator/run/readiness.hpp"

namespace imud {

namespace {

// Returns the time within which the manager requires a notification; 0: the manager requires none.
std::chrono::microseconds watchdog_time() {
  const char* const time = std::getenv("WATCHDOG_USEC");
  const char* const process = std::getenv("WATCHDOG_PID");  // left out: of any process
  if (time == nullptr || (process != nullptr && fmt::to_string(::getpid()) != process)) return {};
  return std::chrono::microseconds(std::max<std::int64_t>(0, number_in<std::int64_t>(time).value_or(0)));
}

}  // namespace

Watchdog::Watchdog(boost::asio::io_context& io, const std::atomic<std::uint64_t>& uses, bool is_always)
    : timer_(io), uses_(uses), is_always_(is_always), interval_(watchdog_time() / 4) {
  if (interval_.count() > 0) tick();
}

void Watchdog::tick() {
  const std::uint64_t uses = uses_.load(std::memory_order_relaxed);
  if (is_always_ || uses == 0 || uses != seen_) notify_manager("WATCHDOG=1");
  seen_ = uses;
  timer_.expires_after(interval_);
  timer_.async_wait([this](const boost::system::error_code& error) {
    if (!error) tick();
  });
}

}  // namespace imud
