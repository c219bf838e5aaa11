// CanQueue: the frames that wait for a CAN interface, and the time at which the next may leave.
#pragma once

#include <linux/can.h>

#include <array>
#include <chrono>
#include <cstddef>
#include <optional>

#include "core/time.hpp"

namespace imud {

// First in, first out. Frames queued together (a sample, an answer, a transfer of several frames) leave all or none.
// Each frame has a spacing to the next, so that an interface without bit timing carries no more than a bus would.
// The size is fixed; socket and clock are the caller's. One thread.
class CanQueue {
 public:
  static constexpr std::size_t max_frames = 256;
  // A paced queue that is flushed late catches up by at most this time, so that a receiver's default buffer (277
  // frames on Linux) holds the burst: 106 frames at 1 Mbit/s, because the shortest takes 47 bits.
  static constexpr Nanoseconds max_burst = std::chrono::milliseconds(5);
  // A full interface is tried again after this time, in which a bus of 1 Mbit/s sends four of the ten frames that an
  // interface queues by default.
  static constexpr Nanoseconds retry_pause = std::chrono::microseconds(500);

  struct Queued {
    canfd_frame frame;
    bool fd;              // written as a CAN FD frame
    bool first;           // the first of the frames queued together
    bool is_reply;        // an answer to the host
    HostTime since;       // when it was queued
    Nanoseconds spacing;  // least time from this frame to the next; 0: not paced
  };

  // Frames queued together are stale if they have waited for longer than `max_age` and none of them has left.
  explicit CanQueue(Nanoseconds max_age) noexcept : max_age_(max_age) {}

  // Returns the number of frames for which there is room.
  std::size_t room() const noexcept { return max_frames - count_; }
  std::size_t size() const noexcept { return count_; }
  bool is_empty() const noexcept { return count_ == 0; }
  // Appends a frame. Requires room() > 0.
  void push(const Queued& frame) noexcept { queue_[(first_ + count_++) % max_frames] = frame; }

  // Returns the number of frames, from the oldest, that may leave at `now`.
  std::size_t ready(HostTime now) const noexcept;
  // Returns frame `i`, where 0 is the oldest and i < size().
  const Queued& operator[](std::size_t i) const noexcept { return queue_[(first_ + i) % max_frames]; }

  // Removes the oldest `count` frames after they were sent. While no frame is paced, and the interface is not full,
  // `now` may be HostTime{} here and in ready().
  void sent(std::size_t count, HostTime now) noexcept;
  // Records that the interface has no room: no frame is ready until retry_pause after `now`.
  void interface_full(HostTime now) noexcept { retry_ = now + retry_pause; }
  // Returns true between interface_full() and the next frame that is sent.
  bool is_interface_full() const noexcept { return retry_ != HostTime{}; }
  // Removes the oldest frame, which the interface refused.
  void drop_first() noexcept;
  // Removes the stale frames. Returns their number.
  std::size_t drop_stale(HostTime now) noexcept;
  // Removes all frames. Returns their number.
  std::size_t clear() noexcept;

  // Returns the time from which ready() is not 0, which may be in the past; nullopt if nothing is queued.
  std::optional<HostTime> next() const noexcept;

 private:
  std::array<Queued, max_frames> queue_;  // a ring
  std::size_t first_ = 0, count_ = 0;
  Nanoseconds max_age_;
  HostTime paced_;  // when the next frame may leave by the spacing of earlier frames
  HostTime retry_;  // when the interface may have room again
};

}  // namespace imud
