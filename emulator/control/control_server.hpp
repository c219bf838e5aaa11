// ControlServer: the control protocol over a UNIX socket, and over TCP on a loopback address.
#pragma once

#include <sys/types.h>

#include <boost/asio/basic_socket_acceptor.hpp>
#include <boost/asio/generic/stream_protocol.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/local/stream_protocol.hpp>
#include <boost/asio/steady_timer.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "emulator/control/control_api.hpp"
#include "emulator/control/socket_path.hpp"
#include "emulator/control/token.hpp"
#include "emulator/plan/config.hpp"

namespace imud {

// Serves one JSON text a line. A client of the UNIX socket must be of the same user, or root. A client of TCP must
// show the token first. Runs in the io_context's thread.
class ControlServer {
 public:
  static constexpr std::size_t most_clients = 128;  // further clients are refused

  // Opens the configured socket and port. `name`: the instance's name. Throws OpenError, but omits the socket "auto"
  // if there is no place for it.
  ControlServer(boost::asio::io_context& io, const ControlConfig& config, const std::string& name);
  // Serves clients, including clients that have connected since the construction. `api` outlives this.
  void start(ControlApi& api);
  // Closes all connections. Queued texts that fit into the system's buffers are sent.
  ~ControlServer();

  // The path of the socket; empty: there is none. The port of TCP; nullopt: it does not listen.
  std::string path() const { return socket_ ? socket_->path() : std::string(); }
  std::optional<std::uint16_t> port() const;
  // Returns the number of connected clients; some may not have shown the token yet.
  std::size_t clients() const noexcept;

  class Client;

 private:
  void accept_local();
  void accept_tcp();
  void accept_later(const boost::system::error_code& error, void (ControlServer::*accept)(),
                    boost::asio::steady_timer& retry);
  void add(boost::asio::generic::stream_protocol::socket socket, bool needs_token);

  boost::asio::io_context& io_;
  ControlApi* api_ = nullptr;
  std::optional<ControlSocketFile> socket_;
  std::optional<boost::asio::local::stream_protocol::acceptor> local_;
  std::optional<boost::asio::ip::tcp::acceptor> tcp_;
  boost::asio::steady_timer retry_local_, retry_tcp_;
  bool refusal_reported_ = false;
  std::optional<Token> token_;
  std::vector<std::weak_ptr<Client>> clients_;
};

// Returns whether a process of the user `peer` may control an imud of the user `own`: the same user, and root.
constexpr bool may_control(uid_t peer, uid_t own) noexcept { return peer == own || peer == 0; }

}  // namespace imud
