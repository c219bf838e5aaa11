#include "emulator/web/status_page.hpp"

#include <fmt/format.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <csignal>
#include <optional>

#include "emulator/ground/counters.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/web/web_server.hpp"
#include "transports/port_spec.hpp"

namespace imud {

void serve_status(const WebConfig& web, std::span<const PageFile> files, const std::function<std::string()>& status,
                  const std::string& shown) {
  const auto address = NumericAddress::try_parse(web.listen);
  if (!address) throw OpenError("--web: give a numeric address and a port, such as 127.0.0.1:8080");
  if (!address->is_loopback() && web.token_file.empty())
    throw OpenError("--web: other machines reach this address: give --token-file, or 127.0.0.1:8080");
  boost::asio::io_context io;
  boost::asio::signal_set signals(io, SIGINT, SIGTERM);
  WebServer server(io, web, "--web");
  signals.async_wait([&io](const boost::system::error_code&, int) { io.stop(); });
  ControlCounters counters;
  server.serve({.files = files,
                .document = [&](std::string_view path, std::string_view) -> std::optional<WebDocument> {
                  if (path != "/status") return std::nullopt;
                  return WebDocument{"application/json", status()};
                },
                .api = {},
                .summary = "there is / and /status"},
               counters);
  TextFile("-").write(fmt::format("http://{}/ shows {} until Ctrl-C\n", server.address(), shown));
  io.run();
}

}  // namespace imud
