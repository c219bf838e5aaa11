#include "emulator/programs/command_output.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "transports/file_descriptor.hpp"
#include "transports/host_clock.hpp"

namespace imud {

namespace {

struct Ends {
  FileDescriptor own, of_program;
};

Ends output_pipe() {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) throw std::runtime_error(fmt::format("pipe: {}", std::strerror(errno)));
  ::fcntl(ends[0], F_SETFL, O_NONBLOCK);
  return {FileDescriptor(ends[0]), FileDescriptor(ends[1])};
}

// A socket, because a write to a pipe whose reader has ended raises SIGPIPE.
Ends input_socket() {
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
    throw std::runtime_error(fmt::format("socketpair: {}", std::strerror(errno)));
  ::fcntl(ends[0], F_SETFL, O_NONBLOCK);
  return {FileDescriptor(ends[0]), FileDescriptor(ends[1])};
}

// Starts the program. Returns 0, or an error number.
int spawn(pid_t& process, const std::vector<std::string>& words, int input, int output, int errors) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  if (input >= 0)
    posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
  else
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, output, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, errors, STDERR_FILENO);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t signals;
  ::sigemptyset(&signals);
  posix_spawnattr_setsigmask(&attributes, &signals);
  ::sigaddset(&signals, SIGPIPE);
  posix_spawnattr_setsigdefault(&attributes, &signals);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETSIGMASK);
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  const int error = ::posix_spawnp(&process, arguments.front(), &actions, &attributes, arguments.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  return error;
}

// Passes on what there is now; closes the descriptor at the end.
template <class Receive>
void take_output(FileDescriptor& from, const Receive& receive) {
  std::array<char, 65536> part;
  while (from) {
    const ssize_t size = ::read(from.get(), part.data(), part.size());
    if (size > 0)
      receive(std::string_view(part.data(), static_cast<std::size_t>(size)));
    else if (size < 0 && errno == EINTR)
      continue;
    else if (size < 0 && errno == EAGAIN)
      return;
    else
      from.reset();
  }
}

class RunningProgram {
 public:
  explicit RunningProgram(const ProgramCall& call) : call_(&call), rest_(call.input) {
    Ends output = output_pipe(), errors = output_pipe(), input;
    if (!rest_.empty()) input = input_socket();
    if (const int error = spawn(process_, call.words, input.of_program ? input.of_program.get() : -1,
                                output.of_program.get(), errors.of_program.get());
        error != 0) {
      process_ = 0;
      result = {127, false, {}, fmt::format("{}: {}", call.words.front(), std::strerror(error))};
      return;
    }
    output_ = std::move(output.own);
    errors_ = std::move(errors.own);
    input_ = std::move(input.own);
  }

  bool is_running() const noexcept { return process_ != 0; }
  bool has_closed() const noexcept { return !output_ && !errors_; }
  void signal(int number) const noexcept { ::kill(-process_, number); }

  // Adds the descriptors that this waits for.
  void add_to(std::vector<pollfd>& ready) const {
    for (const FileDescriptor* from : {&output_, &errors_})
      if (*from) ready.push_back({from->get(), POLLIN, 0});
    if (input_) ready.push_back({input_.get(), POLLOUT, 0});
  }

  // Writes and reads what is possible now. Ends the waiting if the program has ended.
  void update() {
    while (input_) {
      const ssize_t size = ::send(input_.get(), rest_.data(), rest_.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
      if (size < 0 && (errno == EAGAIN || errno == EINTR)) break;
      rest_.remove_prefix(size < 0 ? rest_.size() : static_cast<std::size_t>(size));
      if (rest_.empty()) input_.reset();
    }
    int status = 0;
    const pid_t ended = ::waitpid(process_, &status, WNOHANG);
    // After waitpid(): what an ended program has written is there.
    take_output(output_, [this](std::string_view text) {
      if (call_->receive)
        call_->receive(text);
      else
        result.output.append(text);
    });
    take_output(errors_, [this](std::string_view text) { result.errors.append(text); });
    if (ended != process_) return;
    result.exit_code = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
    process_ = 0;
    output_.reset();
    errors_.reset();
    input_.reset();
  }

  CommandOutput result;

 private:
  const ProgramCall* call_;
  std::string_view rest_;  // of the input
  FileDescriptor input_, output_, errors_;
  pid_t process_ = 0;  // 0: it does not run
};

}  // namespace

std::vector<CommandOutput> run_commands(std::span<const ProgramCall> calls, std::optional<Nanoseconds> limit,
                                        const std::atomic<bool>& stop) {
  const HostTime begin = host_now();
  std::vector<RunningProgram> programs;
  programs.reserve(calls.size());
  for (const ProgramCall& call : calls) programs.emplace_back(call);
  bool is_stopped = false, is_late = false;
  const auto signal_all = [&programs](int number) {
    for (const RunningProgram& one : programs)
      if (one.is_running()) one.signal(number);
  };
  while (std::ranges::any_of(programs, &RunningProgram::is_running)) {
    if (stop && !is_stopped) {
      is_stopped = true;
      signal_all(SIGTERM);
    }
    if (limit && !is_late && host_now() - begin > *limit) {
      is_late = true;
      for (RunningProgram& one : programs) one.result.is_late = one.is_running();
      signal_all(SIGKILL);
    }
    std::vector<pollfd> ready;
    int look_again_ms = 50;
    for (const RunningProgram& one : programs) {
      if (!one.is_running()) continue;
      one.add_to(ready);
      if (one.has_closed()) look_again_ms = 1;  // it ends now
    }
    ::poll(ready.data(), ready.size(), look_again_ms);
    for (RunningProgram& one : programs)
      if (one.is_running()) one.update();
  }
  std::vector<CommandOutput> results;
  for (RunningProgram& one : programs) results.push_back(std::move(one.result));
  return results;
}

CommandOutput run_command(const std::vector<std::string>& words, const std::atomic<bool>& stop) {
  const ProgramCall call{words, {}};
  return std::move(run_commands(std::span(&call, 1), std::nullopt, stop).front());
}

}  // namespace imud
