#include "emulator/campaign/status/campaign_page.hpp"

#include <fmt/format.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <csignal>
#include <optional>

#include "emulator/campaign/status/campaign_status.hpp"
#include "emulator/ground/counters.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/web/web_server.hpp"
#include "transports/host_clock.hpp"

namespace imud {

namespace {

// The status as JSON, for any number of pages. A large folder is read in pieces, so that no page waits long.
class StatusText {
 public:
  explicit StatusText(const std::string& folder) : status_(folder) {}

  std::string operator()() {
    constexpr double longest_s = 0.3, between_s = 0.5;
    if (is_all_read_ && seconds(host_now() - read_) < between_s) return text_;
    is_all_read_ = status_.update(longest_s);
    text_ = status_.json().dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
    read_ = host_now();
    return text_;
  }

 private:
  CampaignStatus status_;
  bool is_all_read_ = false;
  HostTime read_{};
  std::string text_;
};

}  // namespace

int serve_campaign(const std::string& folder, const WebConfig& web) {
  StatusText status(folder);
  boost::asio::io_context io;
  boost::asio::signal_set signals(io, SIGINT, SIGTERM);
  WebServer server(io, web, "--web");
  signals.async_wait([&io](const boost::system::error_code&, int) { io.stop(); });
  ControlCounters counters;
  server.serve({.files = campaign_page_files(),
                .document = [&](std::string_view path, std::string_view) -> std::optional<WebDocument> {
                  if (path != "/status") return std::nullopt;
                  return WebDocument{"application/json", status()};
                },
                .api = {},
                .summary = "there is / and /status"},
               counters);
  TextFile("-").write(fmt::format("http://{}/ shows {} until Ctrl-C\n", server.address(), folder));
  io.run();
  return 0;
}

}  // namespace imud
