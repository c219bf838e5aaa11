#include "emulator/web/web_server.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <utility>

#include "emulator/web/http_connection.hpp"
#include "transports/port_spec.hpp"

namespace imud {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;

std::string machine_name() {
  std::array<char, 256> name{};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

tcp::endpoint endpoint_of(const std::string& listen) {
  const NumericAddress address = NumericAddress::parse(listen);
  return {asio::ip::make_address(address.address), address.port};
}

}  // namespace

class WebServer::Impl {
 public:
  Impl(asio::io_context& io, const WebConfig& config, const std::string& key) : acceptor_(io), retry_(io) {
    content_.machine = machine_name();
    if (!config.token_file.empty()) content_.token.emplace(Token::read_secret(config.token_file));
    try {
      const tcp::endpoint endpoint = endpoint_of(config.listen);
      acceptor_.open(endpoint.protocol());
      acceptor_.set_option(asio::socket_base::reuse_address(true));
      acceptor_.bind(endpoint);
      acceptor_.listen();
    } catch (const boost::system::system_error& error) {
      throw PortError(fmt::format("{}: {}: {}", key, config.listen, error.code().message()));
    }
  }
  ~Impl() {
    content_.calls.clear();
    for (const std::weak_ptr<WebSocket>& weak : content_.sockets)
      if (const auto socket = weak.lock()) socket->close();
  }

  std::string address() const {
    const tcp::endpoint endpoint = acceptor_.local_endpoint();
    const bool has_colons = endpoint.address().is_v6();
    return fmt::format("{}{}{}:{}", has_colons ? "[" : "", endpoint.address().to_string(), has_colons ? "]" : "",
                       endpoint.port());
  }

  std::size_t connections() const noexcept { return static_cast<std::size_t>(open_.use_count() - 1); }

  void serve(WebSite site, ControlCounters& counters) {
    content_.site = std::move(site);
    content_.counters = &counters;
    accept();
  }

 private:
  void accept() {
    acceptor_.async_accept([this](boost::system::error_code error, tcp::socket socket) {
      if (error == asio::error::operation_aborted) return;
      if (error) return retry();  // for example, too many open files
      if (open_.use_count() > static_cast<long>(max_connections) && !HttpConnection::close_idle(content_)) {
        content_.counters->connections_refused.count();
      } else {
        boost::system::error_code ignored;
        socket.set_option(tcp::no_delay(true), ignored);
        socket.set_option(asio::socket_base::send_buffer_size(SendQueue::most_for_points), ignored);
        std::make_shared<HttpConnection>(std::move(socket), content_, open_)->read();
      }
      accept();
    });
  }
  void retry() {
    retry_.expires_after(std::chrono::milliseconds(100));
    retry_.async_wait([this](boost::system::error_code error) {
      if (!error) accept();
    });
  }

  tcp::acceptor acceptor_;
  asio::steady_timer retry_;
  WebContent content_;
  const std::shared_ptr<void> open_ = std::make_shared<int>(0);  // each connection has a copy
};

WebServer::WebServer(asio::io_context& io, const WebConfig& config, const std::string& key)
    : impl_(std::make_unique<Impl>(io, config, key)) {}
WebServer::~WebServer() = default;

std::string WebServer::address() const { return impl_->address(); }
std::size_t WebServer::connections() const noexcept { return impl_->connections(); }

void WebServer::serve(WebSite site, ControlCounters& counters) { impl_->serve(std::move(site), counters); }

void WebServer::serve(WebApi api, std::function<std::string(MetricsFormat)> metrics, ControlCounters& counters) {
  const auto document = [metrics = std::move(metrics)](std::string_view path,
                                                       std::string_view accept) -> std::optional<WebDocument> {
    if (path != "/metrics") return std::nullopt;
    const MetricsFormat format = metrics_format(accept);
    return WebDocument{media_type(format), metrics(format)};
  };
  serve({page_files(), document, std::move(api), "there is /, /metrics and /api"}, counters);
}

}  // namespace imud
