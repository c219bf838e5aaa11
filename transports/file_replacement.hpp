// FileReplacement: the new content of a file, which takes the place of the old one when it is whole.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "transports/file_descriptor.hpp"
#include "transports/port_spec.hpp"

namespace imud {

// Content for PATH is written to PATH.incomplete in the same folder. commit() renames it to PATH; without that, the
// destructor removes it, and PATH stays as it was. A process that is killed leaves PATH.incomplete behind, which the
// next one replaces. Two processes cannot write the same file: it is locked (flock(2)) while it is incomplete.
class FileReplacement {
 public:
  static constexpr std::string_view suffix = ".incomplete";

  // Returns the path of the file that a new content of `path` replaces: `path` itself, or the end of a chain of
  // symbolic links; it need not exist. Returns nullopt for what can only be written in place: a device, a fifo, a
  // folder, or a descriptor of this process such as /dev/fd/3.
  static std::optional<std::string> target(const std::string& path);

  // Creates PATH.incomplete, with the owner and the mode of PATH. `path` is a target(). Throws PortError.
  FileReplacement(const PortSpec& spec, const std::string& path);
  FileReplacement(const FileReplacement&) = delete;
  FileReplacement& operator=(const FileReplacement&) = delete;
  ~FileReplacement();

  int descriptor() const noexcept { return file_.get(); }
  // Renames the file to PATH. Throws std::runtime_error.
  void commit();

 private:
  void remove_stale(const PortSpec& spec) const;
  bool has_name(int file) const noexcept;

  std::string path_, incomplete_;
  FileDescriptor file_;
  bool committed_ = false;
};

}  // namespace imud
