// HttpConnection: the requests of one connection, until it ends or becomes a WebSocket.
#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/string_body.hpp>
#include <list>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "emulator/web/web_access.hpp"
#include "emulator/web/web_site.hpp"
#include "emulator/web/web_socket.hpp"

namespace imud {

class HttpConnection;

// The answers and the admission rules of the server. Shared by all connections.
struct WebContent {
  std::string machine;            // the name of this machine
  std::optional<WebToken> token;  // nullopt: none is asked for
  WebSite site;
  ControlCounters* counters = nullptr;
  std::list<std::weak_ptr<WebSocket>> sockets;
  std::set<std::shared_ptr<HttpConnection>> calls;  // connections that wait for an answer
  std::vector<HttpConnection*> readers;             // connections that wait for a request, the longest first
};

class HttpConnection : public std::enable_shared_from_this<HttpConnection> {
 public:
  // The connection holds `guard` until it is destroyed. `content` must exist while events are handled.
  HttpConnection(boost::asio::ip::tcp::socket socket, WebContent& content, std::shared_ptr<void> guard);
  void read();
  // Closes the connection that has waited longest for a request, to make room for a new one. Closes a connection with
  // a part of a request only if there is no other. Returns false if all are busy or WebSockets.
  static bool close_idle(WebContent& content);

 private:
  using Request = boost::beast::http::request<boost::beast::http::string_body>;
  using Response = boost::beast::http::response<boost::beast::http::string_body>;

  void respond(const Request& request);
  // Returns the response that refuses the request; nullopt if the request is admitted.
  std::optional<Response> refusal(const Request& request) const;
  // Returns the response to a GET or HEAD.
  Response get(const Request& request) const;
  void call(const Request& request);
  void upgrade(const Request& request);
  void write(Response response);
  void end();
  void close();

  boost::beast::tcp_stream stream_;
  WebContent& content_;
  std::shared_ptr<void> guard_;
  boost::beast::flat_buffer buffer_;
  std::optional<boost::beast::http::request_parser<boost::beast::http::string_body>> parser_;
  Response response_;
};

}  // namespace imud
