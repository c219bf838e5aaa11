// PtyReaders: finds ptys that two programs have open, because each byte reaches only one of them.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "core/time.hpp"
#include "emulator/plan/config.hpp"

namespace imud {

// A program that has a terminal open.
struct TerminalClient {
  pid_t process = 0;
  pid_t parent = 0;
  std::string name;
};

using TerminalClients = std::map<std::string, std::vector<TerminalClient>>;

// Sets for each terminal in `clients`, such as /dev/pts/4, the programs that have it open, as far as /proc shows them
// to this user. Leaves out imud itself, and a process whose ancestor has the terminal open, too, because it has
// inherited it. Reads `proc` (proc(5)) once, which takes milliseconds.
void find_terminal_clients(TerminalClients& clients, const std::filesystem::path& proc = "/proc");

// Watches ptys. For the main thread, because it reads /proc.
class PtyReaders {
 public:
  // Watches the ptys of `config` from now on. Does not repeat reports about ptys that it watches already.
  void watch(const Config& config);

  // Looks at the ptys if the last look was `period` ago; logs a warning, once for each pty that several programs have
  // open.
  void update(HostTime now);

  static constexpr Nanoseconds period = std::chrono::seconds(5);

 private:
  struct Pty {
    std::string imu, port, link;
    bool is_reported = false;
  };
  std::vector<Pty> ptys_;
  HostTime next_;
};

}  // namespace imud
