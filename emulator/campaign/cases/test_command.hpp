// TestCommand: the system under test of a case, which runs beside imud.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <map>
#include <string>

#include "transports/file_descriptor.hpp"

namespace imud {

// Returns the command with the value of each name in place of `{NAME}`, in quotes where the shell would divide it.
std::string with_values(std::string command, const std::map<std::string, std::string>& values);

// A process of the shell with all that it starts. A supervisor, which adopts orphans of it, ends them at the time
// limit, by the destructor, and when this process is killed. One thread.
class TestCommand {
 public:
  struct Start {
    std::string command;         // of the shell
    std::string folder;          // in which it works
    double limit_s = 60;         // from the start to the end
    bool is_shown = false;       // its output goes to standard error; otherwise nowhere
    std::string scratch_folder;  // removed at last, by the supervisor; empty: none
  };
  // Throws std::runtime_error if no process can be started.
  explicit TestCommand(const Start& start);
  TestCommand(const TestCommand&) = delete;
  TestCommand& operator=(const TestCommand&) = delete;
  // Ends the command, and waits until the scratch folder is removed.
  ~TestCommand();

  bool has_ended() const noexcept;
  struct End {
    int exit_code = 0;  // 128 and the signal if one has ended it
    bool is_timed_out = false;
  };
  // Waits until it ends; if a signal sets `stop`, it is killed. Then nothing that it has started runs.
  End wait(const std::atomic<bool>& stop) noexcept;

 private:
  pid_t supervisor_ = 0;
  FileDescriptor link_;  // to the supervisor, which sends an End
};

}  // namespace imud
