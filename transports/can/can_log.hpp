// The text formats of CAN logs with one frame a line: the output of candump -L (can-utils), and Vector's ASC.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "core/frame.hpp"
#include "core/time.hpp"

namespace imud {

enum class CanLogFormat : std::uint8_t { candump, asc };

// The longest line that write_can_log() makes, bytes.
constexpr std::size_t max_can_log_line = 384;

// The lines before the first frame of a log.
std::string_view can_log_header(CanLogFormat format) noexcept;

// Writes the line of a frame, with a line feed. Returns the length of the line, bytes; 0 if a CAN bus cannot carry
// the frame. The log has the error frames of the kernel (linux/can/error.h): in an ASC log without their content.
// `time` is written with a resolution of 1 us; a negative time is written as 0. `interface` has at most
// 15 characters: a candump log contains this name, an ASC log the channel_of() this name.
std::size_t write_can_log(CanLogFormat format, const Frame& frame, Nanoseconds time, std::string_view interface,
                          std::span<char, max_can_log_line> line) noexcept;

// Returns the channel that can-utils gives an interface in an ASC log: 1 for can0 or for a name without number.
unsigned channel_of(std::string_view interface) noexcept;

// Parses the lines of a log in either format. Any text is safe. Used by one thread.
class CanLogReader {
 public:
  // With `interface`, only the frames of that interface are read; in an ASC log these are the frames of
  // channel_of(interface).
  explicit CanLogReader(std::optional<std::string> interface = {}) : interface_(std::move(interface)) {}

  enum class Line : std::uint8_t {
    frame,      // frame() and time() return its content
    other,      // a header, an event, or a frame of another interface
    malformed,  // the line begins like a frame, but is not valid
  };
  Line read(std::string_view line) noexcept;

  // Returns the frame of the last line; its data are valid until the next read().
  Frame frame() const noexcept { return {std::span(data_).first(size_), header_}; }
  // Returns the time stamp of the last frame; in an ASC log, the time since the beginning of the log.
  Nanoseconds time() const noexcept { return time_; }

 private:
  class Words;
  Line read_candump(std::string_view line) noexcept;
  Line read_asc(std::string_view line) noexcept;
  Line read_classic(Words& words) noexcept;
  Line read_fd(Words& words) noexcept;
  bool read_id(std::string_view text, int base) noexcept;
  bool read_data(Words& words, std::size_t size, int base) noexcept;
  bool has_channel(std::string_view channel) const noexcept;

  const std::optional<std::string> interface_;
  bool decimal_ = false;   // of an ASC log: identifiers and data
  bool relative_ = false;  // of an ASC log: each time stamp is relative to the previous one
  Nanoseconds last_{0};    // the time of the line before
  Nanoseconds time_{0};
  CanHeader header_;
  std::size_t size_ = 0;
  std::array<std::byte, 64> data_{};
};

}  // namespace imud
