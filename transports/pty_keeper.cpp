#include "transports/pty_keeper.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <vector>

namespace imud {
namespace {

std::string socket_of(const std::string& link) { return link + ".keeper"; }

sockaddr_un address_of(const PortSpec& spec) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string path = socket_of(spec.address);
  if (path.size() >= sizeof address.sun_path)
    throw spec.error(fmt::format("the path is too long for a keeper; give at most {} characters",
                                 sizeof address.sun_path - (path.size() - spec.address.size()) - 1));
  std::memcpy(address.sun_path, path.c_str(), path.size());
  return address;
}

FileDescriptor new_socket() noexcept { return FileDescriptor(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0)); }

// Returns the connection; none if there is no keeper. A socket whose keeper has ended refuses.
FileDescriptor connection_to(const PortSpec& spec) {
  std::error_code error;
  if (!std::filesystem::is_socket(socket_of(spec.address), error)) return {};
  const sockaddr_un address = address_of(spec);
  FileDescriptor connection = new_socket();
  if (connection && ::connect(connection.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0)
    return connection;
  if (errno == ECONNREFUSED || errno == ENOENT) return {};
  throw spec.error(fmt::format("its keeper cannot be reached: {}", std::strerror(errno)));
}

// One byte with a descriptor (cmsg(3)).
class Message {
 public:
  Message() noexcept {
    header_.msg_iov = &part_;
    header_.msg_iovlen = 1;
    header_.msg_control = room_.data();
    header_.msg_controllen = room_.size();
  }
  Message(const Message&) = delete;
  Message& operator=(const Message&) = delete;

  void send(int socket, int descriptor) noexcept {
    cmsghdr* control = CMSG_FIRSTHDR(&header_);
    control->cmsg_level = SOL_SOCKET;
    control->cmsg_type = SCM_RIGHTS;
    control->cmsg_len = CMSG_LEN(sizeof descriptor);
    std::memcpy(CMSG_DATA(control), &descriptor, sizeof descriptor);
    static_cast<void>(::sendmsg(socket, &header_, MSG_NOSIGNAL | MSG_DONTWAIT));
  }
  // Returns the descriptor; none if the other end has closed the connection or is too slow.
  FileDescriptor receive(int socket) noexcept {
    if (::recvmsg(socket, &header_, MSG_CMSG_CLOEXEC) != 1) return {};
    const cmsghdr* control = CMSG_FIRSTHDR(&header_);
    if (control == nullptr || control->cmsg_type != SCM_RIGHTS) return {};
    int fd = -1;
    std::memcpy(&fd, CMSG_DATA(control), sizeof fd);
    return FileDescriptor(fd);
  }

 private:
  char byte_ = 0;
  iovec part_{&byte_, 1};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> room_{};
  msghdr header_{};
};

}  // namespace

PtyKeeper::PtyKeeper(const std::string& link)
    : spec_{.scheme = "pty", .address = link, .options = {}}, pty_(spec_), socket_path_(socket_of(link)) {
  const sockaddr_un address = address_of(spec_);
  if (connection_to(spec_)) throw spec_.error("another keeper holds it; stop that one, or choose another name");
  ::unlink(address.sun_path);  // of a keeper that has ended
  socket_ = new_socket();
  if (!socket_ || ::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
      ::listen(socket_.get(), 8) != 0)
    throw spec_.error(fmt::format("cannot make {}: {}", socket_path_, std::strerror(errno)));
}

PtyKeeper::~PtyKeeper() { ::unlink(socket_path_.c_str()); }

void PtyKeeper::accept() noexcept {
  FileDescriptor next(::accept4(socket_.get(), nullptr, nullptr, SOCK_CLOEXEC));
  if (!next || connection_) return;  // closed without an answer: another process has the pty
  Message().send(next.get(), pty_.master());
  connection_ = std::move(next);
}

void PtyKeeper::serve(std::span<const std::unique_ptr<PtyKeeper>> keepers, int stop) noexcept {
  std::vector<pollfd> inputs;
  do {
    inputs.assign(1, {stop, POLLIN, 0});
    for (const auto& keeper : keepers) {
      inputs.push_back({keeper->connection_.get(), POLLIN, 0});
      inputs.push_back({keeper->socket_.get(), POLLIN, 0});
    }
    ::poll(inputs.data(), inputs.size(), -1);
    for (std::size_t i = 0; i < keepers.size(); ++i) {
      // A process that ends before another one begins has closed its connection before that one connects.
      if (inputs[1 + 2 * i].revents != 0) keepers[i]->connection_.reset();
      if (inputs[2 + 2 * i].revents != 0) keepers[i]->accept();
    }
  } while (inputs[0].revents == 0);
}

std::optional<KeptPty> take_kept_pty(const PortSpec& spec) {
  KeptPty kept;
  kept.connection = connection_to(spec);
  if (!kept.connection) return std::nullopt;
  const timeval longest{.tv_sec = 2, .tv_usec = 0};
  ::setsockopt(kept.connection.get(), SOL_SOCKET, SO_RCVTIMEO, &longest, sizeof longest);
  kept.master = Message().receive(kept.connection.get());
  if (!kept.master) throw spec.error("another process has it from its keeper; stop that one, or choose another name");
  return kept;
}

}  // namespace imud
