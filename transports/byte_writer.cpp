#include "transports/byte_writer.hpp"

#include <sys/socket.h>
#include <sys/uio.h>

#include <algorithm>
#include <cerrno>

namespace imud {
namespace {

// The pieces of one writev(). Frames that are adjacent in memory, as a FrameBuffer's are, become one piece.
class Pieces {
 public:
  bool add(std::span<const std::byte> bytes) noexcept {
    if (bytes.empty()) return true;
    if (count_ > 0) {
      iovec& last = pieces_[count_ - 1];
      if (static_cast<const std::byte*>(last.iov_base) + last.iov_len == bytes.data()) {
        last.iov_len += bytes.size();
        return true;
      }
    }
    if (count_ == pieces_.size()) return false;
    pieces_[count_++] = {const_cast<std::byte*>(bytes.data()), bytes.size()};
    return true;
  }
  bool empty() const noexcept { return count_ == 0; }
  ssize_t write(int fd, bool is_socket) noexcept {
    if (!is_socket) return ::writev(fd, pieces_.data(), static_cast<int>(count_));
    msghdr message{};
    message.msg_iov = pieces_.data();
    message.msg_iovlen = count_;
    return ::sendmsg(fd, &message, MSG_NOSIGNAL | MSG_DONTWAIT);
  }

 private:
  std::array<iovec, FrameBuffer::max_frames + 1> pieces_;
  std::size_t count_ = 0;
};

}  // namespace

int ByteWriter::write(int fd, std::span<const Frame> frames, PortCounters& counters, bool are_replies) noexcept {
  const Taken taken = write_some(fd, frames, counters, are_replies);
  counters.dropped += frames.size() - taken.frames;
  return taken.error;
}

ByteWriter::Taken ByteWriter::write_some(int fd, std::span<const Frame> frames, PortCounters& counters,
                                         bool are_replies) noexcept {
  int error = 0;
  std::size_t next = 0;   // the first frame that is neither sent nor dropped
  std::size_t taken = 0;  // bytes of `next` that the kernel has taken
  while (rest_begin_ != rest_end_ || next != frames.size()) {
    if (next != frames.size() && frames[next].bytes.size() > max_frame) {
      ++counters.dropped;
      ++next;
      continue;
    }

    Pieces pieces;
    pieces.add({rest_.data() + rest_begin_, rest_end_ - rest_begin_});
    for (std::size_t i = next; i != frames.size() && frames[i].bytes.size() <= max_frame; ++i)
      if (!pieces.add(frames[i].bytes.subspan(i == next ? taken : 0))) break;

    std::size_t written = 0;
    if (!pieces.empty()) {
      const ssize_t result = pieces.write(fd, to_socket_);
      if (result < 0 && errno == EINTR) continue;
      if (result < 0) error = errno;
      if (result <= 0) break;
      written = static_cast<std::size_t>(result);
    }

    if (rest_begin_ != rest_end_) {
      const std::size_t of_rest = std::min(written, rest_end_ - rest_begin_);
      rest_begin_ += of_rest;
      written -= of_rest;
      if (rest_begin_ != rest_end_) continue;
      counters.count_sent(rest_is_reply_);
    }
    while (next != frames.size() && frames[next].bytes.size() <= max_frame &&
           written >= frames[next].bytes.size() - taken) {
      written -= frames[next].bytes.size() - taken;
      taken = 0;
      counters.count_sent(are_replies);
      ++next;
    }
    taken += written;
  }

  if (taken > 0) {
    const auto rest = frames[next].bytes.subspan(taken);
    std::copy(rest.begin(), rest.end(), rest_.begin());
    rest_begin_ = 0;
    rest_end_ = rest.size();
    rest_is_reply_ = are_replies;
    ++next;
  }
  return {next, error == EAGAIN ? 0 : error};
}

void ByteWriter::discard(PortCounters& counters) noexcept {
  if (rest_begin_ == rest_end_) return;
  rest_begin_ = rest_end_;
  ++counters.dropped;
}

}  // namespace imud
