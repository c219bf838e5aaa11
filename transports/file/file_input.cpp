#include "transports/file/file_input.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string>

namespace imud {

FileInput::FileInput(const PortSpec& spec) {
  const std::string path = spec.address == "-" ? "/dev/stdin" : spec.address;
  // Opened non-blocking, so that a fifo can be opened before its writer.
  file_.reset(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY));
  // A socket and another user's pipe cannot be opened by name.
  if (!file_ && spec.address == "-") file_.reset(::fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 0));
  if (!file_) throw spec.error(fmt::format("cannot read it: {}", std::strerror(errno)));
  struct stat status {};
  if (::fstat(file_.get(), &status) == 0 && S_ISDIR(status.st_mode))
    throw spec.error("is a directory; right would be a file or a pipe");
  is_regular_ = S_ISREG(status.st_mode);
  if (is_regular_) size_ = static_cast<double>(status.st_size);
  compressed_ = CompressedFile::open(file_.get());
}

std::size_t FileInput::read(std::span<std::byte> room) noexcept {
  // For a fifo that no writer has opened yet, read() reports the end, but poll() reports nothing.
  pollfd ready{file_.get(), POLLIN, 0};
  if (at_end_ || ::poll(&ready, 1, 0) <= 0) return 0;
  const ssize_t size = compressed_ ? compressed_->read(room.first(std::min(room.size(), most_decompressed)))
                                   : ::read(file_.get(), room.data(), room.size());
  if (size > 0) return static_cast<std::size_t>(size);
  if (size < 0 && !compressed_ && (errno == EAGAIN || errno == EINTR)) return 0;
  if (size < 0) warning_ = compressed_ ? compressed_->error() : ::strerrordesc_np(errno);
  at_end_ = true;
  return 0;
}

std::optional<double> FileInput::progress() const noexcept {
  if (size_ <= 0) return std::nullopt;
  return std::min(1.0, static_cast<double>(::lseek(file_.get(), 0, SEEK_CUR)) / size_);
}

}  // namespace imud
