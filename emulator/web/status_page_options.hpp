// StatusPageOptions: the options of a command that shows a status as text, as JSON, or on a page.
#pragma once

#include <CLI/CLI.hpp>

#include "emulator/plan/web_config.hpp"

namespace imud {

struct StatusPageOptions {
  bool json = false;
  WebConfig web;

  // Adds the options to a command, which must outlive this object. This object must not be moved or copied
  // afterwards.
  void add_to(CLI::App& command) {
    CLI::Option* as_json = command.add_flag("--json", json, "As JSON");
    page_ = command.add_option("--web", web.listen, "Show it on a page at this address until SIGINT")
                ->type_name("ADDR:PORT")
                ->excludes(as_json);
    command.add_option("--token-file", web.token_file, "File with the token that the page asks for")
        ->type_name("FILE")
        ->needs(page_);
  }
  // Returns true if a page is wanted, whatever its address is.
  bool has_page() const { return page_ != nullptr && page_->count() > 0; }

 private:
  CLI::Option* page_ = nullptr;
};

}  // namespace imud
