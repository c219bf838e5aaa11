// TestCommand: the system under test of a case, which runs beside imud.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <filesystem>
#include <map>
#include <string>

#include "transports/file_descriptor.hpp"

namespace imud {

// Returns the command with `{NAME}` replaced by the value of each name. The value is quoted where the shell would
// otherwise divide it, unless `{NAME}` stands in quotes already: it always is one word, or a part of one.
std::string with_values(std::string command, const std::map<std::string, std::string>& values);

// A shell with all processes that it starts. A supervisor process adopts their orphans. It ends all of them at the
// time limit, by the destructor, and when this process is killed. Then the supervisor removes the folder for files of
// the case, which it has made. One thread.
class TestCommand {
 public:
  struct Options {
    std::string folder;     // the working directory of the command
    double limit_s = 60;    // from the start to the end
    bool is_shown = false;  // its output goes to standard error; otherwise nowhere
  };
  // Starts the supervisor. Throws std::runtime_error if the process or the folder cannot be made.
  explicit TestCommand(const Options& options);
  TestCommand(const TestCommand&) = delete;
  TestCommand& operator=(const TestCommand&) = delete;
  // Ends the command, and waits until the folder for files is removed.
  ~TestCommand();

  // The folder for files of the case, in the folder for temporary files.
  const std::filesystem::path& scratch() const noexcept { return scratch_; }
  // Starts a command of the shell. Call this once. Throws std::runtime_error if the command is too long, or cannot be
  // passed to the supervisor.
  void start(const std::string& command);
  bool has_ended() const noexcept;
  struct End {
    int exit_code = 0;  // 128 and the signal's number if a signal has ended the command
    bool is_timed_out = false;
  };
  // Waits until the command ends; if a signal sets `stop`, the command is killed. On return no process of the command
  // runs.
  End wait(const std::atomic<bool>& stop) noexcept;

 private:
  pid_t supervisor_ = 0;
  FileDescriptor link_;  // to the supervisor, which sends the folder, takes the command, and sends an End
  std::filesystem::path scratch_;
};

}  // namespace imud
