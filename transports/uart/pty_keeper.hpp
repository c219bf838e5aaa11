// PtyKeeper: holds a pty in a process of its own, so that a client is not hung up while imud restarts.
#pragma once

#include <sys/un.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "transports/file_descriptor.hpp"
#include "transports/host_clock.hpp"
#include "transports/port_spec.hpp"
#include "transports/uart/pty_pair.hpp"

namespace imud {

// Makes the pty of a link, and beside the link the Unix socket LINK.keeper. A process that connects to this socket
// receives a copy of the master (SCM_RIGHTS, unix(7)) and has the pty until the connection is closed; the kernel
// closes the connection of a process that was killed. A keeper copies no bytes: imud handles the line's speed,
// pace and reader in the same way as without a keeper.
class PtyKeeper {
 public:
  // `port`: "LINK", or "pty:LINK" with the options of PtyAccess. Throws PortError.
  explicit PtyKeeper(const std::string& port);
  ~PtyKeeper();  // removes link and socket

  const std::string& link() const noexcept { return spec_.address; }
  const std::string& slave() const noexcept { return pty_.slave(); }

  // Serves all `keepers` until the descriptor `stop` is readable.
  static void serve(std::span<const std::unique_ptr<PtyKeeper>> keepers, int stop) noexcept;

 private:
  void accept() noexcept;
  void receive() noexcept;

  const PortSpec spec_;
  PtyPair pty_;
  const std::string socket_path_;
  FileDescriptor socket_, connection_;
  std::uint32_t speed_ = 0;  // bit/s, set by a process that had the pty; 0: never set
};

// A copy of the master of a pty that a keeper holds, too.
struct KeptPty {
  FileDescriptor master;
  FileDescriptor connection;  // no other process receives the master until this is closed
  std::uint32_t speed = 0;    // bit/s, set by a process that had the pty before; 0: never set
  // Tells the keeper to pass `line_speed`, bit/s, to the next process, which then knows that no client has set
  // this speed. Does not wait.
  void keep_speed(std::uint32_t line_speed) const noexcept;
};

// Returns the pty that the link's keeper holds; nullopt if the link has no keeper. Throws PortError if the keeper
// does not answer within 2 s, or if another process has the pty.
std::optional<KeptPty> take_kept_pty(const PortSpec& spec);

// Connects to a new keeper after the old keeper has ended. After construction nothing here waits, allocates or
// throws.
class NextKeeper {
 public:
  explicit NextKeeper(const PortSpec& spec);  // throws PortError if the link is too long for a keeper
  // Begins the search: the first attempt is due in 100 ms, see BackOff.
  void start() noexcept { back_off_.start(); }
  // Returns the pty of the next keeper as soon as there is one; call it periodically.
  std::optional<KeptPty> take() noexcept;

 private:
  sockaddr_un address_;
  FileDescriptor connection_;  // to a keeper that has not answered yet
  BackOff back_off_;
};

}  // namespace imud
