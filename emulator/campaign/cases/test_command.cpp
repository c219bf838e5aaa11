#include "emulator/campaign/cases/test_command.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <climits>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string_view>
#include <system_error>

#include "emulator/ground/shell_word.hpp"

namespace imud {

namespace {

constexpr int by_signal = 128;  // the shell's exit code of a command that a signal has ended, less the signal

[[noreturn]] void become(const std::string& command, const TestCommand::Options& options) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  ::setpgid(0, 0);
  sigset_t none_blocked;
  sigemptyset(&none_blocked);
  ::sigprocmask(SIG_SETMASK, &none_blocked, nullptr);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGPIPE, SIGXFSZ}) std::signal(signal, SIG_DFL);
  const int none = ::open("/dev/null", O_RDWR);
  ::dup2(none, STDIN_FILENO);
  ::dup2(options.is_shown ? STDERR_FILENO : none, STDOUT_FILENO);
  if (!options.is_shown) ::dup2(none, STDERR_FILENO);
  constexpr int cannot_run = 126;
  if (::chdir(options.folder.c_str()) != 0) ::_exit(cannot_run);
  ::execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
  ::_exit(cannot_run);
}

// Kills the children of this process and waits until none is left: orphans become its children.
void end_children() {
  while (true) {
    std::ifstream children("/proc/thread-self/children");
    bool any = false;
    for (pid_t child = 0; children >> child; any = true) ::kill(child, SIGKILL);
    if (!any || ::waitpid(-1, nullptr, 0) < 0) return;
  }
}

// Gives `kept` the first number after the standard descriptors, and returns this number. Closes all other descriptors
// but the standard ones: a pseudo-terminal then ends when imud closes it.
int close_others(int kept) {
  constexpr int first = STDERR_FILENO + 1;
  if (kept != first) ::dup3(kept, first, O_CLOEXEC);
  ::close_range(first + 1, ~0U, 0);
  return first;
}

// Runs the command until it ends, until its time limit, or until the link has anything to read. No process that the
// command has started is left.
TestCommand::End run_shell(const std::string& text, const TestCommand::Options& options, int link) {
  sigset_t of_children;
  sigemptyset(&of_children);
  sigaddset(&of_children, SIGCHLD);
  ::sigprocmask(SIG_BLOCK, &of_children, nullptr);
  const FileDescriptor deaths(::signalfd(-1, &of_children, SFD_CLOEXEC | SFD_NONBLOCK));
  using Clock = std::chrono::steady_clock;
  const auto limit = Clock::now() + std::chrono::duration<double>(options.limit_s);
  const pid_t command = ::fork();
  if (command == 0) become(text, options);
  TestCommand::End end{by_signal + SIGKILL, false};
  for (bool runs = command > 0; runs;) {
    const double left_s = std::chrono::duration<double>(limit - Clock::now()).count();
    constexpr double most_s = 1000;
    std::array<pollfd, 2> ready{{{link, POLLIN, 0}, {deaths.get(), POLLIN, 0}}};
    ::poll(ready.data(), ready.size(), static_cast<int>(1e3 * std::clamp(left_s + 1e-3, 0.0, most_s)));
    signalfd_siginfo ignored{};
    while (::read(deaths.get(), &ignored, sizeof ignored) > 0) {
    }
    int status = 0;
    for (pid_t ended = 0; runs && (ended = ::waitpid(-1, &status, WNOHANG)) > 0;) {
      if (ended != command) continue;
      runs = false;
      end.exit_code = WIFSIGNALED(status) ? by_signal + WTERMSIG(status) : WEXITSTATUS(status);
    }
    end.is_timed_out = runs && Clock::now() >= limit;
    if (ready[0].revents != 0 || end.is_timed_out) break;
  }
  end_children();
  return end;
}

// Receives a message of at most `size` bytes. Returns an empty text at the link's end.
std::string receive_text(int link, std::size_t size) {
  std::string text(size, '\0');
  ssize_t received = 0;
  while ((received = ::recv(link, text.data(), text.size(), 0)) < 0 && errno == EINTR) {
  }
  text.resize(static_cast<std::size_t>(std::max<ssize_t>(received, 0)));
  return text;
}

constexpr std::size_t longest_command =
    131071;  // MAX_ARG_STRLEN of Linux without the NUL: one word of a command line

// The life of the supervisor: it ends when the link's other end is closed, however that process has ended. Its exit
// code is the error number if there can be no folder.
[[noreturn]] void supervise(const TestCommand::Options& options, int link_of_parent) {
  const int link = close_others(link_of_parent);
  ::setpgid(0, 0);
  ::prctl(PR_SET_CHILD_SUBREAPER, 1);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGPIPE}) std::signal(signal, SIG_IGN);
  std::error_code error;
  std::string scratch = (std::filesystem::temp_directory_path(error) / "imud_case_XXXXXX").string();
  if (error) ::_exit(error.value());
  if (::mkdtemp(scratch.data()) == nullptr) ::_exit(errno);
  ::send(link, scratch.data(), scratch.size(), MSG_NOSIGNAL);
  if (const std::string command = receive_text(link, longest_command); !command.empty()) {
    const TestCommand::End end = run_shell(command, options, link);
    ::send(link, &end, sizeof end, MSG_NOSIGNAL);
    receive_text(link, 1);
  }
  std::filesystem::remove_all(scratch, error);
  ::_exit(0);
}

// Returns a text as a part of a word that stands in quotes already.
std::string within_quotes(std::string_view text, char quote) {
  std::string part;
  for (const char c : text) {
    if (quote == '\'' && c == '\'')
      part += "'\\''";
    else if (quote == '"' && std::string_view("\\\"$`").find(c) != std::string_view::npos)
      part += {'\\', c};
    else
      part += c;
  }
  return part;
}

}  // namespace

std::string with_values(std::string command, const std::map<std::string, std::string>& values) {
  // In one pass: a value may have the name of another one in braces.
  std::string text;
  char quote = '\0';  // within which the place is
  for (std::size_t at = 0; at < command.size();) {
    const std::size_t end = command[at] == '{' ? command.find('}', at) : command.npos;
    const auto value = end == command.npos ? values.end() : values.find(command.substr(at + 1, end - at - 1));
    if (value == values.end()) {
      const char c = command[at++];
      text += c;
      if (c == '\\' && quote != '\'' && at < command.size())
        text += command[at++];
      else if ((c == '\'' || c == '"') && (quote == '\0' || quote == c))
        quote = quote == c ? '\0' : c;
      continue;
    }
    text += quote == '\0' ? shell_word(value->second) : within_quotes(value->second, quote);
    at = end + 1;
  }
  return text;
}

TestCommand::TestCommand(const Options& options) {
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0)
    throw std::runtime_error(fmt::format("a process of the test: {}", std::strerror(errno)));
  link_ = FileDescriptor(ends[0]);
  FileDescriptor other(ends[1]);
  supervisor_ = ::fork();
  if (supervisor_ < 0) throw std::runtime_error(fmt::format("a process of the test: {}", std::strerror(errno)));
  if (supervisor_ == 0) {
    link_.reset();
    supervise(options, other.get());
  }
  other.reset();
  scratch_ = receive_text(link_.get(), PATH_MAX);
  if (!scratch_.empty()) return;
  int status = 0;
  while (::waitpid(supervisor_, &status, 0) < 0 && errno == EINTR) {
  }
  throw std::runtime_error(
      fmt::format("a folder for the files of a test: {}",
                  WIFEXITED(status) ? std::strerror(WEXITSTATUS(status)) : "its process has died"));
}

void TestCommand::start(const std::string& command) {
  if (command.size() > longest_command)
    throw std::runtime_error(fmt::format("a command of {} bytes; Linux allows {}", command.size(), longest_command));
  if (::send(link_.get(), command.data(), command.size(), MSG_NOSIGNAL) < 0)
    throw std::runtime_error(fmt::format("the command cannot be passed on: {}", std::strerror(errno)));
}

TestCommand::~TestCommand() {
  link_.reset();
  while (::waitpid(supervisor_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

bool TestCommand::has_ended() const noexcept {
  pollfd ready{link_.get(), POLLIN, 0};
  return ::poll(&ready, 1, 0) > 0;
}

TestCommand::End TestCommand::wait(const std::atomic<bool>& stop) noexcept {
  End end{by_signal + SIGKILL, false};  // if the supervisor is killed
  pollfd ready{link_.get(), POLLIN, 0};
  constexpr int between_looks_ms = 100;
  while (::poll(&ready, 1, between_looks_ms) <= 0)
    if (stop) ::shutdown(link_.get(), SHUT_WR);
  while (::recv(link_.get(), &end, sizeof end, 0) < 0 && errno == EINTR) {
  }
  return end;
}

}  // namespace imud
