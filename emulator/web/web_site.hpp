// WebSite: the documents that a web server answers with.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "emulator/web/page_files.hpp"
#include "emulator/web/web_api.hpp"

namespace imud {

// A document that is made for a request.
struct WebDocument {
  std::string_view type;  // media type
  std::string text;
};

struct WebSite {
  std::span<const PageFile> files;
  // Returns the document at a path; nullopt if there is none. `accept`: the Accept field of the request. If the
  // function throws, the exception's text is the answer, with status 500.
  std::function<std::optional<WebDocument>(std::string_view path, std::string_view accept)> document;
  WebApi api;           // empty: there is no /api
  std::string summary;  // for a request of another path: "there is /, /metrics and /api"
};

}  // namespace imud
