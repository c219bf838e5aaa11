// WebServer: who is answered, limits, and slow clients, with a control protocol of the test.
#include "emulator/web/web_server.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/read_until.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core/buffers_to_string.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <fstream>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "emulator/config/load_config.hpp"
#include "emulator/control/send_queue.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/plan/config.hpp"
#include "emulator/web/web_access.hpp"
#include "tests/support/text.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "transports/port_spec.hpp"

namespace imud {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
using asio::ip::tcp;
using BrowserSocket = beast::websocket::stream<tcp::socket>;

TEST(WebAccess, HostsOfOtherSitesAreRefused) {
  for (const char* own : {"127.0.0.1:8080", "127.0.0.1", "localhost:9000", "LOCALHOST", "[::1]:8080", "192.168.0.5",
                          "bench7:8080", "Bench7"})
    EXPECT_TRUE(is_own_host(own, "bench7")) << own;
  for (const char* other : {"", "evil.example:8080", "localhost.evil.example", "127.0.0.1.evil.example",
                            "bench7.evil", "[evil.example]:80", "[", ":", "127.0.0.1@evil.example"})
    EXPECT_FALSE(is_own_host(other, "bench7")) << other;
  EXPECT_FALSE(is_own_host("", ""));
}

TEST(WebAccess, OriginsOfOtherSitesAreRefused) {
  EXPECT_TRUE(is_own_origin("", "127.0.0.1:8080"));
  EXPECT_TRUE(is_own_origin("http://127.0.0.1:8080", "127.0.0.1:8080"));
  EXPECT_TRUE(is_own_origin("https://bench7", "bench7"));
  for (const char* other : {"null", "http://127.0.0.1:8081", "http://evil.example", "127.0.0.1:8080", "file://",
                            "http://127.0.0.1:8080.evil.example"})
    EXPECT_FALSE(is_own_origin(other, "127.0.0.1:8080")) << other;
}

TEST(WebAccess, TokensAreComparedWhole) {
  const WebToken token("0123456789abcdef");
  EXPECT_TRUE(token.is_in("Bearer 0123456789abcdef"));
  // RFC 7617: base64 of "imud:0123456789abcdef", by Python's base64.b64encode.
  EXPECT_TRUE(token.is_in("Basic aW11ZDowMTIzNDU2Nzg5YWJjZGVm"));
  EXPECT_TRUE(WebToken("0123456789abcdef0").is_in("Basic aW11ZDowMTIzNDU2Nzg5YWJjZGVmMA=="));
  for (const char* wrong : {"", "Bearer", "Bearer ", "Bearer 0123456789abcdeg", "Bearer 0123456789abcdef0",
                            "Basic 0123456789abcdef", "0123456789abcdef"})
    EXPECT_FALSE(token.is_in(wrong)) << wrong;
}

TEST(WebConfigTest, OtherMachinesNeedTheToken) {
  const ScratchFolder folder;
  const std::string path = folder / "imu.toml";
  std::ofstream(path)
      << "[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nprotocol = \"stim300\"\nport = \"pty:imu1\"\n";
  const auto fault = [&](const std::vector<std::string>& assignments) -> std::string {
    try {
      load_config(path, assignments);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(load_config(path).web.listen, "");
  EXPECT_EQ(load_config(path, std::vector<std::string>{"web.listen=[::1]:0"}).web.listen, "[::1]:0");
  EXPECT_TRUE(contains(fault({"web.listen=0.0.0.0:8080"}), "give web.token_file"));
  EXPECT_EQ(fault({"web.listen=0.0.0.0:8080", "web.token_file=token"}), "");
  for (const char* wrong : {"localhost:8080", "8080", "127.0.0.1", "127.0.0.1:65536", "127.0.0.1:8080 "})
    EXPECT_TRUE(contains(fault({fmt::format("web.listen=\"{}\"", wrong)}), "numeric address and a port")) << wrong;
}

class WebServerTest : public testing::Test {
 protected:
  ~WebServerTest() override { stop(); }

  void start(WebConfig config = {"127.0.0.1:0", ""}) {
    server_.emplace(io_, config);
    port_ = server_->address().substr(server_->address().rfind(':') + 1);
    server_->serve(
        [this](std::string_view request, const std::function<void(std::string)>& answer,
               const std::shared_ptr<Subscriber>& client) {
          if (request == "subscribe") client_ = client;
          if (request == "never") return;
          answer(request == "nothing" ? "" : "answer to " + std::string(request));
        },
        [](MetricsFormat format) { return format == MetricsFormat::text ? "metrics\n" : "open metrics\n"; },
        counters_);
    thread_ = std::thread([this] { io_.run(); });
  }
  void stop() {
    if (!thread_.joinable()) return;
    io_.stop();
    thread_.join();
    server_.reset();
  }
  // Calls the function in the server's thread.
  void in_server(const std::function<void()>& function) {
    std::promise<void> done;
    asio::post(io_, [&] {
      function();
      done.set_value();
    });
    done.get_future().wait();
  }

  tcp::socket connected() {
    tcp::socket socket(client_io_);
    socket.connect({asio::ip::make_address("127.0.0.1"), static_cast<std::uint16_t>(std::stoi(port_))});
    return socket;
  }
  // Returns all that the server sends until it closes the connection.
  static std::string read_all(tcp::socket& socket) {
    std::string text;
    boost::system::error_code error;
    asio::read(socket, asio::dynamic_buffer(text), error);
    return text;
  }
  // Sends a request, whose connection the server closes after it, and returns the response.
  std::string response(const std::string& request_line, const std::string& headers = {}, const std::string& body = {},
                       const std::string& host = "127.0.0.1") {
    tcp::socket socket = connected();
    std::string text = fmt::format("{} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n{}", request_line, host, headers);
    if (!body.empty()) text += fmt::format("Content-Length: {}\r\n", body.size());
    boost::system::error_code error;
    asio::write(socket, asio::buffer(text + "\r\n" + body), error);
    return read_all(socket);
  }
  BrowserSocket browser() {
    BrowserSocket socket(connected());
    socket.handshake("127.0.0.1:" + port_, "/api");
    return socket;
  }
  static std::string exchange(BrowserSocket& socket, const std::string& text) {
    socket.write(asio::buffer(text));
    return read(socket);
  }
  static std::string read(BrowserSocket& socket) {
    beast::flat_buffer buffer;
    socket.read(buffer);
    return beast::buffers_to_string(buffer.data());
  }

  ControlCounters counters_;
  asio::io_context io_, client_io_;
  std::optional<WebServer> server_;
  std::string port_;
  std::weak_ptr<Subscriber> client_;  // the newest that has subscribed
  std::thread thread_;
};

const std::string json_type = "Content-Type: application/json\r\n";

TEST_F(WebServerTest, AnswersRequests) {
  start();
  const std::string page = response("GET /");
  EXPECT_TRUE(page.starts_with("HTTP/1.1 200 ")) << page;
  EXPECT_TRUE(contains(page, "Content-Security-Policy: default-src 'self'"));
  EXPECT_TRUE(contains(page, "<title>imud</title>"));
  for (const char* file : {"/main.js", "/style.css", "/chart.min.js?version=3"})
    EXPECT_TRUE(response(fmt::format("GET {}", file)).starts_with("HTTP/1.1 200 ")) << file;
  EXPECT_TRUE(response("GET /metrics").ends_with("\r\n\r\nmetrics\n"));
  EXPECT_TRUE(contains(response("GET /metrics"), "\r\nContent-Type: text/plain; version=0.0.4; charset=utf-8\r\n"));
  EXPECT_TRUE(
      response("GET /metrics", "Accept: application/openmetrics-text\r\n").ends_with("\r\n\r\nopen metrics\n"));
  EXPECT_TRUE(response("HEAD /metrics").ends_with("\r\n\r\n"));
  EXPECT_TRUE(response("POST /api", json_type, "a").ends_with("\r\n\r\nanswer to a"));
  EXPECT_TRUE(response("POST /api", json_type, "nothing").starts_with("HTTP/1.1 204 "));
  for (const char* other : {"/../etc/passwd", "/%2e%2e/etc/passwd", "/page/main.js", "//main.js", "/index.html", "*"})
    EXPECT_TRUE(response(fmt::format("GET {}", other)).starts_with("HTTP/1.1 404 ")) << other;
  EXPECT_TRUE(response("DELETE /").starts_with("HTTP/1.1 405 "));
  EXPECT_TRUE(response("GET /api").starts_with("HTTP/1.1 405 "));
  EXPECT_TRUE(response("no request at all, but much text").starts_with("HTTP/1.1 400 "));
}

TEST_F(WebServerTest, RefusesOthers) {
  start();
  EXPECT_TRUE(response("GET /", "", "", "evil.example").starts_with("HTTP/1.1 421 "));
  const std::string foreign = "Origin: http://evil.example\r\n";
  EXPECT_TRUE(response("POST /api", json_type + foreign, "a").starts_with("HTTP/1.1 403 "));
  EXPECT_TRUE(response("POST /api", "Content-Type: text/plain\r\n", "a").starts_with("HTTP/1.1 415 "));
  EXPECT_TRUE(
      response("GET /api", foreign + "Connection: Upgrade\r\nUpgrade: websocket\r\n").starts_with("HTTP/1.1 403 "));
  EXPECT_TRUE(response("GET /", "Many: " + std::string(WebServer::max_header_bytes, 'x') + "\r\n")
                  .starts_with("HTTP/1.1 431 "));
  // The server does not read so long a body, and may close the connection before the answer is read.
  const std::string longer = response("POST /api", json_type, std::string(WebServer::max_request_bytes + 1, 'x'));
  EXPECT_TRUE(longer.empty() || longer.starts_with("HTTP/1.1 413 ")) << longer;
}

TEST_F(WebServerTest, AsksForTheToken) {
  const ScratchFolder folder;
  std::ofstream(folder / "short") << "too short\n";
  EXPECT_THROW(WebServer(io_, {"127.0.0.1:0", folder / "short"}), OpenError);
  EXPECT_THROW(WebServer(io_, {"127.0.0.1:0", folder / "absent"}), OpenError);
  std::ofstream(folder / "token") << "0123456789abcdef\nthe rest of the file\n";
  EXPECT_THROW(WebServer(io_, {"127.0.0.1:0", folder / "token"}), OpenError) << "others can read it";
  for (const char* file : {"short", "token"}) ASSERT_EQ(::chmod((folder / file).c_str(), 0600), 0);
  EXPECT_THROW(WebServer(io_, {"127.0.0.1:0", folder / "short"}), OpenError);
  start({"127.0.0.1:0", folder / "token"});
  for (const char* path : {"GET /", "GET /metrics", "POST /api", "GET /absent"}) {
    EXPECT_TRUE(response(path, json_type, "a").starts_with("HTTP/1.1 401 ")) << path;
    EXPECT_FALSE(
        response(path, json_type + "Authorization: Bearer 0123456789abcdef\r\n", "a").starts_with("HTTP/1.1 401 "))
        << path;
  }
}

TEST_F(WebServerTest, AnAddressInUseIsAnError) {
  start();
  EXPECT_THROW(WebServer(io_, {"127.0.0.1:" + port_, ""}), PortError);
}

TEST_F(WebServerTest, AWebSocketHasAnswersAndNotifications) {
  start();
  BrowserSocket socket = browser();
  EXPECT_EQ(exchange(socket, "a"), "answer to a");
  EXPECT_EQ(exchange(socket, "subscribe"), "answer to subscribe");
  in_server([&] { client_.lock()->notify(std::make_shared<const std::string>("news"), Notification::points); });
  EXPECT_EQ(read(socket), "news");
  socket.close(beast::websocket::close_code::normal);
  in_server([] {});
  for (int i = 0; i < 6000 && !client_.expired(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_TRUE(client_.expired());
}

// It gets the first and the newest points, all events, and the others nothing of it.
TEST_F(WebServerTest, ASlowWebSocketLosesNotifications) {
  start();
  BrowserSocket slow = browser(), other = browser();
  exchange(slow, "subscribe");
  constexpr int sent = 20'000;  // 20 MB
  const auto client = client_.lock();
  const auto notify = [&](std::string text, Notification kind) {
    client->notify(std::make_shared<const std::string>(std::move(text)), kind);
  };
  constexpr int points_per_event = 100;
  for (int i = 0; i < sent; ++i)
    in_server([&] {
      notify(fmt::format("{:>1000}", i), Notification::points);
      if (i % points_per_event == 0) notify(fmt::format("event {}", i), Notification::event);
    });
  EXPECT_EQ(exchange(other, "a"), "answer to a");
  slow.write(asio::buffer(std::string("end")));
  int received = 0, events = 0;
  for (std::string text; (text = read(slow)) != "answer to end";)
    if (text.starts_with("event "))
      EXPECT_EQ(text, fmt::format("event {}", points_per_event * events++));
    else
      ++received;
  EXPECT_GT(received, 50);
  EXPECT_LT(received, sent / 2);
  EXPECT_EQ(events, sent / points_per_event);
  EXPECT_EQ(counters_.notifications_lost, static_cast<std::uint64_t>(sent - received));
  EXPECT_EQ(counters_.events_lost, 0U);
}

TEST_F(WebServerTest, EventsOfASlowWebSocketAreBoundedToo) {
  start();
  BrowserSocket slow = browser();
  exchange(slow, "subscribe");
  constexpr int sent = 20'000;
  const auto client = client_.lock();
  for (int i = 0; i < sent; ++i)
    in_server([&] {
      client->notify(std::make_shared<const std::string>(fmt::format("{:>1000}", i)), Notification::event);
    });
  slow.write(asio::buffer(std::string("end")));
  int received = 0;
  while (read(slow) != "answer to end") ++received;
  EXPECT_GT(received, static_cast<int>(SendQueue::most_for_events / 1000) - 1);
  EXPECT_EQ(counters_.events_lost, static_cast<std::uint64_t>(sent - received));
  EXPECT_GT(counters_.events_lost, 0U);
}

TEST_F(WebServerTest, ClosesAWebSocketThatDoesNotReadItsAnswers) {
  start();
  BrowserSocket socket = browser();
  const std::string request(60'000, 'x');
  boost::system::error_code error;
  for (int i = 0; i < 1000 && !error; ++i) socket.write(asio::buffer(request), error);
  EXPECT_TRUE(error) << "60 MB are queued";
  in_server([&] { EXPECT_EQ(counters_.clients_closed, 1U); });
  BrowserSocket calls = browser();
  error = {};
  for (int i = 0; i < 100'000 && !error; ++i) calls.write(asio::buffer(std::string("never")), error);
  EXPECT_TRUE(error) << "any number of requests waits for an answer";
}

TEST_F(WebServerTest, ConnectionsAreLimited) {
  start();
  std::vector<BrowserSocket> sockets;
  for (std::size_t i = 0; i < WebServer::max_connections; ++i) sockets.push_back(browser());
  tcp::socket further = connected();
  EXPECT_EQ(read_all(further), "");
  EXPECT_EQ(counters_.connections_refused, 1U);
  EXPECT_EQ(exchange(sockets.back(), "a"), "answer to a");
  sockets.clear();
  std::string page;
  for (int i = 0; i < 100 && page.empty(); ++i) page = response("GET /metrics");
  EXPECT_TRUE(page.starts_with("HTTP/1.1 200 "));
}

// Idle connections make room for a new visitor, the longest idle first; WebSockets stay, and so do those that have
// sent a part of a request as long as there is another.
TEST_F(WebServerTest, IdleConnectionsMakeRoom) {
  start();
  BrowserSocket socket = browser();
  std::vector<tcp::socket> idle;
  const auto connect_idle = [&](const std::string& sent) {
    idle.push_back(connected());
    if (!sent.empty()) asio::write(idle.back(), asio::buffer(sent));
  };
  const std::string request = "GET /metrics HTTP/1.1\r\nHost: 127.0.0.1\r\n";
  connect_idle(request);
  std::string answer;
  while (idle.size() < WebServer::max_connections - 1) {
    connect_idle(idle.size() % 2 == 0 ? request + "\r\n" : "");
    if (idle.size() % 2 == 1) asio::read_until(idle.back(), asio::dynamic_buffer(answer = ""), "metrics\n");
  }
  in_server([] {});
  for (int visitor = 0; visitor < 40; ++visitor)
    ASSERT_TRUE(response("GET /metrics").starts_with("HTTP/1.1 200 ")) << visitor;
  EXPECT_EQ(counters_.connections_refused, 0U);
  EXPECT_EQ(exchange(socket, "a"), "answer to a");
  asio::write(idle.front(), asio::buffer(std::string("Connection: close\r\n\r\n")));
  EXPECT_TRUE(read_all(idle.front()).starts_with("HTTP/1.1 200 ")) << "it was in the middle of its request";
}

// A request without an answer and an open WebSocket hold nothing that is used after the server.
TEST_F(WebServerTest, EndsWithOpenConnections) {
  start();
  BrowserSocket socket = browser();
  exchange(socket, "subscribe");
  tcp::socket waiting = connected();
  asio::write(waiting,
              asio::buffer("POST /api HTTP/1.1\r\nHost: [::1]\r\n" + json_type + "Content-Length: 5\r\n\r\nnever"));
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  stop();
  EXPECT_EQ(read_all(waiting), "");
  boost::system::error_code error;
  beast::flat_buffer buffer;
  socket.read(buffer, error);
  EXPECT_TRUE(error);
}

}  // namespace
}  // namespace imud
