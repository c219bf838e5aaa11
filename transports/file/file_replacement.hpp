// FileReplacement: the new content of a file, which replaces the old content when the new content is complete.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "transports/file_descriptor.hpp"
#include "transports/port_spec.hpp"

namespace imud {

// Content for PATH is written to PATH.incomplete in the same folder. commit() renames it to PATH; without that,
// the destructor removes it, and PATH stays as it was. A process that is killed, or that calls keep(), leaves
// PATH.incomplete behind; the next process replaces or continues that file (LeftBehind). PATH.incomplete is locked
// (flock(2)), so that two processes cannot write it.
class FileReplacement {
 public:
  static constexpr std::string_view suffix = ".incomplete";

  // Returns the path of the file that a new content of `path` replaces: `path` itself, or the end of a chain of
  // symbolic links; it need not exist. Returns nullopt for a path that cannot be replaced: a device, a fifo, a
  // folder, or a descriptor of this process such as /dev/fd/3.
  static std::optional<std::string> target(const std::string& path);

  // How the constructor treats a PATH.incomplete that was left behind: it replaces or continues the file.
  enum class LeftBehind : std::uint8_t { replace, go_on };
  // Creates PATH.incomplete, with the owner and the mode of PATH, or opens the one that was left behind. Requires
  // a `path` that target() has returned. Throws PortError.
  FileReplacement(const PortSpec& spec, const std::string& path, LeftBehind left = LeftBehind::replace);
  FileReplacement(const FileReplacement&) = delete;
  FileReplacement& operator=(const FileReplacement&) = delete;
  ~FileReplacement();

  // Returns the descriptor of PATH.incomplete, which is open for reading and writing.
  int descriptor() const noexcept { return file_.get(); }
  // Returns true if the file was left behind by another process.
  bool goes_on() const noexcept { return goes_on_; }
  // Renames the file to PATH. Throws std::runtime_error.
  void commit();
  // Sets whether the destructor leaves PATH.incomplete behind or removes it. Before the first call goes_on()
  // decides.
  void keep(bool is_kept = true) noexcept { is_kept_ = is_kept; }

 private:
  FileDescriptor open_stale(const PortSpec& spec) const;
  bool has_name(int file) const noexcept;

  std::string path_, incomplete_;
  FileDescriptor file_;
  bool committed_ = false, is_kept_ = false, goes_on_ = false;
};

}  // namespace imud
