// WholeFile: a file that replaces an older file when it is complete.
#pragma once

#include <optional>
#include <string>

#include "transports/file/file_replacement.hpp"

namespace imud {

class WholeFile {
 public:
  // `path`: a stream, such as "-" and a pipe, is written in place. Throws std::runtime_error.
  explicit WholeFile(std::string path);

  // Returns true if there is a file whose content can be written again.
  bool is_regular() const noexcept { return replacement_.has_value(); }
  // Returns the path at which to write.
  const std::string& path() const noexcept { return incomplete_; }
  // Replaces the older file. Throws std::runtime_error.
  void commit();

 private:
  std::string path_, incomplete_;
  std::optional<FileReplacement> replacement_;
};

}  // namespace imud
