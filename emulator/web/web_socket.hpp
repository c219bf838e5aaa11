// WebSocket: a client of the control protocol in a browser.
#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <cstddef>
#include <memory>
#include <string>

#include "emulator/control/send_queue.hpp"
#include "emulator/web/web_api.hpp"

namespace imud {

// A WebSocket exists until its connection ends, and holds `guard` until then.
class WebSocket : public Subscriber, public std::enable_shared_from_this<WebSocket> {
 public:
  using Request = boost::beast::http::request<boost::beast::http::string_body>;
  static constexpr std::size_t max_calls = 64;  // requests without an answer; a further request ends the connection

  // `counters` outlives this.
  WebSocket(boost::beast::tcp_stream stream, std::shared_ptr<void> guard, ControlCounters& counters);
  // Answers the request for a WebSocket, and begins to read. `api` outlives the connection, or close() is called.
  void start(const Request& request, const WebApi& api);
  void close();
  void notify(const std::shared_ptr<const std::string>& text, Notification kind) override;

 private:
  void read();
  void execute();
  void answer(std::string text);
  void begin_writing();
  void write();

  boost::beast::websocket::stream<boost::beast::tcp_stream> stream_;
  const std::shared_ptr<void> guard_;
  const WebApi* api_ = nullptr;  // nullptr: the connection is closed
  boost::beast::flat_buffer buffer_;
  std::size_t calls_ = 0;  // without an answer
  SendQueue queue_;        // the first text is being written
  ControlCounters& counters_;
  bool is_open_ = false, is_writing_ = false;
};

}  // namespace imud
