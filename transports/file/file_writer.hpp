// FileWriter: a port that writes frames, as they are, to a file, a pipe or a device.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "transports/byte_writer.hpp"
#include "transports/file/file_replacement.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/port.hpp"

namespace imud {

// Frames for a regular file are gathered in a buffer. With Delivery::complete, frames for a pipe or a device are
// gathered, too. With Delivery::timely, a pipe or a device gets each frame at once, and the port never waits for
// the reader. The address - is standard output. A regular file that is written in place is locked, and keeps its old
// content until the first flush(): a run that cannot begin leaves the file as it was.
class FileWriter : public Port {
 public:
  // Throws PortError, also if another process writes the file.
  FileWriter(const PortSpec& spec, const PortSettings& settings);
  ~FileWriter() override {
    if (!is_idle()) FileWriter::flush();
  }

  void send(std::span<const Frame> frames) noexcept override;
  std::optional<Received> receive() noexcept override { return std::nullopt; }
  bool can_receive() const noexcept override { return false; }  // a terminal's input is not read
  void flush() noexcept override;
  void discard_pending() noexcept override;
  bool wants_output() const noexcept override { return !regular_ && !is_idle(); }
  bool is_drained() noexcept override {
    flush();
    return regular_ || is_idle();
  }
  // A regular file always has room. For a pipe or a device, the frames of a sample and of the deadlines before
  // that sample need less than half of the buffer.
  bool has_room() const noexcept override {
    return regular_ || (gathers_ && used_ <= buffer_size / 2 && held_count_ <= held_.size() / 2);
  }
  void commit() override;
  int descriptor() const noexcept override { return regular_ ? -1 : file_.get(); }

 private:
  static constexpr std::size_t buffer_size = 128 * 1024;

  void open(const PortSpec& spec, const std::string& path, bool replaces);
  bool is_idle() const noexcept { return held_count_ == 0 && writer_.is_idle(); }
  bool fits(const Frame& frame) const noexcept {
    return frame.bytes.size() <= buffer_.size() - used_ && held_count_ < held_.size();
  }
  void keep_from(std::size_t first) noexcept;

  std::optional<FileReplacement> replacement_;
  FileDescriptor file_;
  bool regular_ = false;
  bool has_old_ = false;  // a file that is written in place has its old content
  bool gathers_ = false;  // frames are written when the buffer is full, and by flush()
  ByteWriter writer_;
  std::vector<std::byte> buffer_ = std::vector<std::byte>(buffer_size);
  std::vector<Frame> held_ = std::vector<Frame>(buffer_size / 32);
  std::size_t used_ = 0;
  std::size_t held_count_ = 0;
};

}  // namespace imud
