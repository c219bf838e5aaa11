#include "transports/file/file_writer.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>

#include "transports/file/file_lock.hpp"
#include "transports/file/output_path.hpp"

namespace imud {
namespace {

bool is_regular(int fd) noexcept {
  struct stat status {};
  return ::fstat(fd, &status) == 0 && S_ISREG(status.st_mode);
}

}  // namespace

FileWriter::FileWriter(const PortSpec& spec, const PortSettings& settings) {
  if (is_standard_output(spec.address) && is_regular(STDOUT_FILENO)) {
    // Opening standard output again by its name would truncate a file to which the shell appends.
    file_.reset(::fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 0));
  } else {
    open(spec, is_standard_output(spec.address) ? "/dev/stdout" : spec.address, settings.replaces_file);
  }
  regular_ = is_regular(file_.get());
  gathers_ = regular_ || settings.delivery == Delivery::complete;
  if (!regular_) {
    // SIGPIPE must not end the process when the reader of a pipe leaves. A handler that is installed already is
    // kept.
    const auto before = std::signal(SIGPIPE, SIG_IGN);
    if (before != SIG_DFL) std::signal(SIGPIPE, before);
  }
}

void FileWriter::open(const PortSpec& spec, const std::string& path, bool replaces) {
  if (const std::string fault = foreign_link_fault(path); !fault.empty()) throw spec.error(fault);
  if (const auto target = replaces ? FileReplacement::target(path) : std::nullopt) {
    replacement_.emplace(spec, *target);
    file_.reset(::fcntl(replacement_->descriptor(), F_DUPFD_CLOEXEC, 0));
  } else {
    file_.reset(::open(path.c_str(), O_WRONLY | O_CREAT | O_NONBLOCK | O_CLOEXEC | O_NOCTTY, 0666));
    has_old_ = file_ && is_regular(file_.get());
  }
  if (!file_)
    throw spec.error(fmt::format("cannot write it: {}{}", std::strerror(errno),
                                 errno == ENXIO ? "; a pipe needs its reader first" : ""));
  if (has_old_ && !lock_file(file_.get())) throw spec.error("is written by another process; give another file");
}

void FileWriter::send(std::span<const Frame> frames) noexcept {
  for (const Frame& frame : frames) {
    if (frame.bytes.size() > ByteWriter::max_frame) {
      ++counters_.dropped;
      continue;
    }
    if (!fits(frame)) FileWriter::flush();
    if (!fits(frame)) {
      ++counters_.dropped;
      continue;
    }
    std::copy(frame.bytes.begin(), frame.bytes.end(), buffer_.begin() + static_cast<std::ptrdiff_t>(used_));
    held_[held_count_++].bytes = {buffer_.data() + used_, frame.bytes.size()};
    used_ += frame.bytes.size();
  }
  if (!gathers_) FileWriter::flush();
}

void FileWriter::flush() noexcept {
  if (has_old_ && ::ftruncate(file_.get(), 0) == 0) has_old_ = false;
  if (is_idle()) return;  // the last write has set the state
  const std::uint64_t dropped = counters_.dropped;
  const auto [taken, error] = writer_.write_some(file_.get(), {held_.data(), held_count_}, counters_);
  const bool keeps = gathers_ && error == 0;
  if (!keeps) counters_.dropped += held_count_ - taken;
  keep_from(keeps ? taken : held_count_);
  if (error == 0) {
    state_ = PortState::ready;
  } else if (error == EPIPE) {
    state_ = PortState::no_reader;  // bytes in the pipe stay there for the next reader
  } else {
    if (state_ != PortState::lost) ++counters_.lost_count;
    state_ = PortState::lost;
    error_ = error;
    counters_.failed += counters_.dropped - dropped;
  }
}

void FileWriter::discard_pending() noexcept {
  const std::uint64_t dropped = counters_.dropped;
  writer_.discard(counters_);
  counters_.dropped += held_count_;
  keep_from(held_count_);
  if (error_ != 0) counters_.failed += counters_.dropped - dropped;
}

void FileWriter::commit() {
  flush();
  if (replacement_) replacement_->commit();
}

// Moves the frames from `first` on to the beginning of the buffer.
void FileWriter::keep_from(std::size_t first) noexcept {
  if (first == 0) return;
  const auto frames = std::span(held_).first(held_count_).subspan(first);
  std::byte* end = buffer_.data();
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const auto bytes = frames[i].bytes;
    held_[i].bytes = {end, bytes.size()};
    end = std::copy(bytes.begin(), bytes.end(), end);
  }
  held_count_ = frames.size();
  used_ = static_cast<std::size_t>(end - buffer_.data());
}

}  // namespace imud
