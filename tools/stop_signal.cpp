#include "tools/stop_signal.hpp"

#include <csignal>

namespace imud {
namespace {
std::atomic<bool> requested = false, requested_again = false;
static_assert(std::atomic<bool>::is_always_lock_free);
}  // namespace

void catch_stop_signals() {
  struct sigaction action = {};
  action.sa_handler = [](int) {
    (requested.exchange(true) ? requested_again : requested) = true;
  };  // without SA_RESTART: poll, sleep and write return
  ::sigaction(SIGINT, &action, nullptr);
  ::sigaction(SIGTERM, &action, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
}

const std::atomic<bool>& stop_flag() noexcept { return requested; }
bool stop_requested() noexcept { return requested; }
bool stop_requested_again() noexcept { return requested_again; }

}  // namespace imud
