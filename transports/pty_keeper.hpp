// PtyKeeper: holds a pty in a process of its own, so that a client is not hung up while imud restarts.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>

#include "transports/file_descriptor.hpp"
#include "transports/port_spec.hpp"
#include "transports/pty_pair.hpp"

namespace imud {

// Makes the pty of a link, and beside the link the Unix socket LINK.keeper. Whoever connects there receives a copy of
// the master (SCM_RIGHTS, unix(7)) and has the pty until it closes the connection, which the kernel does for a
// process that was killed. A keeper copies no bytes: speed, pace and reader of the line are imud's as without a
// keeper.
class PtyKeeper {
 public:
  // Throws PortError.
  explicit PtyKeeper(const std::string& link);
  ~PtyKeeper();  // removes link and socket

  const std::string& slave() const noexcept { return pty_.slave(); }

  // Serves all `keepers` until the descriptor `stop` is readable.
  static void serve(std::span<const std::unique_ptr<PtyKeeper>> keepers, int stop) noexcept;

 private:
  void accept() noexcept;

  const PortSpec spec_;
  PtyPair pty_;
  const std::string socket_path_;
  FileDescriptor socket_, connection_;
};

// A master that a keeper holds, too.
struct KeptPty {
  FileDescriptor master;
  FileDescriptor connection;  // no other process receives the master until this is closed
};

// Returns the pty that the link's keeper holds; nullopt if the link has no keeper. Throws PortError if the keeper
// does not answer, or if another process has the pty.
std::optional<KeptPty> take_kept_pty(const PortSpec& spec);

}  // namespace imud
