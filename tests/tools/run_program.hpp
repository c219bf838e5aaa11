// Program: runs one of the built programs, feeds it, signals it, and keeps what it prints.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fstream>
#include <iterator>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "transports/file_descriptor.hpp"

namespace imud {

// A thread reads the output continuously, so that the program never waits for the test. The destructor kills the
// program if it still runs; so does the end of the test program.
class Program {
 public:
  using Timeout = std::chrono::milliseconds;
  // Long enough for a loaded machine under sanitizers; only a test that fails waits so long.
  static constexpr Timeout default_timeout{300'000};

  // "imud" is found in the folder of the built programs; a name with a slash is used as it is.
  explicit Program(const std::string& name)
      : path_(name.find('/') == std::string::npos ? std::string(IMUD_BIN_DIR "/") + name : name) {}
  ~Program() {
    if (is_running()) {
      kill(SIGKILL);
      ::waitpid(child_, nullptr, 0);
    }
  }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  // Starts the program. Call this once. `input`: the whole standard input of the program; nullopt: /dev/null. Throws
  // if the program cannot be run.
  void start(const std::vector<std::string>& arguments, std::optional<std::string> input = {}) {
    if (child_ != 0) throw std::logic_error("Program::start: started already");
    Pipe in, out, err, failure;
    if (!input) in.read.reset(::open("/dev/null", O_RDONLY | O_CLOEXEC));
    std::vector<char*> argv{path_.data()};
    std::vector<std::string> copies = arguments;
    for (std::string& argument : copies) argv.push_back(argument.data());
    argv.push_back(nullptr);

    child_ = ::fork();
    if (child_ < 0) throw std::runtime_error("fork failed");
    if (child_ == 0) {  // only calls that are safe after fork() in a program with threads
      ::prctl(PR_SET_PDEATHSIG, SIGKILL);
      ::dup2(in.read.get(), STDIN_FILENO);
      ::dup2(out.write.get(), STDOUT_FILENO);
      ::dup2(err.write.get(), STDERR_FILENO);
      for (const int signal : {SIGINT, SIGTERM, SIGPIPE, SIGHUP}) std::signal(signal, SIG_DFL);
      ::execv(path_.c_str(), argv.data());
      const int error = errno;
      [[maybe_unused]] const auto written = ::write(failure.write.get(), &error, sizeof error);
      ::_exit(127);
    }
    failure.write.reset();
    int error = 0;
    if (::read(failure.read.get(), &error, sizeof error) == sizeof error) {
      ::waitpid(child_, nullptr, 0);
      exit_code_ = 127;
      throw std::runtime_error(path_ + ": cannot be run: " + std::strerror(error));
    }
    out_.pipe = std::move(out.read);
    err_.pipe = std::move(err.read);
    if (input) {
      in_ = std::move(in.write);
      ::fcntl(in_.get(), F_SETFL, O_NONBLOCK);
      input_ = std::move(*input);
    }
    pump_ = std::jthread([this](std::stop_token stop) { pump(stop); });
  }

  // Waits until the program ends on its own; returns its exit code, or 128 + the signal that ended it. After
  // `timeout` it is killed, the test fails, and -1 is returned.
  int wait(Timeout timeout = default_timeout) {
    const auto until = Clock::now() + timeout;
    while (is_running()) {
      if (Clock::now() > until) {
        kill(SIGKILL);
        ::waitpid(child_, nullptr, 0);
        exit_code_ = -1;
        ADD_FAILURE() << path_ << " did not end in " << timeout.count() << " ms\nstdout:\n"
                      << output() << "\nstderr:\n"
                      << errors();
        break;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    // The last output of the program is still in the pipes. A process that the program left behind may keep them
    // open.
    const auto drained = Clock::now() + std::chrono::seconds(10);
    while (!is_drained() && Clock::now() < drained) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return exit_code_.value_or(-1);
  }

  // Sends a signal; does nothing if the program has ended.
  void kill(int signal = SIGTERM) {
    if (is_running()) ::kill(child_, signal);
  }
  // kill() and wait().
  int stop(int signal = SIGTERM, Timeout timeout = default_timeout) {
    kill(signal);
    return wait(timeout);
  }

  bool is_running() {
    if (child_ <= 0 || exit_code_) return false;
    int status = 0;
    if (::waitpid(child_, &status, WNOHANG) != child_) return true;
    exit_code_ = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
    return false;
  }
  pid_t pid() const { return child_; }

  // Return the text that the program has printed so far.
  std::string output() const { return text(out_); }
  std::string errors() const { return text(err_); }

  // Wait until `text` is part of output() or errors(). Return false after the timeout, or if the program ended
  // without it.
  bool wait_for_output(std::string_view text, Timeout timeout = default_timeout) {
    return wait_for(out_, text, timeout);
  }
  bool wait_for_errors(std::string_view text, Timeout timeout = default_timeout) {
    return wait_for(err_, text, timeout);
  }

  // Closes the reading end of its standard output, as `| head` does.
  void close_output() {
    const std::lock_guard lock(mutex_);
    out_.pipe.reset();
  }

 private:
  using Clock = std::chrono::steady_clock;

  struct Pipe {
    FileDescriptor read, write;
    Pipe() {
      std::array<int, 2> ends{};
      if (::pipe2(ends.data(), O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
      read.reset(ends[0]);
      write.reset(ends[1]);
    }
  };
  struct Stream {
    FileDescriptor pipe;
    std::string text;
  };

  std::string text(const Stream& stream) const {
    const std::lock_guard lock(mutex_);
    return stream.text;
  }
  bool is_drained() const {
    const std::lock_guard lock(mutex_);
    return !out_.pipe && !err_.pipe;
  }

  bool wait_for(const Stream& stream, std::string_view wanted, Timeout timeout) {
    const auto until = Clock::now() + timeout;
    while (true) {
      const bool last_look = !is_running() && is_drained();
      if (text(stream).find(wanted) != std::string::npos) return true;
      if (last_look || Clock::now() > until) return false;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  void pump(const std::stop_token& stop) {
    // A program that ends before it has read everything must not end the test.
    sigset_t broken_pipe;
    ::sigemptyset(&broken_pipe);
    ::sigaddset(&broken_pipe, SIGPIPE);
    ::pthread_sigmask(SIG_BLOCK, &broken_pipe, nullptr);
    while (!stop.stop_requested()) {
      std::array<pollfd, 3> ready{};
      {
        const std::lock_guard lock(mutex_);
        ready = {{{out_.pipe.get(), POLLIN, 0}, {err_.pipe.get(), POLLIN, 0}, {in_.get(), POLLOUT, 0}}};
      }
      if (ready[0].fd < 0 && ready[1].fd < 0) break;
      ::poll(ready.data(), ready.size(), 5);
      const std::lock_guard lock(mutex_);
      take(out_, ready[0]);
      take(err_, ready[1]);
      if (ready[2].revents != 0) give();
    }
  }

  static void take(Stream& stream, const pollfd& ready) {
    if (ready.revents == 0 || stream.pipe.get() != ready.fd) return;
    std::array<char, 65536> buffer;
    const ssize_t size = ::read(stream.pipe.get(), buffer.data(), buffer.size());
    if (size > 0)
      stream.text.append(buffer.data(), static_cast<std::size_t>(size));
    else if (size == 0 || errno != EINTR)
      stream.pipe.reset();
  }

  void give() {
    const ssize_t size = ::write(in_.get(), input_.data() + written_, input_.size() - written_);
    if (size < 0 && (errno == EAGAIN || errno == EINTR)) return;
    if (size >= 0) written_ += static_cast<std::size_t>(size);
    if (size < 0 || written_ == input_.size()) in_.reset();
  }

  std::string path_;
  pid_t child_ = 0;
  std::optional<int> exit_code_;
  mutable std::mutex mutex_;  // guards the members that the pump uses
  FileDescriptor in_;
  std::string input_;
  std::size_t written_ = 0;
  Stream out_, err_;
  std::jthread pump_;  // last: ends before what it uses
};

// The result of a program that has ended.
struct ProgramResult {
  int exit_code = -1;
  std::string output;
  std::string errors;
};

inline ProgramResult run_program(const std::string& name, const std::vector<std::string>& arguments,
                                 std::optional<std::string> input = {}) {
  Program program(name);
  program.start(arguments, std::move(input));
  const int exit_code = program.wait();
  return {exit_code, program.output(), program.errors()};
}

inline std::string read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// Returns the lines, without their LFs.
inline std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    lines.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return lines;
}

// Waits until `condition` holds; returns false if it does not within Program::default_timeout.
template <class Condition>
bool eventually(Condition condition) {
  const auto until = std::chrono::steady_clock::now() + Program::default_timeout;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > until) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

}  // namespace imud
