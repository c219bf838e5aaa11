#include "tools/stop_signal.hpp"

#include <atomic>
#include <csignal>

namespace imud {

namespace {
std::atomic<unsigned> requests = 0;
static_assert(std::atomic<unsigned>::is_always_lock_free);
}  // namespace

void catch_stop_signals() {
  struct sigaction action = {};
  action.sa_handler = [](int) { ++requests; };  // without SA_RESTART: poll, sleep and write return
  ::sigaction(SIGINT, &action, nullptr);
  ::sigaction(SIGTERM, &action, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
}

bool stop_requested() noexcept { return requests > 0; }
bool stop_requested_again() noexcept { return requests > 1; }

}  // namespace imud
