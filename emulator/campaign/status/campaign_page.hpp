// CampaignPage: a web page that shows a campaign while it runs. The page reads the folder alone: the campaign may run
// on any machine.
#pragma once

#include <span>
#include <string>

#include "emulator/plan/web_config.hpp"
#include "emulator/web/page_files.hpp"

namespace imud {

// The files of emulator/campaign/status/page, with the style of the page of a run.
std::span<const PageFile> campaign_page_files() noexcept;

// Serves the page at `web.listen`, and the status as JSON at /status, until SIGINT or SIGTERM. Prints the address.
// Returns 0. Throws as serve_status(), and OpenError if there is no campaign.
int serve_campaign(const std::string& folder, const WebConfig& web);

}  // namespace imud
