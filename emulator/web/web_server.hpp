// WebServer: the page, the metrics and the control protocol by HTTP.
#pragma once

#include <boost/asio/io_context.hpp>
#include <functional>
#include <memory>
#include <string>

#include "emulator/ground/counters.hpp"
#include "emulator/plan/web_config.hpp"
#include "emulator/web/metrics.hpp"
#include "emulator/web/web_api.hpp"
#include "emulator/web/web_site.hpp"

namespace imud {

// Answers GET of the page's files and of /metrics, POST of JSON-RPC 2.0 to /api, and a WebSocket at /api, whose text
// messages are JSON-RPC, too. Runs in the thread that runs the io_context, and never waits: a WebSocket that reads
// too slowly loses notifications (SendQueue). Its answers do not depend on file names of the request: the files are a
// table.
class WebServer {
 public:
  // To make room for a further connection, the connection that has been idle longest is closed. If no connection
  // is idle, the further connection is closed at once.
  static constexpr std::size_t max_connections = 32;
  static constexpr std::size_t max_header_bytes = 8192, max_request_bytes = 65536;
  static constexpr int idle_s = 30;  // a connection without a request is closed

  // Listens; connections wait until serve() is called. `key`: the configuration key or option of the address, for
  // messages to the user. Throws PortError if the address cannot be used, OpenError if the token cannot be read.
  WebServer(boost::asio::io_context& io, const WebConfig& config, const std::string& key = "web.listen");
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  // Returns "ADDR:PORT" with the port that the system has chosen.
  std::string address() const;
  // Returns the number of open connections.
  std::size_t connections() const noexcept;
  // Begins to answer. `counters` must outlive the handlers of the io_context.
  void serve(WebSite site, ControlCounters& counters);
  // Begins to answer with the page of a run. `metrics` returns the text of /metrics in the given format, which the
  // request's Accept field selects.
  void serve(WebApi api, std::function<std::string(MetricsFormat)> metrics, ControlCounters& counters);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace imud
