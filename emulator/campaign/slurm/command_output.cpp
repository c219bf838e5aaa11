#include "emulator/campaign/slurm/command_output.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <stdexcept>

#include "transports/file_descriptor.hpp"

namespace imud {

namespace {

struct OutputPipe {
  FileDescriptor read, write;
  OutputPipe() {
    std::array<int, 2> ends{};
    if (::pipe2(ends.data(), O_CLOEXEC) != 0) throw std::runtime_error(fmt::format("pipe: {}", std::strerror(errno)));
    read.reset(ends[0]);
    write.reset(ends[1]);
  }
};

// Starts the program. Returns 0, or an error number.
int spawn(pid_t& process, const std::vector<std::string>& words, int output, int errors) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, output, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, errors, STDERR_FILENO);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t signals;
  ::sigemptyset(&signals);
  ::sigaddset(&signals, SIGPIPE);
  posix_spawnattr_setsigdefault(&attributes, &signals);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGDEF);
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  const int error = ::posix_spawnp(&process, arguments.front(), &actions, &attributes, arguments.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  return error;
}

// Appends what there is; closes the descriptor at the end.
void take_output(FileDescriptor& from, const pollfd& ready, std::string& text) {
  if (ready.revents == 0) return;
  std::array<char, 65536> part;
  const ssize_t size = ::read(from.get(), part.data(), part.size());
  if (size > 0)
    text.append(part.data(), static_cast<std::size_t>(size));
  else if (size == 0 || errno != EINTR)
    from.reset();
}

}  // namespace

CommandOutput run_command(const std::vector<std::string>& words, const std::atomic<bool>& stop) {
  OutputPipe output, errors;
  pid_t process = 0;
  if (const int error = spawn(process, words, output.write.get(), errors.write.get()); error != 0)
    return {127, {}, fmt::format("{}: {}", words.front(), std::strerror(error))};
  output.write.reset();
  errors.write.reset();
  CommandOutput result;
  bool is_stopped = false;
  while (output.read || errors.read) {
    if (stop && !is_stopped) is_stopped = ::kill(process, SIGTERM) == 0;
    std::array<pollfd, 2> ready = {{{output.read.get(), POLLIN, 0}, {errors.read.get(), POLLIN, 0}}};
    if (::poll(ready.data(), ready.size(), 200) <= 0) continue;
    take_output(output.read, ready[0], result.output);
    take_output(errors.read, ready[1], result.errors);
  }
  int status = 0;
  while (::waitpid(process, &status, 0) < 0 && errno == EINTR) {
  }
  result.exit_code = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  return result;
}

}  // namespace imud
