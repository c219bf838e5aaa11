#include "emulator/web/http_connection.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/write.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <chrono>
#include <exception>
#include <string_view>
#include <utility>

#include "emulator/web/web_server.hpp"

namespace imud {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;
using Request = http::request<http::string_body>;
using Response = http::response<http::string_body>;

std::string_view view(beast::string_view text) { return {text.data(), text.size()}; }

Response response(const Request& request, http::status status, std::string_view type, std::string body) {
  Response response(status, request.version());
  response.keep_alive(request.keep_alive());
  response.set(http::field::content_type, beast::string_view(type.data(), type.size()));
  response.set(http::field::cache_control, "no-store");
  response.set("X-Content-Type-Options", "nosniff");
  response.set("Content-Security-Policy",
               "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; object-src 'none'");
  response.set("Referrer-Policy", "no-referrer");
  response.set("Cross-Origin-Resource-Policy", "same-origin");
  response.body() = std::move(body);
  response.prepare_payload();
  return response;
}

Response fault(const Request& request, http::status status, std::string_view text) {
  return response(request, status, "text/plain; charset=utf-8", fmt::format("{}\n", text));
}

// Returns the path without the query.
std::string_view path_of(const Request& request) {
  const std::string_view target = view(request.target());
  return target.substr(0, target.find('?'));
}

constexpr std::string_view api_path = "/api";

}  // namespace

HttpConnection::HttpConnection(boost::asio::ip::tcp::socket socket, WebContent& content, std::shared_ptr<void> guard)
    : stream_(std::move(socket)), content_(content), guard_(std::move(guard)) {}

void HttpConnection::read() {
  parser_.emplace();
  parser_->header_limit(WebServer::max_header_bytes);
  parser_->body_limit(WebServer::max_request_bytes);
  stream_.expires_after(std::chrono::seconds(WebServer::idle_s));
  content_.readers.push_back(this);
  http::async_read(stream_, buffer_, *parser_, [self = shared_from_this()](beast::error_code error, std::size_t) {
    std::erase(self->content_.readers, self.get());
    if (!self->guard_) return;  // close()
    if (!error) return self->respond(self->parser_->get());
    Request none;
    none.keep_alive(false);
    if (error == http::error::body_limit)
      self->write(fault(none, http::status::payload_too_large, "the request is too long"));
    else if (error == http::error::header_limit)
      self->write(fault(none, http::status::request_header_fields_too_large, "the header is too long"));
    else if (error.category() == http::make_error_code(http::error::bad_method).category() &&
             error != http::error::end_of_stream && error != http::error::partial_message)
      self->write(fault(none, http::status::bad_request, "no request of HTTP"));
    else
      self->end();
  });
}

bool HttpConnection::close_idle(WebContent& content) {
  std::vector<HttpConnection*>& all = content.readers;
  auto chosen = std::ranges::find_if(all, [](const HttpConnection* one) { return !one->parser_->got_some(); });
  if (chosen == all.end()) chosen = all.begin();
  if (chosen == all.end()) return false;
  HttpConnection* const closed = *chosen;
  all.erase(chosen);
  closed->close();
  return true;
}

void HttpConnection::respond(const Request& request) {
  if (std::optional<Response> refused = refusal(request)) {
    content_.counters->connections_refused.count();
    return write(std::move(*refused));
  }
  if (path_of(request) == api_path && content_.site.api) {
    if (beast::websocket::is_upgrade(request)) return upgrade(request);
    if (request.method() == http::verb::post) return call(request);
    Response wrong =
        fault(request, http::status::method_not_allowed, "POST a request of JSON-RPC 2.0, or a WebSocket");
    wrong.set(http::field::allow, "POST");
    return write(std::move(wrong));
  }
  if (request.method() != http::verb::get && request.method() != http::verb::head) {
    Response wrong = fault(request, http::status::method_not_allowed, "only GET and HEAD");
    wrong.set(http::field::allow, "GET, HEAD");
    return write(std::move(wrong));
  }
  write(get(request));
}

std::optional<Response> HttpConnection::refusal(const Request& request) const {
  const std::string_view host = view(request[http::field::host]);
  if (!is_own_host(host, content_.machine))
    return fault(request, http::status::misdirected_request,
                 "the name of the host is none of imud's; use its address, or localhost");
  if (!is_own_origin(view(request[http::field::origin]), host))
    return fault(request, http::status::forbidden, "the request is of another site's page");
  if (content_.token && !content_.token->is_in(view(request[http::field::authorization]))) {
    Response wrong = fault(request, http::status::unauthorized, "the token is missing or wrong");
    wrong.set(http::field::www_authenticate, "Basic realm=\"imud: user imud, password the token\"");
    return wrong;
  }
  return std::nullopt;
}

Response HttpConnection::get(const Request& request) const {
  const std::string_view path = path_of(request);
  Response found;
  const WebSite& site = content_.site;
  std::optional<WebDocument> document;
  try {
    document = site.document(path, view(request[http::field::accept]));
  } catch (const std::exception& error) {
    return fault(request, http::status::internal_server_error, error.what());
  }
  if (document) {
    found = response(request, http::status::ok, document->type, std::move(document->text));
    found.set(http::field::vary, "Accept");
  } else {
    const auto file = std::ranges::find_if(site.files, [&](const PageFile& f) { return f.path == path; });
    if (file == site.files.end()) return fault(request, http::status::not_found, site.summary);
    found = response(request, http::status::ok, file->type, std::string(file->content));
  }
  if (request.method() == http::verb::head) found.body().clear();  // Content-Length stays
  return found;
}

void HttpConnection::call(const Request& request) {
  // A page of another site cannot send this type: the browser would first ask the server for permission.
  if (!view(request[http::field::content_type]).starts_with("application/json"))
    return write(fault(request, http::status::unsupported_media_type, "give Content-Type: application/json"));
  stream_.expires_never();
  content_.calls.insert(shared_from_this());
  const auto answer = [weak = weak_from_this(), &request](std::string text) {
    const auto self = weak.lock();
    if (self == nullptr) return;
    self->content_.calls.erase(self);
    const auto status = text.empty() ? http::status::no_content : http::status::ok;
    self->write(response(request, status, "application/json", std::move(text)));
  };
  content_.site.api(request.body(), answer, nullptr);
}

void HttpConnection::upgrade(const Request& request) {
  const auto socket = std::make_shared<WebSocket>(std::move(stream_), guard_, *content_.counters);
  content_.sockets.remove_if([](const std::weak_ptr<WebSocket>& other) { return other.expired(); });
  content_.sockets.push_back(socket);
  socket->start(request, content_.site.api);
}

void HttpConnection::write(Response response) {
  response_ = std::move(response);
  stream_.expires_after(std::chrono::seconds(WebServer::idle_s));
  http::async_write(stream_, response_, [self = shared_from_this()](beast::error_code error, std::size_t) {
    if (error || self->response_.need_eof() || !self->response_.keep_alive()) return self->end();
    self->read();
  });
}

void HttpConnection::close() {
  guard_.reset();
  stream_.close();
}

void HttpConnection::end() {
  beast::error_code ignored;
  stream_.socket().shutdown(boost::asio::ip::tcp::socket::shutdown_send, ignored);
}

}  // namespace imud
