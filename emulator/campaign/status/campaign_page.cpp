#include "emulator/campaign/status/campaign_page.hpp"

#include "emulator/campaign/status/campaign_status.hpp"
#include "emulator/web/status_page.hpp"
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
  serve_status(
      web, campaign_page_files(), [&status] { return status(); }, folder);
  return 0;
}

}  // namespace imud
