// PtyPair: the master of a pseudo-terminal, and a link to its slave. pty(7), ioctl_tty(2).
#pragma once

#include <string>

#include "transports/file_descriptor.hpp"
#include "transports/port_spec.hpp"

namespace imud {

// Sets a terminal to raw mode. Returns false if `fd` is no terminal.
bool make_raw(int fd) noexcept;

// A pty whose slave is raw and was opened and closed once, so that poll() on the master shows whether a client has
// the slave open. The kernel hangs the client up when the last copy of the master is closed.
class PtyPair {
 public:
  // Makes a pty, without a link. Throws PortError.
  explicit PtyPair(const PortSpec& spec);
  // Uses an open master, whose link belongs to another process. Throws PortError if `master` is no master of a
  // pty.
  PtyPair(const PortSpec& spec, FileDescriptor master);
  ~PtyPair();  // removes the link that make_link() has made, if it is still there
  PtyPair(const PtyPair&) = delete;
  PtyPair& operator=(const PtyPair&) = delete;

  // Makes the link spec.address; call it when the slave is ready for clients. Replaces a link that an ended
  // process left behind, and with `replace_served` also a link whose pty is still in use. Throws PortError.
  void make_link(const PortSpec& spec, bool replace_served = false);
  // Uses another open master from now on, whose link belongs to another process. Returns false, and changes
  // nothing, if `master` is no master of a pty.
  bool replace(FileDescriptor master) noexcept;

  // Closes the master, which is -1 from then on, and removes the link that make_link() has made. The kernel hangs the
  // client up, unless another process has the master, too.
  void hang_up() noexcept;
  // After hang_up(): makes another pty, whose slave is raw, without a link. Returns false, with errno, on failure.
  bool renew() noexcept;
  // Makes the link again that hang_up() has removed. Returns false, with errno, on failure, for example because the
  // name is in use by now.
  bool renew_link() const noexcept;

  int master() const noexcept { return master_.get(); }
  const std::string& slave() const noexcept { return slave_; }  // "/dev/pts/3"
  // Opens the slave, without waiting and not as the controlling terminal.
  FileDescriptor open_slave() const noexcept;

 private:
  FileDescriptor master_;
  std::string slave_;
  std::string link_;  // empty if another process owns the link
};

}  // namespace imud
