#include "emulator/ground/text_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <utility>

#include "transports/file/file_lock.hpp"
#include "transports/file/output_path.hpp"

namespace imud {
namespace {

template <class Error>
[[noreturn]] void fail(const std::string& path) {
  const int error = errno;
  throw Error(fmt::format("{}: cannot be written: {}", path == "-" ? "standard output" : path, std::strerror(error)));
}

FileDescriptor open_to_write(const std::string& path, int flags) {
  if (const std::string fault = foreign_link_fault(path); !fault.empty()) throw OpenError(fault);
  FileDescriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | O_NOCTTY | flags, 0666));
  if (!file) fail<OpenError>(path);
  return file;
}

bool lock_output(const FileDescriptor& file, const std::string& path) noexcept {
  return is_standard_output(path) || lock_file(file.get());
}

bool is_same_file(const FileDescriptor& a, const FileDescriptor& b) noexcept {
  struct stat of_a {
  }, of_b{};
  return a && ::fstat(a.get(), &of_a) == 0 && ::fstat(b.get(), &of_b) == 0 && of_a.st_dev == of_b.st_dev &&
         of_a.st_ino == of_b.st_ino;
}

[[noreturn]] void fail_locked(const std::string& path) {
  throw OpenError(fmt::format("{}: is written by another process; give another file", path));
}

}  // namespace

TextFile::TextFile(const std::string& path) : path_(path) {
  if (path.empty()) return;
  file_ = path == "-" ? FileDescriptor(::fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 0)) : open_to_write(path, 0);
  if (!file_) fail<OpenError>(path_);
  if (!lock_output(file_, path)) fail_locked(path);
}

TextFile TextFile::standard_error() {
  TextFile file;
  file.path_ = "-";
  file.file_.reset(::fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 0));
  return file;
}

bool TextFile::has_room() const noexcept {
  pollfd output{file_.get(), POLLOUT, 0};
  return ::poll(&output, 1, 0) != 0;
}

void TextFile::write(std::string_view text) {
  while (file_ && !text.empty()) {
    const ssize_t size = ::write(file_.get(), text.data(), text.size());
    if (size >= 0)
      text.remove_prefix(static_cast<std::size_t>(size));
    else if (errno == EPIPE)
      return;
    else if (errno != EINTR && errno != EAGAIN)
      fail<std::runtime_error>(path_);
  }
}

void TextFile::append(std::string_view text) {
  const off_t begin = is_regular() ? ::lseek(file_.get(), 0, SEEK_END) : -1;
  try {
    write(text);
  } catch (const std::runtime_error&) {
    if (begin >= 0 && ::ftruncate(file_.get(), begin) == 0) ::lseek(file_.get(), begin, SEEK_SET);
    throw;
  }
}

bool TextFile::is_regular() const noexcept {
  struct stat status {};
  return path_ != "-" && ::fstat(file_.get(), &status) == 0 && S_ISREG(status.st_mode);
}

void TextFile::replace(std::string_view text) {
  if (is_regular()) ::lseek(file_.get(), 0, SEEK_SET);
  write(text);
  if (is_regular() && ::ftruncate(file_.get(), ::lseek(file_.get(), 0, SEEK_CUR)) != 0)
    fail<std::runtime_error>(path_);
}

void TextFile::reopen() {
  if (path_.empty() || path_ == "-") return;
  FileDescriptor next = open_to_write(path_, O_APPEND);
  if (is_same_file(file_, next)) ::flock(file_.get(), LOCK_UN);
  if (!lock_output(next, path_)) {
    if (file_) lock_output(file_, path_);
    fail_locked(path_);
  }
  file_ = std::move(next);
}

std::string read_whole(const std::string& path) {
  const auto check = [](bool good) {
    if (!good) throw std::system_error(errno == 0 ? EIO : errno, std::generic_category());
  };
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  check(file.is_open());
  if (std::filesystem::is_directory(path)) throw std::system_error(EISDIR, std::generic_category());
  std::string content;
  std::array<char, 65536> piece;
  do {
    file.read(piece.data(), piece.size());
    content.append(piece.data(), static_cast<std::size_t>(file.gcount()));
    if (content.size() > most_read) throw std::system_error(EFBIG, std::generic_category());
  } while (file);
  check(!file.bad());
  return content;
}

}  // namespace imud
