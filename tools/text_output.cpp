#include "tools/text_output.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "tools/stop_signal.hpp"
#include "transports/file/output_path.hpp"

namespace imud {
namespace {
constexpr std::size_t hold_at_most = 64 * 1024;
}

TextOutput::TextOutput(const std::string& path) {
  if (const std::string fault = path == "-" ? std::string() : foreign_link_fault(path); !fault.empty())
    throw std::runtime_error(fault);
  file_.reset(path == "-" ? ::fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 0)
                          : ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
  if (!file_) throw std::runtime_error(fmt::format("{}: cannot write it: {}", path, std::strerror(errno)));
  held_.reserve(hold_at_most + PIPE_BUF);
}

void TextOutput::write(std::string_view text) {
  held_ += text;
  if (held_.size() >= hold_at_most) flush();
}

bool TextOutput::is_terminal() const noexcept { return ::isatty(file_.get()) == 1; }

bool TextOutput::is_writable() const noexcept {
  pollfd out{file_.get(), POLLOUT, 0};
  return ::poll(&out, 1, 1000) > 0;
}

void TextOutput::flush() {
  std::string_view rest = held_;
  while (!rest.empty() && error_ == 0) {
    // POLLOUT guarantees that PIPE_BUF bytes can be written without blocking.
    const std::size_t piece = stop_requested() ? std::min<std::size_t>(rest.size(), PIPE_BUF) : rest.size();
    if (stop_requested() && !is_writable()) {
      error_ = EPIPE;
      break;
    }
    const ssize_t size = ::write(file_.get(), rest.data(), piece);
    if (size >= 0) {
      rest.remove_prefix(static_cast<std::size_t>(size));
    } else if (errno == EAGAIN) {
      static_cast<void>(is_writable());  // waits
    } else if (errno != EINTR) {
      error_ = errno;
    }
  }
  held_.clear();
}

void write_file(const std::string& path, std::string_view text) {
  TextOutput output(path);
  output.write(text);
  output.flush();
  if (!output.is_open()) throw std::runtime_error(path + ": " + std::strerror(output.error()));
}

std::string on_one_line(std::string text) {
  std::ranges::replace_if(
      text, [](char c) { return static_cast<unsigned char>(c) < ' '; }, ' ');
  return text;
}

}  // namespace imud
