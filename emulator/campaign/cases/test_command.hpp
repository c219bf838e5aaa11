// TestCommand: the system under test of a case, which runs beside imud.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <map>
#include <string>
#include <thread>

namespace imud {

// Returns the command with the value of each name in place of `{NAME}`.
std::string with_values(std::string command, const std::map<std::string, std::string>& values);

// A process group of its own, which is killed at the time limit, and by the destructor. One thread.
class TestCommand {
 public:
  struct Start {
    std::string command;    // of the shell
    std::string folder;     // in which it works
    double limit_s = 60;    // from the start to the end
    bool is_shown = false;  // its output goes to standard error; otherwise nowhere
  };
  // Throws std::runtime_error if no process can be started.
  explicit TestCommand(const Start& start);
  TestCommand(const TestCommand&) = delete;
  TestCommand& operator=(const TestCommand&) = delete;
  ~TestCommand();

  bool has_ended() noexcept;
  struct End {
    int exit_code = 0;  // 128 and the signal if one has ended it
    bool is_timed_out = false;
  };
  // Waits until it ends; if a signal sets `stop`, it is killed. Then nothing of the group runs.
  End wait(const std::atomic<bool>& stop) noexcept;

 private:
  void kill_all() noexcept;

  pid_t process_ = 0;  // and the group
  bool has_ended_ = false;
  int status_ = 0;
  std::atomic<bool> is_timed_out_ = false;
  std::jthread watch_;
};

}  // namespace imud
