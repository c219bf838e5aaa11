#include "transports/uart/pty_keeper.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <vector>

#include "transports/uart/pty_access.hpp"

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

FileDescriptor new_socket(int flags = 0) noexcept {
  return FileDescriptor(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | flags, 0));
}

int connect_to(const FileDescriptor& socket, const sockaddr_un& address) noexcept {
  return ::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address);
}

constexpr std::string_view no_answer = "its keeper does not answer; is that process stopped?";

// Returns the connection to the keeper; an empty descriptor if there is no keeper. The socket of a keeper that has
// ended refuses connections. Throws PortError if the keeper does not answer within 2 s; the same limit holds for
// receiving from it.
FileDescriptor connection_to(const PortSpec& spec) {
  std::error_code error;
  if (!std::filesystem::is_socket(socket_of(spec.address), error)) return {};
  const sockaddr_un address = address_of(spec);
  FileDescriptor connection = new_socket();
  const timeval longest{.tv_sec = 2, .tv_usec = 0};
  for (const int limit : {SO_SNDTIMEO, SO_RCVTIMEO})
    ::setsockopt(connection.get(), SOL_SOCKET, limit, &longest, sizeof longest);
  if (connection && connect_to(connection, address) == 0) return connection;
  if (errno == ECONNREFUSED || errno == ENOENT) return {};
  if (errno == EAGAIN) throw spec.error(no_answer);  // the queue of the socket is full of earlier attempts
  throw spec.error(fmt::format("its keeper cannot be reached: {}", std::strerror(errno)));
}

// A message: a speed, and a descriptor beside it (cmsg(3)).
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

  void send(int socket, int descriptor, std::uint32_t speed) noexcept {
    speed_ = speed;
    cmsghdr* control = CMSG_FIRSTHDR(&header_);
    control->cmsg_level = SOL_SOCKET;
    control->cmsg_type = SCM_RIGHTS;
    control->cmsg_len = CMSG_LEN(sizeof descriptor);
    std::memcpy(CMSG_DATA(control), &descriptor, sizeof descriptor);
    static_cast<void>(::sendmsg(socket, &header_, MSG_NOSIGNAL | MSG_DONTWAIT));
  }
  // Returns the descriptor; an empty descriptor with errno if no message has come, or with errno 0 if the other
  // end has closed the connection.
  FileDescriptor receive(int socket) noexcept {
    ssize_t size = 0;
    do size = ::recvmsg(socket, &header_, MSG_CMSG_CLOEXEC);
    while (size < 0 && errno == EINTR);
    if (size < 0) return {};
    errno = 0;
    const cmsghdr* control = CMSG_FIRSTHDR(&header_);
    if (size != sizeof speed_ || control == nullptr || control->cmsg_type != SCM_RIGHTS) return {};
    int fd = -1;
    std::memcpy(&fd, CMSG_DATA(control), sizeof fd);
    return FileDescriptor(fd);
  }
  std::uint32_t speed() const noexcept { return speed_; }

 private:
  std::uint32_t speed_ = 0;
  iovec part_{&speed_, sizeof speed_};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> room_{};
  msghdr header_{};
};

PortSpec spec_of(const std::string& port) {
  if (!port.starts_with("pty:")) return {.scheme = "pty", .address = port, .options = {}};
  PortSpec spec = PortSpec::parse(port);
  spec.allow_only(PtyAccess::options, true);
  return spec;
}

}  // namespace

PtyKeeper::PtyKeeper(const std::string& port)
    : spec_(spec_of(port)), pty_(spec_), socket_path_(socket_of(spec_.address)) {
  const sockaddr_un address = address_of(spec_);
  std::error_code error;
  const bool was_kept = std::filesystem::is_socket(socket_path_, error);
  if (connection_to(spec_)) throw spec_.error("another keeper holds it; stop that one, or choose another name");
  const FileDescriptor slave = pty_.open_slave();
  if (const int failure = PtyAccess(spec_).apply(slave.get()); failure != 0) throw PtyAccess::refusal(spec_, failure);
  // A keeper that was killed has left its link behind; a device may still have the pty of this link.
  pty_.make_link(spec_, was_kept);
  ::unlink(address.sun_path);
  socket_ = new_socket();
  if (!socket_ || ::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
      ::listen(socket_.get(), 8) != 0)
    throw spec_.error(fmt::format("cannot make {}: {}", socket_path_, std::strerror(errno)));
}

PtyKeeper::~PtyKeeper() { ::unlink(socket_path_.c_str()); }

void PtyKeeper::accept() noexcept {
  FileDescriptor next(::accept4(socket_.get(), nullptr, nullptr, SOCK_CLOEXEC));
  if (!next || connection_) return;  // closed without an answer: another process has the pty
  Message().send(next.get(), pty_.master(), speed_);
  connection_ = std::move(next);
}

// A process that has the pty sends the speed that it has set. The connection is closed when that process ends.
void PtyKeeper::receive() noexcept {
  while (connection_) {
    std::uint32_t speed = 0;
    const ssize_t size = ::recv(connection_.get(), &speed, sizeof speed, MSG_DONTWAIT);
    if (size < 0 && errno == EAGAIN) return;
    if (size == sizeof speed)
      speed_ = speed;
    else
      connection_.reset();
  }
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
      if (inputs[1 + 2 * i].revents != 0) keepers[i]->receive();
      if (inputs[2 + 2 * i].revents != 0) keepers[i]->accept();
    }
  } while (inputs[0].revents == 0);
}

void KeptPty::keep_speed(std::uint32_t line_speed) const noexcept {
  static_cast<void>(::send(connection.get(), &line_speed, sizeof line_speed, MSG_NOSIGNAL | MSG_DONTWAIT));
}

std::optional<KeptPty> take_kept_pty(const PortSpec& spec) {
  KeptPty kept;
  kept.connection = connection_to(spec);
  if (!kept.connection) return std::nullopt;
  Message answer;
  kept.master = answer.receive(kept.connection.get());
  if (!kept.master)
    throw spec.error(errno == EAGAIN
                         ? no_answer
                         : "another process has it from its keeper; stop that one, or choose another name");
  kept.speed = answer.speed();
  return kept;
}

NextKeeper::NextKeeper(const PortSpec& spec) : address_(address_of(spec)) {}

std::optional<KeptPty> NextKeeper::take() noexcept {
  if (!connection_) {
    if (!back_off_.due()) return std::nullopt;
    connection_ = new_socket(SOCK_NONBLOCK);
    if (!connection_ || connect_to(connection_, address_) != 0) {
      connection_.reset();
      return std::nullopt;
    }
  }
  Message answer;
  KeptPty kept{.master = answer.receive(connection_.get()), .connection = {}, .speed = answer.speed()};
  if (!kept.master) {
    if (errno != EAGAIN) connection_.reset();
    return std::nullopt;
  }
  kept.connection = std::move(connection_);
  return kept;
}

}  // namespace imud
