// PacedWriter: releases characters when a UART at the line's speed would have received them.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>

#include "core/frame.hpp"
#include "core/time.hpp"
#include "core/uart.hpp"
#include "transports/port.hpp"

namespace imud {

// A queue of whole frames, first in, first out. A frame begins when it is queued, or when the one before has ended;
// its character i is received (i + 1) * bits_per_character / baud later. Received characters are released as a 16550
// passes them on: 14 together, or fewer at the end of the queue. One thread; the caller supplies the time.
class PacedWriter {
 public:
  static constexpr std::size_t max_characters = FrameBuffer::max_bytes;
  static constexpr std::size_t max_frames = 512;
  // The trigger level of a 16550A's receive FIFO (PC16550D data sheet, FCR bits 6-7).
  static constexpr std::size_t fifo = 14;

  // Queues frames, each to be sent at `line` (baud not 0). A frame for which there is no room is dropped whole and
  // counted; all are dropped if the first would have to wait for longer than `max_wait`. `are_replies`: the
  // frames count as PortCounters::replies, too.
  void queue(std::span<const Frame> frames, const UartSettings& line, HostTime now, Nanoseconds max_wait,
             PortCounters& counters, bool are_replies = false) noexcept;

  // Returns the next characters to write, contiguous in memory and with the same line settings; empty if none are
  // received by `now`.
  std::span<const std::byte> ready(HostTime now) noexcept;
  // Removes the first `count` of these characters, which the caller has written; a frame counts as sent with its
  // last character. If some are left, because the kernel took no more, next_flush() is a millisecond later.
  void written(std::size_t count, HostTime now, PortCounters& counters) noexcept;

  // Returns the time at which ready() next returns characters; nullopt if nothing is queued.
  std::optional<HostTime> next_flush() const noexcept;
  bool is_idle() const noexcept { return frames_ == 0; }
  std::size_t queued() const noexcept { return count_; }  // characters
  // Returns the line settings of the next character. Requires queued() > 0.
  const UartSettings& line() const noexcept { return queue_[first_frame_].line; }
  // Empties the queue; its frames count as dropped.
  void discard(PortCounters& counters) noexcept;

 private:
  struct Queued {
    HostTime begin;
    UartSettings line;
    std::size_t size = 0;  // at least 1
    bool is_reply = false;
    HostTime received(std::size_t characters) const noexcept;  // when so many characters are received
    std::size_t received_by(HostTime now) const noexcept;      // the characters received by `now`
  };
  const Queued& frame(std::size_t i) const noexcept { return queue_[(first_frame_ + i) % max_frames]; }
  void release(HostTime now) noexcept;

  std::array<std::byte, max_characters> characters_;  // a ring, as queue_
  std::size_t first_ = 0, count_ = 0;
  std::array<Queued, max_frames> queue_;
  std::size_t first_frame_ = 0, frames_ = 0;
  std::size_t of_first_ = 0;  // characters of the first frame that are written
  std::size_t free_ = 0;      // characters released, but not written
  HostTime idle_at_;          // when the last queued character is received
  HostTime retry_;            // when to write again if free_ is not 0
};

}  // namespace imud
