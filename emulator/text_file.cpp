#include "emulator/text_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace imud {

namespace {

template <class Error>
[[noreturn]] void fail(const std::string& path) {
  const int error = errno;
  throw Error(fmt::format("{}: cannot be written: {}", path == "-" ? "standard output" : path, std::strerror(error)));
}

}  // namespace

TextFile::TextFile(const std::string& path) : path_(path) {
  if (path.empty()) return;
  file_.reset(path == "-" ? ::fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 0)
                          : ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOCTTY, 0666));
  if (!file_) fail<OpenError>(path_);
}

TextFile TextFile::standard_error() {
  TextFile file;
  file.path_ = "-";
  file.file_.reset(::fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 0));
  return file;
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

bool TextFile::clear() noexcept {
  return path_ != "-" && ::ftruncate(file_.get(), 0) == 0 && ::lseek(file_.get(), 0, SEEK_SET) == 0;
}

void TextFile::reopen() {
  if (path_.empty() || path_ == "-") return;
  FileDescriptor file(::open(path_.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | O_NOCTTY, 0666));
  if (!file) fail<OpenError>(path_);
  file_ = std::move(file);
}

}  // namespace imud
