// A connection to a Unix socket. unix(7).
#include <memory>

#include "transports/socket/stream_socket.hpp"

namespace imud {
namespace {

void check(const PortSpec& spec, const PortSettings&) { static_cast<void>(SocketAddress::unix_path(spec)); }

std::unique_ptr<Port> open(const PortSpec& spec, const PortSettings& settings) {
  return std::make_unique<ConnectingSocket>(SocketAddress::unix_path(spec), settings.role);
}

}  // namespace

extern constexpr Transport unix_transport = {
    .name = "unix",
    .summary = "a stream of bytes by a Unix socket: connects to it, and again when the connection is lost",
    .syntax = "unix:PATH",
    .example = "unix:/run/simulator/truth",
    .document = "unix(7)",
    .brings_truth = true,
    .has_path = true,
    .has_readers = true,
    .check = check,
    .open = open,
};

}  // namespace imud
