// CAN frames to and from the text of a log: candump -L of can-utils, or Vector's ASC.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "transports/can/can_bus.hpp"
#include "transports/can/can_log.hpp"
#include "transports/file/file_input.hpp"
#include "transports/file/file_writer.hpp"
#include "transports/file/output_path.hpp"
#include "transports/host_clock.hpp"

namespace imud {
namespace {

constexpr PortOption interface_option = {
    .key = "interface", .help = "name of the bus in the log (can0); a listener reads its frames only"};
constexpr PortOption format_option = {.key = "format",
                                      .help = "of the log, if its name does not show it: NAME.asc is an ASC log",
                                      .choices = "candump asc",
                                      .device_only = true};
constexpr PortOption canfile_options[] = {interface_option, format_option, bitrate_option, data_bitrate_option};

CanLogFormat format_of(const PortSpec& spec) {
  const bool is_asc = spec.text(format_option.key).value_or(spec.address.ends_with(".asc") ? "asc" : "") == "asc";
  return is_asc ? CanLogFormat::asc : CanLogFormat::candump;
}

// Stamps each frame with the time of its device, so that the log is a function of the run.
class LogWriter final : public FileWriter {
 public:
  LogWriter(const PortSpec& spec, const PortSettings& settings)
      : FileWriter(spec, settings),
        format_(format_of(spec)),
        interface_(spec.text(interface_option.key).value_or("can0")),
        header_(can_log_header(format_)) {}

  void send(std::span<const Frame> frames) noexcept override {
    while (!frames.empty()) {
      const auto some = frames.first(std::min(frames.size(), lines_.size()));
      frames = frames.subspan(some.size());
      char* end = text_.data();
      std::size_t count = 0;
      for (const Frame& frame : some) {
        char* const begin = end;
        end = std::copy(header_.begin(), header_.end(), end);
        const std::size_t size = write_can_log(format_, frame, Nanoseconds{time_.ns}, interface_,
                                               std::span<char, max_can_log_line>(end, max_can_log_line));
        if (size == 0) {
          end = begin;
          ++counters_.dropped;
          continue;
        }
        end += size;
        header_ = {};
        lines_[count++].bytes = std::as_bytes(std::span(begin, end));
      }
      FileWriter::send(std::span(lines_).first(count));
    }
  }

 private:
  const CanLogFormat format_;
  const std::string interface_;
  std::string_view header_;  // still to be written, before the first frame
  std::array<Frame, FrameBuffer::max_frames> lines_;
  std::vector<char> text_ = std::vector<char>((FrameBuffer::max_frames + 1) * max_can_log_line);
};

class LogPort final : public Port {
 public:
  explicit LogPort(const PortSpec& spec)
      : file_(spec), interface_(spec.text(interface_option.key)), log_(interface_) {}

  void send(std::span<const Frame> frames) noexcept override { counters_.dropped += frames.size(); }

  std::optional<Received> receive() noexcept override {
    const auto frame = next_frame();
    if (at_end()) describe_end();
    return frame;
  }

  bool at_end() const noexcept override { return file_.at_end() && begin_ == end_; }
  std::string_view end_warning() const noexcept override { return {warning_.data(), warning_size_}; }
  std::optional<double> progress() const noexcept override { return file_.progress(); }
  // A regular file is read as a capture: it never waits, and its lines give the times.
  int descriptor() const noexcept override { return file_.is_regular() ? -1 : file_.descriptor(); }

 private:
  std::optional<Received> next_frame() noexcept {
    constexpr int most = 1024;  // lines that are skipped in one call, so that the caller can do other work
    for (int i = 0; i < most; ++i) {
      const auto line = next_line();
      if (!line) break;
      ++line_number_;
      switch (log_.read(*line)) {
        case CanLogReader::Line::frame:
          ++counters_.received;
          return Received{log_.frame(), HostTime{log_.time().count()}};
        case CanLogReader::Line::malformed:
          ++malformed_;
          if (first_malformed_ == 0) first_malformed_ = line_number_;
          break;
        case CanLogReader::Line::other:
          break;
      }
    }
    return std::nullopt;
  }

  // Returns the next line, valid until the next call; nullopt if no whole line is available. The last line needs
  // no line feed. A line that is longer than the buffer is cut into several.
  std::optional<std::string_view> next_line() noexcept {
    while (true) {
      const std::string_view text(text_.data() + begin_, end_ - begin_);
      const std::size_t size = text.find('\n', scanned_);
      scanned_ = text.size();
      if (size != text.npos || text.size() == text_.size() || (file_.at_end() && !text.empty())) {
        begin_ += std::min(size == text.npos ? text.size() : size + 1, text.size());
        scanned_ = 0;
        return text.substr(0, size);
      }
      std::memmove(text_.data(), text.data(), text.size());
      begin_ = 0;
      end_ = text.size();
      const std::size_t read = file_.read(std::as_writable_bytes(std::span(text_).subspan(end_)));
      end_ += read;
      if (read == 0 && (!file_.at_end() || end_ == 0)) return std::nullopt;
    }
  }

  void describe_end() noexcept {
    constexpr const char* right = "right would be the text of candump -L, or Vector ASC";
    const auto describe = [this](auto format, const auto&... values) {
      warning_size_ =
          std::min(fmt::format_to_n(warning_.data(), warning_.size(), format, values...).size, warning_.size());
    };
    if (!file_.end_warning().empty())
      describe(FMT_STRING("unreadable after line {}: {}"), line_number_, file_.end_warning());
    else if (malformed_ > 0)
      describe(FMT_STRING("{} of {} lines are no frames, first line {}; {}"), malformed_, line_number_,
               first_malformed_, right);
    else if (counters_.received == 0 && interface_)
      describe(FMT_STRING("none of its {} lines is a frame of {}; give an interface of the log, or another file: {}"),
               line_number_, *interface_, right);
    else if (counters_.received == 0)
      describe(FMT_STRING("none of its {} lines is a frame; {}"), line_number_, right);
  }

  FileInput file_;
  const std::optional<std::string> interface_;  // the only one whose frames are read; nullopt: all
  CanLogReader log_;
  std::vector<char> text_ = std::vector<char>(64 * 1024);
  std::size_t begin_ = 0, end_ = 0;  // bytes that were read, but not parsed yet
  std::size_t scanned_ = 0;          // of these, bytes known to have no line feed
  std::uint64_t line_number_ = 0, malformed_ = 0, first_malformed_ = 0;
  std::array<char, 200> warning_;
  std::size_t warning_size_ = 0;
};

bool is_standard_output(const PortSpec& spec) { return imud::is_standard_output(spec.address); }

void check(const PortSpec& spec, const PortSettings&) {
  constexpr std::size_t longest = 15;
  const std::string name = spec.text(interface_option.key).value_or("can0");
  if (name.empty() || name.size() > longest || name.find_first_of(" \t\r\n/") != name.npos)
    throw spec.error(fmt::format("interface={}: right would be a name of an interface, such as can0", name));
}

std::unique_ptr<Port> open(const PortSpec& spec, const PortSettings& settings) {
  if (settings.role == Role::device) return std::make_unique<LogWriter>(spec, settings);
  return std::make_unique<LogPort>(spec);
}

}  // namespace

extern constexpr Transport canfile_transport = {
    .name = "canfile",
    .summary = "CAN frames to a log, or from one (also .gz, .zst): candump -L, or Vector ASC",
    .syntax = "canfile:PATH?interface=can0&format=candump|asc",
    .example = "canfile:imu1.log?interface=can0",
    .document = "can-utils 2020.11: candump -L, log2asc",
    .options = canfile_options,
    .carries_can = true,
    .keeps_datagrams = true,
    .ends = true,
    .has_path = true,
    .reads_standard_input = true,
    .has_private_copy = true,
    .check = check,
    .open = open,
    .wire_time = can_wire_time,
    .is_standard_output = is_standard_output,
};

}  // namespace imud
