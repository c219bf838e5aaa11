#include "emulator/web/web_socket.hpp"

#include <boost/asio/buffer.hpp>
#include <boost/beast/core/buffers_to_string.hpp>
#include <chrono>
#include <utility>

#include "emulator/web/web_server.hpp"

namespace imud {
namespace {
namespace beast = boost::beast;
namespace websocket = beast::websocket;
}  // namespace

WebSocket::WebSocket(beast::tcp_stream stream, std::shared_ptr<void> guard, ControlCounters& counters)
    : stream_(std::move(stream)), guard_(std::move(guard)), queue_(counters), counters_(counters) {}

void WebSocket::start(const Request& request, const WebApi& api) {
  stream_.next_layer().expires_never();  // the WebSocket has its own time limits
  constexpr std::chrono::seconds limit(WebServer::idle_s);
  stream_.set_option(websocket::stream_base::timeout{limit, limit, true});
  stream_.read_message_max(WebServer::max_request_bytes);
  stream_.text(true);
  api_ = &api;
  stream_.async_accept(request, [self = shared_from_this()](beast::error_code error) {
    if (error || self->api_ == nullptr) return self->close();
    self->is_open_ = true;
    self->begin_writing();
    self->read();
  });
}

void WebSocket::close() {
  api_ = nullptr;
  beast::error_code ignored;
  beast::get_lowest_layer(stream_).socket().close(ignored);
}

void WebSocket::read() {
  stream_.async_read(buffer_, [self = shared_from_this()](beast::error_code error, std::size_t) {
    if (error || self->api_ == nullptr) return self->close();
    if (self->calls_ == max_calls) {
      self->counters_.clients_closed.count();
      return self->close();
    }
    self->execute();
    self->read();
  });
}

void WebSocket::execute() {
  const std::string request = beast::buffers_to_string(buffer_.data());
  buffer_.consume(buffer_.size());
  ++calls_;
  const auto answer = [weak = weak_from_this()](std::string text) {
    const auto self = weak.lock();
    if (self == nullptr) return;
    --self->calls_;
    if (!text.empty()) self->answer(std::move(text));
  };
  (*api_)(request, answer, shared_from_this());
}

void WebSocket::notify(const std::shared_ptr<const std::string>& text, Notification kind) {
  if (api_ == nullptr) return;
  queue_.notify(text, kind);
  begin_writing();
}

void WebSocket::answer(std::string text) {
  if (api_ == nullptr) return;
  if (!queue_.add(std::make_shared<const std::string>(std::move(text)))) return close();
  begin_writing();
}

void WebSocket::begin_writing() {
  if (is_open_ && !is_writing_) write();
}

void WebSocket::write() {
  is_writing_ = !queue_.empty();
  if (!is_writing_) return;
  stream_.async_write(boost::asio::buffer(queue_.front()),
                      [self = shared_from_this()](beast::error_code error, std::size_t) {
                        if (error) return self->close();
                        self->queue_.pop();
                        self->write();
                      });
}

}  // namespace imud
