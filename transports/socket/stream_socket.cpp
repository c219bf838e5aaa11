// socket(7), tcp(7), unix(7).
#include "transports/socket/stream_socket.hpp"

#include <linux/sockios.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/ioctl.h>

#include <cerrno>
#include <utility>

namespace imud {
namespace {

void set_option(int socket, int level, int name, int value) noexcept {
  ::setsockopt(socket, level, name, &value, sizeof value);
}

// A Unix socket ignores the options of TCP.
void configure(int socket) noexcept {
  set_option(socket, IPPROTO_TCP, TCP_NODELAY, 1);
  // A second of 1 kHz in products' frames. The default of some MB would keep a slow reader seconds behind.
  set_option(socket, SOL_SOCKET, SO_SNDBUF, 64 * 1024);
  // A peer that has been silent for 5 s gets a probe each second, and is lost after five unanswered probes.
  set_option(socket, SOL_SOCKET, SO_KEEPALIVE, 1);
  set_option(socket, IPPROTO_TCP, TCP_KEEPIDLE, 5);
  set_option(socket, IPPROTO_TCP, TCP_KEEPINTVL, 1);
  set_option(socket, IPPROTO_TCP, TCP_KEEPCNT, 5);
}

// Returns true if both ends of the connection are the same socket. A process that repeatedly connects to a free
// port of this machine gets this port as its own port by chance at some time; then TCP connects the socket with
// itself.
bool is_own_peer(int socket) noexcept {
  SocketAddress peer;
  peer.size = sizeof peer.storage;
  const SocketAddress own = SocketAddress::bound(socket);
  if ((own.family() != AF_INET && own.family() != AF_INET6) || ::getpeername(socket, peer.room(), &peer.size) != 0)
    return false;
  return own.endpoint() == peer.endpoint();
}

}  // namespace

// A device's port reads little at a time, so that a flood does not delay samples.
StreamSocket::StreamSocket(Role role) : buffer_(role == Role::device ? 256 : 64 * 1024) {
  state_ = PortState::no_reader;
}

bool StreamSocket::has_peer() noexcept {
  if (peer_) return true;
  peer_ = next_peer();
  if (!peer_) return false;
  configure(peer_.get());
  state_ = PortState::ready;
  return true;
}

void StreamSocket::send(std::span<const Frame> frames) noexcept {
  // After a failed output, the remaining input is received before the loss, unless the caller does not receive.
  constexpr Nanoseconds longest_input = std::chrono::milliseconds(500);
  if (output_failed_ && host_now() - *output_failed_ > longest_input) lose();
  if (!has_peer() || output_failed_) {
    counters_.dropped += frames.size();
    return;
  }
  if (writer_.write(peer_.get(), frames, counters_, is_reply_) == 0) return look_after_peer();
  writer_.discard(counters_);
  output_failed_ = host_now();
}

std::optional<Port::Received> StreamSocket::receive() noexcept {
  if (!has_peer()) return std::nullopt;
  const ssize_t size = ::recv(peer_.get(), buffer_.data(), buffer_.size(), MSG_DONTWAIT);
  if (size > 0) {
    ++counters_.received;
    return Received{{{buffer_.data(), static_cast<std::size_t>(size)}}, host_now()};
  }
  if (size == 0 || output_failed_ || (errno != EAGAIN && errno != EINTR))
    lose();
  else
    look_after_peer();
  return std::nullopt;
}

bool StreamSocket::is_drained() noexcept {
  flush();
  int unread = 0;  // bytes that the peer's machine has not acknowledged, or the peer of a Unix socket not read
  return !peer_ || output_failed_ ||
         (writer_.is_idle() && (::ioctl(peer_.get(), SIOCOUTQ, &unread) != 0 || unread == 0));
}

void StreamSocket::look_after_peer() noexcept {
  constexpr Nanoseconds interval = std::chrono::milliseconds(100);
  const HostTime now = host_now();
  if (now - looked_ < interval) return;
  looked_ = now;
  refuse_others();
  if (has_vanished()) lose();
}

// While bytes wait for an acknowledgement there are no probes of SO_KEEPALIVE, and the kernel repeats the bytes for a
// quarter of an hour. (TCP_USER_TIMEOUT would also end the connection to a reader that has only stopped, which
// acknowledges each probe of its window.)
bool StreamSocket::has_vanished() const noexcept {
  constexpr unsigned most = 6;  // repetitions in a row, whose intervals double from 0.2 s on
  tcp_info info{};
  socklen_t size = sizeof info;
  if (::getsockopt(peer_.get(), IPPROTO_TCP, TCP_INFO, &info, &size) != 0) return false;
  return info.tcpi_retransmits >= most || info.tcpi_probes >= most;
}

void StreamSocket::lose() noexcept {
  peer_.reset();
  output_failed_.reset();
  writer_.discard(counters_);
  ++counters_.lost_count;
  state_ = after_loss();
}

FileDescriptor ConnectingSocket::next_peer() noexcept {
  if (!pending_) {
    if (!back_off_.due()) return {};
    pending_.reset(::socket(address_.family(), SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    // An attempt ends after 7 s without an answer. The kernel doubles the intervals of its repetitions, so that a
    // longer attempt would notice late that the machine is back.
    set_option(pending_.get(), IPPROTO_TCP, TCP_SYNCNT, 2);
    if (::connect(pending_.get(), address_.get(), address_.size) != 0 && errno != EINPROGRESS) {
      pending_.reset();
      return {};
    }
  }
  pollfd ready{pending_.get(), POLLOUT, 0};
  if (::poll(&ready, 1, 0) == 0) return {};
  int error = 0;
  socklen_t size = sizeof error;
  if (::getsockopt(pending_.get(), SOL_SOCKET, SO_ERROR, &error, &size) != 0 || error != 0 ||
      is_own_peer(pending_.get()))
    pending_.reset();
  return std::move(pending_);
}

PortState ConnectingSocket::after_loss() noexcept {
  back_off_.start();
  return PortState::lost;
}

ListeningSocket::ListeningSocket(FileDescriptor socket, Role role, std::string chosen_port)
    : StreamSocket(role), socket_(std::move(socket)), chosen_port_(std::move(chosen_port)) {}

FileDescriptor ListeningSocket::next_peer() noexcept {
  return FileDescriptor(::accept4(socket_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
}

void ListeningSocket::refuse_others() noexcept {
  constexpr int most = 16;  // in one call
  for (int i = 0; i < most && next_peer(); ++i) ++counters_.connections_refused;
}

}  // namespace imud
