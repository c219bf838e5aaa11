#include "transports/file/file_replacement.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/magic.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/vfs.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace imud {
namespace {

PortError failed(const PortSpec& spec, const std::string& path) {
  const int error = errno;
  return spec.error(path == spec.address ? fmt::format("cannot write it: {}", std::strerror(error))
                                         : fmt::format("cannot write {}: {}", path, std::strerror(error)));
}

}  // namespace

std::optional<std::string> FileReplacement::target(const std::string& path) {
  constexpr int most_links = 40;  // as in Linux
  std::filesystem::path file = path;
  for (int i = 0; i < most_links; ++i) {
    const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : ".";
    struct statfs system {};
    if (::statfs(folder.c_str(), &system) == 0 && system.f_type == PROC_SUPER_MAGIC) return std::nullopt;
    struct stat status {};
    if (::lstat(file.c_str(), &status) != 0) return errno == ENOENT ? std::optional(file.string()) : std::nullopt;
    if (S_ISREG(status.st_mode)) return file.string();
    if (!S_ISLNK(status.st_mode)) return std::nullopt;
    std::error_code error;
    file = folder / std::filesystem::read_symlink(file, error);
    if (error) return std::nullopt;
  }
  return std::nullopt;
}

FileReplacement::FileReplacement(const PortSpec& spec, const std::string& path, LeftBehind left)
    : path_(path), incomplete_(fmt::format("{}{}", path, suffix)) {
  struct stat old {};
  const bool exists = ::stat(path_.c_str(), &old) == 0;
  if (exists && ::faccessat(AT_FDCWD, path_.c_str(), W_OK, AT_EACCESS) != 0) throw failed(spec, path_);
  constexpr int most_attempts = 10;  // another process may start at the same time
  for (int i = 0; i < most_attempts; ++i) {
    file_.reset(::open(incomplete_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
    if (!file_ && errno != EEXIST) throw failed(spec, errno == ENOENT ? spec.address : incomplete_);
    if (!file_) {
      FileDescriptor stale = open_stale(spec);
      if (!stale || !has_name(stale.get())) continue;
      if (left == LeftBehind::go_on) {
        file_ = std::move(stale);
        goes_on_ = is_kept_ = true;
        return;
      }
      if (::unlink(incomplete_.c_str()) != 0) throw failed(spec, incomplete_);
    } else if (::flock(file_.get(), LOCK_EX | LOCK_NB) == 0 && has_name(file_.get())) {
      // These calls cannot fail for a file of this user. If root writes a file of another user, the file keeps its
      // owner.
      if (exists && ::fchown(file_.get(), old.st_uid, old.st_gid) != 0) errno = 0;
      if (exists && ::fchmod(file_.get(), old.st_mode & 0777U) != 0) errno = 0;
      return;
    }
  }
  file_.reset();
  throw spec.error(fmt::format("another process writes it, as {}", incomplete_));
}

FileReplacement::~FileReplacement() {
  if (file_ && !committed_ && !is_kept_ && has_name(file_.get())) ::unlink(incomplete_.c_str());
}

void FileReplacement::commit() {
  if (!has_name(file_.get()))
    throw std::runtime_error(fmt::format("{}: another process has removed or replaced it", incomplete_));
  if (std::rename(incomplete_.c_str(), path_.c_str()) != 0)
    throw std::runtime_error(
        fmt::format("{}: cannot be renamed to {}: {}", incomplete_, path_, std::strerror(errno)));
  committed_ = true;
}

// Opens and locks the PATH.incomplete that another process has left behind. Returns no file if it no longer
// exists.
FileDescriptor FileReplacement::open_stale(const PortSpec& spec) const {
  FileDescriptor stale(::open(incomplete_.c_str(), O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC | O_NOCTTY));
  if (!stale && errno == ENOENT) return {};
  struct stat status {};
  if (!stale || ::fstat(stale.get(), &status) != 0) throw failed(spec, incomplete_);
  if (!S_ISREG(status.st_mode)) throw spec.error(fmt::format("{} is no regular file; remove it", incomplete_));
  if (::flock(stale.get(), LOCK_EX | LOCK_NB) != 0)
    throw spec.error(fmt::format("another process writes it, as {}", incomplete_));
  return stale;
}

// Returns true if PATH.incomplete is the name of this open file.
bool FileReplacement::has_name(int file) const noexcept {
  struct stat open {
  }, named{};
  return ::fstat(file, &open) == 0 && ::lstat(incomplete_.c_str(), &named) == 0 && open.st_dev == named.st_dev &&
         open.st_ino == named.st_ino;
}

}  // namespace imud
