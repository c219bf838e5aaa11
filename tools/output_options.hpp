// OutputOptions: the options of a command line that name files to be written.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <utility>
#include <vector>

#include "transports/file/files_in_use.hpp"

namespace imud {

class OutputOptions {
 public:
  explicit OutputOptions(CLI::App& app) : app_(app) {}

  // Adds an option to the command line. `path` stays where it is.
  CLI::Option* add(const std::string& option, std::string& path, const std::string& help) {
    paths_.emplace_back(option, &path);
    return app_.add_option(option, path, help)->type_name("FILE");
  }
  // Returns the fault of the first output that is a file in use. If there is none, returns an empty text, and all
  // outputs are registered as in use.
  [[nodiscard]] std::string claim(FilesInUse& files) const {
    std::string fault;
    for (const auto& [option, path] : paths_)
      if (fault.empty()) fault = files.claim(*path, "the file of " + option);
    return fault;
  }

 private:
  CLI::App& app_;
  std::vector<std::pair<std::string, const std::string*>> paths_;
};

}  // namespace imud
