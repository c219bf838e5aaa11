#include "emulator/watch/top.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

#include "emulator/control/line_connection.hpp"
#include "emulator/control/socket_path.hpp"
#include "emulator/watch/terminal.hpp"
#include "emulator/watch/top_view.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

int refuse(std::string_view why, int exit_code) {
  fmt::print(stderr, "imud: {}\n", why);
  return exit_code;
}

// A stopped run reads nothing. A request for which the run's socket has no room is omitted, because sending it
// would block.
void request(LineConnection& run, Json call) {
  pollfd room{run.descriptor(), POLLOUT, 0};
  if (run && (::poll(&room, 1, 0) <= 0 || (room.revents & POLLOUT) == 0)) return;
  Json all = {{"jsonrpc", "2.0"}};
  all.update(call);
  all["id"] = 1;
  run.send(json_line(all));
}

// A message whose types differ from this version's is ignored.
void take(TopView& view, const std::string& line) {
  try {
    if (const Json message = Json::parse(line, nullptr, false); message.is_object()) view.take(message, host_now());
  } catch (const Json::exception&) {
  }
}

// Receives the signals that end the view or change its size, from a descriptor in place of handlers.
class Signals {
 public:
  Signals() {
    sigset_t set;
    sigemptyset(&set);
    for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGWINCH}) sigaddset(&set, signal);
    sigprocmask(SIG_BLOCK, &set, nullptr);
    descriptor_.reset(::signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK));
  }
  int descriptor() const noexcept { return descriptor_.get(); }
  // Returns the next signal; 0 if none is pending.
  int next() {
    signalfd_siginfo info{};
    return ::read(descriptor_.get(), &info, sizeof info) == sizeof info ? static_cast<int>(info.ssi_signo) : 0;
  }

 private:
  FileDescriptor descriptor_;
};

// Shows the run until one of the ends of top(). Returns the signal that ended it, 0 for q, and nullopt if the run
// ended.
std::optional<int> show(LineConnection& run, TopView& view, Signals& signals) {
  Terminal terminal;
  HostTime asked = host_now();
  for (;;) {
    while (const auto line = run.receive(host_now())) take(view, *line);
    if (!run) return std::nullopt;
    for (int key = terminal.read_key(); key != Terminal::none && !view.quits(); key = terminal.read_key())
      if (const Json call = view.take_key(key); !call.is_null()) request(run, call);
    if (view.quits()) return 0;
    for (int signal = signals.next(); signal != 0; signal = signals.next()) {
      if (signal != SIGWINCH) return signal;
      terminal.resize();
    }
    if (host_now() - asked >= 1s) {
      asked = host_now();
      request(run, {{"method", "status"}});
    }
    terminal.show(view.lines(host_now()), view.bottom());
    std::array<pollfd, 3> ready = {
        {{STDIN_FILENO, POLLIN, 0}, {run.descriptor(), POLLIN, 0}, {signals.descriptor(), POLLIN, 0}}};
    ::poll(ready.data(), ready.size(), 500);
    if ((ready[0].revents & (POLLHUP | POLLERR)) != 0) return SIGHUP;  // the terminal is gone
  }
}

}  // namespace

int top(const std::string& name) {
  if (::isatty(STDIN_FILENO) == 0 || ::isatty(STDOUT_FILENO) == 0)
    return refuse(
        "top: standard input or output is no terminal; imud status, and imud ctl subscribe what=counters, print text",
        2);
  const Instances found = find_instances();
  const Instance* const instance = found.running_by_name(name);
  if (instance == nullptr) return refuse(none_text(found, name), 1);
  LineConnection run(connect_to_socket(instance->path));
  TopView view(instance->name);
  if (run) request(run, {{"method", "status"}});
  const auto first = run.receive(host_now() + longest_answer);
  if (!first) return refuse(fmt::format("{} does not answer: its process is stopped or too busy", instance->name), 1);
  take(view, *first);
  request(run, {{"method", "list"}});
  for (const char* what : {"counters", "events"})
    request(run, {{"method", "subscribe"}, {"params", {{"what", what}}}});
  Signals signals;
  std::optional<int> end;
  try {
    end = show(run, view, signals);
  } catch (const std::runtime_error& error) {
    return refuse(fmt::format("top: {}", error.what()), 2);
  }
  if (!end) return refuse(fmt::format("{} has ended", instance->name), 1);
  return *end == 0 || *end == SIGINT ? 0 : 128 + *end;
}

}  // namespace imud
