// A connection by TCP that the other end makes. RFC 9293, tcp(7).
#include <cerrno>
#include <memory>

#include "transports/socket/host_address.hpp"
#include "transports/socket/stream_socket.hpp"

namespace imud {
namespace {

void check(const PortSpec& spec, const PortSettings&) {
  if (SocketAddress::ip(spec).is_multicast())
    throw spec.error(
        "is a multicast group, which TCP does not have; right would be an address of this machine, or 0.0.0.0 or "
        "[::] for all");
}

std::unique_ptr<Port> open(const PortSpec& spec, const PortSettings& settings) {
  const SocketAddress address = SocketAddress::ip(spec);
  FileDescriptor socket(::socket(address.family(), SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  // Without this option, ended connections would keep the port in use for a minute.
  const int reuse = 1;
  ::setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &reuse, sizeof reuse);
  constexpr int waiting = 8;
  if (::bind(socket.get(), address.get(), address.size) != 0 || ::listen(socket.get(), waiting) != 0)
    throw bind_error(spec, errno);
  std::string chosen = chosen_port_of(spec, socket.get());
  return std::make_unique<ListeningSocket>(std::move(socket), settings.role, std::move(chosen));
}

std::optional<std::uint16_t> tcp_port(const PortSpec& spec) {
  const std::uint16_t port = HostAddress::parse(spec.address).port;
  return port == 0 ? std::nullopt : std::optional(port);
}

}  // namespace

extern constexpr Transport tcp_listen_transport = {
    .name = "tcp-listen",
    .summary = "a stream of bytes by TCP: binds the address, with port 0 a free one, for one connection at a time",
    .syntax = "tcp-listen:ADDR:PORT",
    .example = "tcp-listen:127.0.0.1:9810",
    .document = "RFC 9293, tcp(7)",
    .brings_truth = true,
    .has_readers = true,
    .check = check,
    .open = open,
    .tcp_port = tcp_port,
};

}  // namespace imud
