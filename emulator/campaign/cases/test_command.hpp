// TestCommand: the system under test of a case, which runs beside imud.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <filesystem>
#include <map>
#include <string>

#include "transports/file_descriptor.hpp"

namespace imud {

// Returns the command with the value of each name in place of `{NAME}`, so that it is one word for the shell, or a
// part of one: in quotes where the shell would divide it, unless `{NAME}` stands in quotes already.
std::string with_values(std::string command, const std::map<std::string, std::string>& values);

// A process of the shell with all that it starts. A supervisor, which adopts orphans of it, ends them at the time
// limit, by the destructor, and when this process is killed; then it removes the folder for files of the case, which
// it has made. One thread.
class TestCommand {
 public:
  struct Options {
    std::string folder;     // in which the command works
    double limit_s = 60;    // from the start to the end
    bool is_shown = false;  // its output goes to standard error; otherwise nowhere
  };
  // Starts the supervisor. Throws std::runtime_error if there can be no process or no folder.
  explicit TestCommand(const Options& options);
  TestCommand(const TestCommand&) = delete;
  TestCommand& operator=(const TestCommand&) = delete;
  // Ends the command, and waits until the folder for files is removed.
  ~TestCommand();

  // The folder for files of the case, in the folder for temporary files.
  const std::filesystem::path& scratch() const noexcept { return scratch_; }
  // Starts the command, of the shell; once. Throws std::runtime_error if it is too long or cannot be passed on.
  void start(const std::string& command);
  bool has_ended() const noexcept;
  struct End {
    int exit_code = 0;  // 128 and the signal if one has ended it
    bool is_timed_out = false;
  };
  // Waits until it ends; if a signal sets `stop`, it is killed. Then nothing that it has started runs.
  End wait(const std::atomic<bool>& stop) noexcept;

 private:
  pid_t supervisor_ = 0;
  FileDescriptor link_;  // to the supervisor: it sends the folder, takes the command, and sends an End
  std::filesystem::path scratch_;
};

}  // namespace imud
