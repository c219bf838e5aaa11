#include "emulator/commands/keep_ptys.hpp"

#include <fmt/format.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <memory>
#include <stdexcept>

#include "transports/file_descriptor.hpp"
#include "transports/uart/pty_keeper.hpp"

namespace imud {

int keep_ptys(const std::vector<std::string>& links, bool background) {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&signals, signal);
  sigprocmask(SIG_BLOCK, &signals, nullptr);
  const FileDescriptor stop(::signalfd(-1, &signals, SFD_CLOEXEC));
  std::vector<std::unique_ptr<PtyKeeper>> keepers;
  for (const std::string& link : links) {
    keepers.push_back(std::make_unique<PtyKeeper>(link));
    fmt::print("{} is held, as {}\n", keepers.back()->link(), keepers.back()->slave());
  }
  std::fflush(stdout);
  if (background && ::daemon(1, 0) != 0)
    throw std::runtime_error(fmt::format("cannot go to the background: {}", std::strerror(errno)));
  PtyKeeper::serve(keepers, stop.get());
  return 0;
}

}  // namespace imud
