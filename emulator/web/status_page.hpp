// serve_status(): a page that shows a status, which it reads again and again.
#pragma once

#include <functional>
#include <span>
#include <string>

#include "emulator/plan/web_config.hpp"
#include "emulator/web/page_files.hpp"

namespace imud {

// Serves the files, and the text that `status` returns as JSON at /status, until SIGINT or SIGTERM. `web` is from
// the options --web and --token-file. Prints a line with the address of the page and `shown`, the words for the
// page's content. Throws OpenError if the address is wrong, or other machines reach it without a token, or the
// token cannot be read; PortError if the address cannot be used.
void serve_status(const WebConfig& web, std::span<const PageFile> files, const std::function<std::string()>& status,
                  const std::string& shown);

}  // namespace imud
