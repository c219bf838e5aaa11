// ByteWriter: writes whole frames to a non-blocking byte stream.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "core/frame.hpp"
#include "transports/port.hpp"

namespace imud {

// Shared by the ports that are byte streams. When the kernel takes only a part of a frame, the rest is kept and
// written first at the next call; until the rest is written, later frames are dropped whole. Used by one thread.
class ByteWriter {
 public:
  ByteWriter() = default;
  // `to_socket`: the descriptors are sockets, and a peer that has gone raises no SIGPIPE.
  explicit ByteWriter(bool to_socket) noexcept : to_socket_(to_socket) {}

  // The longest frame, bytes. A longer one is dropped, because its rest could not be kept.
  static constexpr std::size_t max_frame = FrameBuffer::max_bytes;

  // Writes the rest, then `frames`, by one writev() if the kernel takes all bytes. Every frame is counted once: as
  // sent when its last byte is taken, as dropped when the kernel takes none of it. Returns 0 ("full" is no
  // failure), or the errno of the write that failed. If `frames` is empty, only the rest is written.
  // `are_replies`: the frames count as PortCounters::replies, too.
  int write(int fd, std::span<const Frame> frames, PortCounters& counters, bool are_replies = false) noexcept;

  // Writes like write(), but drops no frame that the kernel does not take. Returns how many frames, from the first
  // on, have been counted or begun: the caller keeps the others, and passes them again.
  struct Taken {
    std::size_t frames = 0;
    int error = 0;  // as write() returns it
  };
  Taken write_some(int fd, std::span<const Frame> frames, PortCounters& counters, bool are_replies = false) noexcept;

  // Returns true if there is no rest to be written.
  bool is_idle() const noexcept { return rest_begin_ == rest_end_; }

  // Discards the rest, for example when the reader has gone; its frame counts as dropped.
  void discard(PortCounters& counters) noexcept;

 private:
  const bool to_socket_ = false;
  std::array<std::byte, max_frame> rest_;
  std::size_t rest_begin_ = 0;
  std::size_t rest_end_ = 0;
  bool rest_is_reply_ = false;
};

}  // namespace imud
