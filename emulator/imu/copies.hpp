// Copies: further ports of an imu, which carry the bytes of its port.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/frame.hpp"
#include "core/time.hpp"
#include "emulator/imu/device_line.hpp"
#include "emulator/imu/ports.hpp"
#include "emulator/plan/config.hpp"

namespace imud {

// The ports that `also` in [[imu]] names. Each gets every frame of the imu's port, after that port, even if the port
// drops it. Bytes that arrive at a copy are discarded. Where the host's clock paces, a copy is
// never waited for: a frame that it does not take is dropped from this copy alone. In lockstep and fast a copy that
// has no room is waited for as the port is. The constructor allocates; only the wait functions wait. The sampling
// thread alone uses it.
class Copies {
 public:
  Copies() = default;
  // Opens the ports of the imu with that number. Throws PortError.
  Copies(const ImuConfig& config, const Ports& ports, std::size_t imu);

  bool empty() const noexcept { return lines_.empty(); }
  // `time`: the device's time. `is_reply`: the frames answer the host.
  void send(std::span<const Frame> frames, DeviceTime time, bool is_reply) noexcept;
  void set_line(const UartSettings& uart) noexcept;
  // Discards arrived bytes.
  void serve() noexcept;
  void flush() noexcept;
  // Returns when flush() has to be called next; nullopt if nothing waits for a time.
  std::optional<HostTime> next_flush() const noexcept;
  bool is_drained() noexcept;
  bool holds_back() const noexcept;
  void wait_for_room(const std::atomic<bool>& stop) noexcept;
  void wait_until_sent(const std::atomic<bool>& stop) noexcept;
  void discard_pending() noexcept;

  // The frames that the copies have dropped, and of these the ones lost to an error of a file.
  std::uint64_t dropped() const noexcept;
  std::uint64_t failed() const noexcept;

  // For Port::commit().
  std::span<DeviceLine> lines() noexcept { return lines_; }
  std::span<const DeviceLine> lines() const noexcept { return lines_; }

 private:
  std::vector<DeviceLine> lines_;
};

}  // namespace imud
