// The UNIX sockets of the instances of imud: where they are, and how one is made.
#pragma once

#include <sys/types.h>

#include <string>
#include <utility>
#include <vector>

#include "transports/file_descriptor.hpp"

namespace imud {

// Returns the folders in which instances of this user, and of the system's service, have their sockets, the one for
// new sockets first: $RUNTIME_DIRECTORY of a systemd unit, $XDG_RUNTIME_DIR, /run/imud for root, /tmp/imud-UID.
std::vector<std::string> socket_folders();

// Returns "FOLDER/imud-NAME.sock".
std::string socket_path(const std::string& folder, const std::string& name);

// A listening UNIX socket that only its user can open. The destructor removes the socket.
class ControlSocketFile {
 public:
  // Makes the socket. Replaces a socket to which no process listens any more. Throws OpenError: a process listens,
  // the path is too long or something else than a socket, or the folder cannot be written.
  explicit ControlSocketFile(const std::string& path);
  // Makes the socket of that name in the first of socket_folders() that permits it, and makes the folder. Removes the
  // sockets there that killed runs have left.
  static ControlSocketFile in_folder(const std::string& name);
  ControlSocketFile(ControlSocketFile&& other) noexcept
      : path_(std::exchange(other.path_, {})),
        socket_(std::move(other.socket_)),
        device_(other.device_),
        inode_(other.inode_) {}
  ~ControlSocketFile();

  const std::string& path() const noexcept { return path_; }
  // Returns the descriptor, which the caller owns from then on.
  int release() noexcept;

 private:
  std::string path_;
  FileDescriptor socket_;
  dev_t device_ = 0;  // of the file, which is removed only if it is still this one
  ino_t inode_ = 0;
};

// Connects to a socket. Returns an empty descriptor, with errno, if nobody listens; EAGAIN: a process listens, but
// has accepted no connection for a second while as many as it permits wait.
FileDescriptor connect_to_socket(const std::string& path);

struct Instance {
  std::string name, path;
};
// The instances in socket_folders() and /run/imud: running ones, to whose sockets a process listens, killed ones, and
// sockets of another user, whose processes may run or not.
struct Instances {
  std::vector<Instance> running, killed, foreign;
  // Returns the running instance called `name`; of several, the instance in the first folder. With an empty
  // `name`, returns the only running instance. Returns nullptr if there is no such instance.
  const Instance* running_by_name(const std::string& name) const;
};
Instances find_instances();
// Returns the message for people that explains why running_by_name() has found no instance.
std::string none_text(const Instances& found, const std::string& name);

}  // namespace imud
