// Bytes to and from files, pipes and the standard streams.
#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <vector>

#include "transports/byte_writer.hpp"
#include "transports/compressed_file.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/file_replacement.hpp"
#include "transports/host_clock.hpp"
#include "transports/output_path.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

constexpr std::size_t buffer_size = 128 * 1024;

bool is_regular(int fd) noexcept {
  struct stat status {};
  return ::fstat(fd, &status) == 0 && S_ISREG(status.st_mode);
}

bool is_standard_output(const PortSpec& spec) { return imud::is_standard_output(spec.address); }

// Writes frames. Those for a regular file are gathered; so are those for a pipe or a device if they must not be
// dropped. Otherwise a pipe gets them at once, and its reader is never waited for.
class FileWriter final : public Port {
 public:
  FileWriter(const PortSpec& spec, const PortSettings& settings) {
    if (is_standard_output(spec) && is_regular(STDOUT_FILENO)) {
      // Opening it again would truncate a file to which the shell appends.
      file_.reset(::fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 0));
    } else {
      open(spec, is_standard_output(spec) ? "/dev/stdout" : spec.address, settings.replaces_file);
    }
    regular_ = is_regular(file_.get());
    gathers_ = regular_ || settings.delivery == Delivery::complete;
    if (!regular_) {
      // A pipe whose reader leaves must not end the process; an installed handler stays.
      const auto before = std::signal(SIGPIPE, SIG_IGN);
      if (before != SIG_DFL) std::signal(SIGPIPE, before);
    }
  }
  ~FileWriter() override { flush(); }

  void send(std::span<const Frame> frames) noexcept override {
    for (const Frame& frame : frames) {
      if (frame.bytes.size() > ByteWriter::max_frame) {
        ++counters_.dropped;
        continue;
      }
      if (!fits(frame)) flush();
      if (!fits(frame)) {
        ++counters_.dropped;
        continue;
      }
      std::copy(frame.bytes.begin(), frame.bytes.end(), buffer_.begin() + static_cast<std::ptrdiff_t>(used_));
      held_[held_count_++].bytes = {buffer_.data() + used_, frame.bytes.size()};
      used_ += frame.bytes.size();
    }
    if (!gathers_) flush();
  }

  std::optional<Received> receive() noexcept override { return std::nullopt; }
  bool can_receive() const noexcept override { return false; }  // a terminal's input is not read

  void flush() noexcept override {
    if (is_idle()) return;  // the state is that of the last write
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

  void discard_pending() noexcept override {
    const std::uint64_t dropped = counters_.dropped;
    writer_.discard(counters_);
    counters_.dropped += held_count_;
    keep_from(held_count_);
    if (error_ != 0) counters_.failed += counters_.dropped - dropped;
  }

  bool wants_output() const noexcept override { return !regular_ && !is_idle(); }
  bool is_drained() noexcept override {
    flush();
    return regular_ || is_idle();
  }
  // A regular file takes everything. Half a buffer is more than the frames of a sample and of the deadlines before
  // it.
  bool has_room() const noexcept override {
    return regular_ || (gathers_ && used_ <= buffer_size / 2 && held_count_ <= held_.size() / 2);
  }
  void commit() override {
    flush();
    if (replacement_) replacement_->commit();
  }
  int descriptor() const noexcept override { return regular_ ? -1 : file_.get(); }

 private:
  void open(const PortSpec& spec, const std::string& path, bool replaces) {
    if (const std::string link = foreign_link(path); !link.empty())
      throw spec.error(fmt::format(
          "{} is a symbolic link that another user has made in a folder which others can write; give another path",
          link));
    if (const auto target = replaces ? FileReplacement::target(path) : std::nullopt) {
      replacement_.emplace(spec, *target);
      file_.reset(::fcntl(replacement_->descriptor(), F_DUPFD_CLOEXEC, 0));
    } else {
      file_.reset(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_NONBLOCK | O_CLOEXEC | O_NOCTTY, 0666));
    }
    if (!file_)
      throw spec.error(fmt::format("cannot write it: {}{}", std::strerror(errno),
                                   errno == ENXIO ? "; a pipe needs its reader first" : ""));
  }

  bool is_idle() const noexcept { return held_count_ == 0 && writer_.is_idle(); }
  bool fits(const Frame& frame) const noexcept {
    return frame.bytes.size() <= buffer_.size() - used_ && held_count_ < held_.size();
  }
  // Moves the frames from `first` on to the beginning of the buffer.
  void keep_from(std::size_t first) noexcept {
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

  std::optional<FileReplacement> replacement_;
  FileDescriptor file_;
  bool regular_ = false;
  bool gathers_ = false;  // frames are written when the buffer is full, and by flush()
  ByteWriter writer_;
  std::vector<std::byte> buffer_ = std::vector<std::byte>(buffer_size);
  std::vector<Frame> held_ = std::vector<Frame>(buffer_size / 32);
  std::size_t used_ = 0;
  std::size_t held_count_ = 0;
};

class FileReader final : public Port {
 public:
  explicit FileReader(const PortSpec& spec) {
    const std::string path = spec.address == "-" ? "/dev/stdin" : spec.address;
    // Non-blocking, so that a fifo opens without its writer.
    file_.reset(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY));
    // A socket cannot be opened by name, nor can another user's pipe.
    if (!file_ && spec.address == "-") file_.reset(::fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 0));
    if (!file_) throw spec.error(fmt::format("cannot read it: {}", std::strerror(errno)));
    struct stat status {};
    if (::fstat(file_.get(), &status) == 0 && S_ISDIR(status.st_mode))
      throw spec.error("is a directory; right would be a file or a pipe");
    if (S_ISREG(status.st_mode)) size_ = static_cast<double>(status.st_size);
    compressed_ = CompressedFile::open(file_.get());
  }

  void send(std::span<const Frame> frames) noexcept override { counters_.dropped += frames.size(); }

  std::optional<Received> receive() noexcept override {
    // For a fifo that no writer has opened yet, read() reports the end, but poll() reports nothing.
    pollfd ready{file_.get(), POLLIN, 0};
    if (at_end_ || ::poll(&ready, 1, 0) <= 0) return std::nullopt;
    const ssize_t size = compressed_ ? compressed_->read(std::span(buffer_).first(most_decompressed))
                                     : ::read(file_.get(), buffer_.data(), buffer_.size());
    if (size > 0) {
      ++counters_.received;
      return Received{{{buffer_.data(), static_cast<std::size_t>(size)}}, host_now()};
    }
    if (size < 0 && !compressed_ && (errno == EAGAIN || errno == EINTR)) return std::nullopt;
    if (size < 0) warning_ = compressed_ ? compressed_->error() : ::strerrordesc_np(errno);
    at_end_ = true;
    return std::nullopt;
  }

  bool at_end() const noexcept override { return at_end_; }
  std::string_view end_warning() const noexcept override { return warning_; }
  int descriptor() const noexcept override { return file_.get(); }
  std::optional<double> progress() const noexcept override {
    if (size_ <= 0) return std::nullopt;
    return std::min(1.0, static_cast<double>(::lseek(file_.get(), 0, SEEK_CUR)) / size_);
  }

 private:
  static constexpr std::size_t most_decompressed = 16 * 1024;  // in one call, which then takes some 50 us

  FileDescriptor file_;
  double size_ = 0;                             // bytes; of a regular file only
  std::unique_ptr<CompressedFile> compressed_;  // nullptr: the file is read as it is
  bool at_end_ = false;
  std::string_view warning_;
  std::vector<std::byte> buffer_ = std::vector<std::byte>(buffer_size);
};

void check(const PortSpec&, const PortSettings&) {}

std::unique_ptr<Port> open(const PortSpec& spec, const PortSettings& settings) {
  if (settings.role == Role::device) return std::make_unique<FileWriter>(spec, settings);
  return std::make_unique<FileReader>(spec);
}

}  // namespace

extern const Transport file_transport;
constexpr Transport file_transport = {
    .name = "file",
    .summary = "bytes to a file or pipe, or from one (also .gz, .zst); - is standard output or input",
    .syntax = "file:PATH",
    .example = "file:imu1.bin",
    .document = "open(2), pipe(7)",
    .ends = true,
    .brings_truth = true,
    .has_path = true,
    .reads_standard_input = true,
    .has_private_copy = true,
    .suffixes = ".csv .txt",
    .check = check,
    .open = open,
    .is_standard_output = is_standard_output,
};

}  // namespace imud
