// MessageFaults: faults of the messages: a device's input samples, and the frames that it makes.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/frame.hpp"
#include "core/numbers/random.hpp"
#include "core/sample.hpp"
#include "emulator/ground/packet_ring.hpp"
#include "emulator/plan/fault.hpp"

namespace imud {

struct FaultConfig;

// For the samples of one imu, in order. No allocation after construction; one thread.
class MessageFaults {
 public:
  // `faults`: the run's faults. Allocates for the frames of the longest delay at `rate_hz`, and for 256 KiB.
  // `normals`: by the faults' numbers; they must outlive this.
  MessageFaults(std::span<const FaultConfig> faults, std::span<const Normals> normals, std::string_view imu,
                double rate_hz);
  // Keeps the counter of a sample on which no fault acts, for the next one.
  void remember(const Sample& sample) noexcept { counter_ = sample.counter; }
  // Determines the changes to a sample and its frames. `k`: its number in its run.
  void take(std::span<const ActiveFault> faults, std::uint64_t k, const Sample& sample) noexcept;
  // Changes the counter and the status of that sample to the values that the device is to send.
  void forge(Sample& sample) const noexcept;
  // The error of the device's clock.
  Nanoseconds clock_offset() const noexcept { return clock_offset_; }
  // The number of the fault whose unit makes the frames; nullopt: the own unit does.
  std::optional<std::uint32_t> other_unit() const noexcept { return other_unit_; }

  // Changes the frames that the device has made of the sample at `time`: removes, repeats or withholds them.
  void shape(FrameBuffer& frames, DeviceTime time) noexcept;
  // The frames of a sample that are to leave after the frames of a later sample, which may not come.
  std::span<const Frame> exchanged() const noexcept { return exchanged_.frames(); }
  // Returns true if frames are withheld.
  bool holds_back() const noexcept { return has_next_; }
  // Returns when withheld frames are due; nullopt: there are none.
  std::optional<DeviceTime> next_release() const noexcept;
  // Returns the next withheld frame if it is due at `time`, until the next call; nothing otherwise.
  std::optional<Frame> release(DeviceTime time) noexcept;
  // Discards withheld frames.
  void discard() noexcept;
  // The number of frames that were discarded because too many were withheld.
  std::uint64_t lost() const noexcept { return lost_; }

 private:
  void withhold(const FrameBuffer& frames, DeviceTime due) noexcept;
  void pop() noexcept;

  const std::span<const Normals> normals_;
  // The withheld frames after the next one: the packet's time is the due time, its interface the UART.
  PacketRing ring_;
  PacketRing::Head next_;                         // the next one
  std::vector<std::byte> next_bytes_, released_;  // the bytes of the next frame, and of the last released one
  bool has_next_ = false;
  DeviceTime last_due_;
  FrameBuffer copy_;       // while frames are repeated
  FrameBuffer exchanged_;  // the frames of a sample that leave after the next frames of a sample
  std::uint64_t lost_ = 0;

  // The changes to the current sample and its frames.
  bool is_missing_ = false, is_exchanged_ = false;
  int repetitions_ = 0;
  std::optional<std::uint32_t> other_unit_;
  Nanoseconds delay_{0};
  Nanoseconds clock_offset_{0};
  std::optional<std::uint64_t> counter_;  // the last sample's counter as it was sent, for counter_stuck
  std::uint64_t stuck_counter_ = 0;       // the counter that counter_stuck sends
  std::uint64_t counter_ahead_ = 0;       // how far the sent counter is ahead of the sample's counter
  std::uint32_t status_kept_ = ~std::uint32_t{0}, status_added_ = 0;
};

}  // namespace imud
