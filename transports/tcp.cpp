// A connection by TCP that this end makes. RFC 9293, tcp(7).
#include <memory>

#include "transports/socket/host_address.hpp"
#include "transports/socket/stream_socket.hpp"

namespace imud {
namespace {

void check(const PortSpec& spec, const PortSettings&) {
  if (HostAddress::parse(spec.address).port == 0)
    throw spec.error("only a listener's port is chosen; right would be the other end's, from 1 to 65535");
  if (SocketAddress::ip(spec).is_multicast())
    throw spec.error("is a multicast group, which TCP does not have; right would be the address of one machine");
}

std::unique_ptr<Port> open(const PortSpec& spec, const PortSettings& settings) {
  return std::make_unique<ConnectingSocket>(SocketAddress::ip(spec), settings.role);
}

std::optional<std::uint16_t> tcp_port(const PortSpec& spec) { return HostAddress::parse(spec.address).port; }

}  // namespace

extern constexpr Transport tcp_transport = {
    .name = "tcp",
    .summary = "a stream of bytes by TCP: connects there, and again when the connection is lost",
    .syntax = "tcp:ADDR:PORT",
    .example = "tcp:127.0.0.1:10001",
    .document = "RFC 9293, tcp(7)",
    .brings_truth = true,
    .has_readers = true,
    .check = check,
    .open = open,
    .tcp_port = tcp_port,
};

}  // namespace imud
