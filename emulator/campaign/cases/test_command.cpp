#include "emulator/campaign/cases/test_command.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <boost/algorithm/string/replace.hpp>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstring>
#include <mutex>
#include <stdexcept>

namespace imud {

namespace {

[[noreturn]] void become(const TestCommand::Start& start) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  ::setpgid(0, 0);
  for (const int signal : {SIGINT, SIGTERM, SIGPIPE, SIGXFSZ}) std::signal(signal, SIG_DFL);
  const int none = ::open("/dev/null", O_RDWR);
  ::dup2(none, STDIN_FILENO);
  ::dup2(start.is_shown ? STDERR_FILENO : none, STDOUT_FILENO);
  if (!start.is_shown) ::dup2(none, STDERR_FILENO);
  constexpr int cannot_run = 126;
  if (::chdir(start.folder.c_str()) != 0) ::_exit(cannot_run);
  ::execl("/bin/sh", "sh", "-c", start.command.c_str(), nullptr);
  ::_exit(cannot_run);
}

}  // namespace

std::string with_values(std::string command, const std::map<std::string, std::string>& values) {
  for (const auto& [name, value] : values) boost::replace_all(command, "{" + name + "}", value);
  return command;
}

TestCommand::TestCommand(const Start& start) : process_(::fork()) {
  if (process_ < 0) throw std::runtime_error(fmt::format("a process of the test: {}", std::strerror(errno)));
  if (process_ == 0) become(start);
  ::setpgid(process_, process_);  // as the child does: who comes first is not known
  watch_ = std::jthread([this, limit = std::chrono::duration<double>(start.limit_s)](const std::stop_token& ended) {
    std::mutex mutex;
    std::unique_lock lock(mutex);
    std::condition_variable_any condition;
    condition.wait_for(lock, ended, limit, [] { return false; });
    if (ended.stop_requested()) return;
    is_timed_out_ = true;
    kill_all();
  });
}

TestCommand::~TestCommand() {
  if (has_ended_) return;
  kill_all();
  const std::atomic<bool> stop = true;
  wait(stop);
}

void TestCommand::kill_all() noexcept { ::kill(-process_, SIGKILL); }

bool TestCommand::has_ended() noexcept {
  siginfo_t info{};
  return has_ended_ || (::waitid(P_PID, static_cast<id_t>(process_), &info, WEXITED | WNOWAIT | WNOHANG) == 0 &&
                        info.si_pid == process_);
}

TestCommand::End TestCommand::wait(const std::atomic<bool>& stop) noexcept {
  // The group outlives its first process, whose number cannot be given to another one before it is waited for.
  siginfo_t info{};
  while (!has_ended_ && ::waitid(P_PID, static_cast<id_t>(process_), &info, WEXITED | WNOWAIT) != 0 && errno == EINTR)
    if (stop) kill_all();
  watch_.request_stop();
  watch_.join();
  kill_all();
  while (!has_ended_ && ::waitpid(process_, &status_, 0) < 0 && errno == EINTR) {
  }
  has_ended_ = true;
  constexpr int by_signal = 128;
  return {WIFSIGNALED(status_) ? by_signal + WTERMSIG(status_) : WEXITSTATUS(status_), is_timed_out_};
}

}  // namespace imud
