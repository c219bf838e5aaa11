// PageFiles: the files of the page, which are embedded in the program when it is built.
#pragma once

#include <span>
#include <string_view>

namespace imud {

struct PageFile {
  std::string_view path;  // of the request: "/", "/chart.js"
  std::string_view type;  // media type
  std::string_view content;
};

// The files of emulator/web/page, and Chart.js.
std::span<const PageFile> page_files() noexcept;

}  // namespace imud
