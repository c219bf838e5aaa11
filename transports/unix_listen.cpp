// A Unix socket that this end makes. unix(7).
#include <fmt/format.h>
#include <poll.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string_view>

#include "transports/file/output_path.hpp"
#include "transports/socket/stream_socket.hpp"

namespace imud {
namespace {

FileDescriptor new_socket() noexcept {
  return FileDescriptor(::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
}

SocketAddress address_of(const PortSpec& spec, const std::string& path) {
  PortSpec at = spec;
  at.address = path;
  return SocketAddress::unix_path(at);
}

// Returns true if a process listens at the socket, or has the address without listening.
bool is_served(const SocketAddress& address) noexcept {
  const FileDescriptor probe = new_socket();
  return ::connect(probe.get(), address.get(), address.size) == 0 || (errno != ECONNREFUSED && errno != ENOENT);
}

// Renames the socket at `fresh`, which listens already, to `path`. Replaces a socket at `path` whose process has
// ended. Returns 0, or the errno; EADDRINUSE: another process serves the socket there; EEXIST: another file is
// there.
int name_socket(const PortSpec& spec, const std::string& fresh, const std::string& path) {
  const std::string aside = fresh + "-";
  for (int attempt = 0; attempt < 3; ++attempt) {
    if (::link(fresh.c_str(), path.c_str()) == 0) return 0;
    if (errno != EEXIST) return errno;
    std::error_code error;
    if (!is_socket(std::filesystem::symlink_status(path, error))) return EEXIST;
    if (is_served(SocketAddress::unix_path(spec))) return EADDRINUSE;
    // Another process may do the same now. The process that moves the old socket away also removes that socket. A
    // process that has moved the new socket of the other process instead puts the new socket back.
    if (::rename(path.c_str(), aside.c_str()) != 0) continue;
    if (is_served(address_of(spec, aside))) return ::rename(aside.c_str(), path.c_str()) == 0 ? EADDRINUSE : errno;
    ::unlink(aside.c_str());
  }
  return EADDRINUSE;
}

class UnixListener final : public ListeningSocket {
 public:
  UnixListener(FileDescriptor socket, Role role, const std::string& path)
      : ListeningSocket(std::move(socket), role), path_(std::filesystem::absolute(path).string()) {
    ::lstat(path_.c_str(), &made_);
  }
  // Removes the socket, unless it was replaced.
  ~UnixListener() override {
    struct stat now {};
    if (::lstat(path_.c_str(), &now) == 0 && now.st_ino == made_.st_ino && now.st_dev == made_.st_dev)
      ::unlink(path_.c_str());
  }

 private:
  const std::string path_;
  struct stat made_ {};
};

void check(const PortSpec& spec, const PortSettings&) {
  static_cast<void>(SocketAddress::unix_path(spec));
  constexpr std::size_t longest = sizeof sockaddr_un::sun_path - 1 - std::string_view(".4194304-").size() - 1;
  if (spec.address.size() > longest)
    throw spec.error(fmt::format("the path is too long for a socket; right would be at most {} characters", longest));
}

std::unique_ptr<Port> open(const PortSpec& spec, const PortSettings& settings) {
  const std::string& path = spec.address;
  if (const std::string fault = foreign_link_fault(path); !fault.empty()) throw spec.error(fault);
  // The socket gets its name when it has its permissions and listens.
  const std::string fresh = fmt::format("{}.{}", path, ::getpid());
  const SocketAddress address = address_of(spec, fresh);
  FileDescriptor socket = new_socket();
  constexpr int waiting = 8;
  ::unlink(fresh.c_str());
  // The file takes the mode of the descriptor.
  int error = ::fchmod(socket.get(), S_IRUSR | S_IWUSR) == 0 &&
                      ::bind(socket.get(), address.get(), address.size) == 0 && ::listen(socket.get(), waiting) == 0
                  ? 0
                  : errno;
  if (error == 0) error = name_socket(spec, fresh, path);
  ::unlink(fresh.c_str());
  if (error == EEXIST) throw spec.error("exists and is not a socket; it is left alone, choose another name");
  if (error == EADDRINUSE)
    throw spec.error("another process serves it, or has only begun to; stop that one, or choose another name");
  if (error != 0) throw spec.error(fmt::format("cannot make the socket: {}", std::strerror(error)));
  return std::make_unique<UnixListener>(std::move(socket), settings.role, path);
}

}  // namespace

extern constexpr Transport unix_listen_transport = {
    .name = "unix-listen",
    .summary = "a stream of bytes by a Unix socket: makes it, for one connection of this user at a time",
    .syntax = "unix-listen:PATH",
    .example = "unix-listen:/run/imud/truth",
    .document = "unix(7)",
    .brings_truth = true,
    .has_path = true,
    .has_readers = true,
    .check = check,
    .open = open,
};

}  // namespace imud
