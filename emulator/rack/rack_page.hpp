// RackPage: a web page that shows a rack. The program asks the hosts for their status as long as the page is open in
// a browser.
#pragma once

#include <span>
#include <string>

#include "emulator/plan/web_config.hpp"
#include "emulator/web/page_files.hpp"

namespace imud {

// The files of emulator/rack/page, with the style of the page of a run.
std::span<const PageFile> rack_page_files() noexcept;

// Serves the page at `web.listen`, and the status as JSON at /status, until SIGINT or SIGTERM. Prints the address.
// Returns 0. Throws as serve_status() and read_rack().
int serve_rack(const std::string& path, const WebConfig& web);

}  // namespace imud
