// Lines: the ports of an emulated sensor, between the frames of its device and the descriptors.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "emulator/faults/fault_schedule.hpp"
#include "emulator/ground/counters.hpp"
#include "emulator/ground/step_sink.hpp"
#include "emulator/imu/copies.hpp"
#include "emulator/imu/device_line.hpp"
#include "emulator/imu/ports.hpp"
#include "emulator/imu/reload.hpp"
#include "emulator/plan/config.hpp"
#include "protocols/protocol.hpp"

namespace imud {

// Has one line, or two if the product's second UART is connected; Frame::uart selects the line. Has the copies of the
// first line, too. After construction only enable_faults() and commit() allocate, lock or throw, and only the wait
// functions wait. Must be used by one thread; any thread may use replaced().
class Lines {
 public:
  // Opens the ports of the imu with that number. `device` has the settings of its UARTs. Throws PortError.
  Lines(const ImuConfig& config, std::size_t imu, const Ports& ports, const Device& device, StepSink& sink);
  // Wraps each port in a WirePort, on which the faults of the wire act. `faults` are the configured faults of the
  // run, from which the CAN filters are computed. `seed` is the run's seed. `most`: the number of faults that may act
  // at once.
  void enable_faults(const ImuConfig& config, std::uint64_t seed, std::span<const FaultConfig> faults,
                     std::size_t most);
  // Sets the faults that act on the wire during the sample at `time`. Requires enable_faults().
  void set_faults(std::span<const ActiveFault> faults, DeviceTime time) noexcept;

  std::span<DeviceLine> all() noexcept { return {lines_.data(), count_}; }
  std::span<const DeviceLine> all() const noexcept { return {lines_.data(), count_}; }
  Copies& copies() noexcept { return copies_; }
  // The filters of the CAN bus (Port::set_filters()). Any thread may call this after enable_faults(), because the
  // filters do not change afterwards.
  std::span<const CanFilter> can_filters() const noexcept { return can_filters_; }

  // Passes frames of the device's time `time` to the ports of their UARTs, by Port::reply() or by Port::send().
  void send(std::span<const Frame> frames, DeviceTime time, bool is_reply) noexcept {
    while (!frames.empty()) {
      const std::size_t size = count_ == 1 ? frames.size() : of_one_uart(frames);
      send(lines_[frames.front().uart], frames.first(size), time, is_reply);
      frames = frames.subspan(size);
    }
  }
  // Applies the UART settings of `device` to everything that is sent afterwards. The reply to a change of the
  // settings still has the old settings.
  void set_uarts(const Device& device) noexcept;
  // Calls propose(uart, Port::Received) for what the host has sent, at most some 256 bytes from each port. Sets
  // `has_received`. Returns false if ::poll() would return at once again, because of more bytes or a lasting error.
  template <class Propose>
  bool serve(Propose propose, bool& has_received) noexcept;
  // Sends as many of the frames that the ports hold back as the ports take now. Returns true if a port held frames.
  bool flush() noexcept;
  // Returns when flush() has to be called next; nullopt if nothing waits for a time.
  std::optional<HostTime> next_flush() const noexcept;
  // Waits until each port has room for the frames of a sample, so that nothing is dropped where the host's clock does
  // not pace the run. If the reader or the bus of a port accepts nothing for 2 s, later calls do not wait for this
  // port until it has accepted all its frames. Also returns when `stop` is set.
  void wait_for_room(const std::atomic<bool>& stop) noexcept {
    if (never_waits()) return;
    if (lines_[0].may_lack_room()) wait_for_room(lines_[0], stop);
    if (count_ == 2 && lines_[1].may_lack_room()) wait_for_room(lines_[1], stop);
    if (!copies_.empty()) copies_.wait_for_room(stop);
  }
  // Waits as wait_for_room() does, until all frames are sent. Returns false, without a wait, if all ports are files.
  bool wait_until_sent(const std::atomic<bool>& stop) noexcept;
  // Discards the frames that the ports still hold back; they count as dropped.
  void discard_pending() noexcept;
  // Port::commit() of all ports, even if one fails. Throws the first exception.
  void commit();

  // Exchanges a port for the reload's port. The reload holds the old port afterwards.
  void exchange(Reload::Line& line) noexcept;
  // The counts of replaced ports since their replacement. Any thread.
  struct Replaced {
    std::atomic<std::uint64_t> sent = 0, replies = 0, dropped = 0, failed = 0;
  };
  Replaced& replaced() noexcept { return replaced_; }
  // Returns true if a port's state is not the state in the counters.
  bool has_new_state(const ImuCounters& counters) const noexcept;
  // Writes the current counts of the ports to `counters`. `lost` is the number of further frames that were dropped.
  void publish(ImuCounters& counters, std::uint64_t lost) const noexcept;

 private:
  // Returns how many frames at the beginning of `frames` are for the same UART as the first frame.
  static std::size_t of_one_uart(std::span<const Frame> frames) noexcept {
    const auto is_other = [&](const Frame& frame) { return frame.uart != frames.front().uart; };
    return static_cast<std::size_t>(std::ranges::find_if(frames, is_other) - frames.begin());
  }
  bool never_waits() const noexcept { return are_files_ && copies_.empty(); }
  void look_at_ports() noexcept;
  static void wait_for_room(DeviceLine& line, const std::atomic<bool>& stop) noexcept;
  void send(DeviceLine& line, std::span<const Frame> frames, DeviceTime time, bool is_reply) noexcept;
  void add_interfaces(const std::string& imu, StepSink& sink);
  void add_filters(const Protocol& protocol, const Settings& settings, double rate_hz);
  void publish_bus(ImuCounters& counters) const noexcept;

  const bool is_can_;
  StepSink& sink_;
  std::array<DeviceLine, 2> lines_;  // by Frame::uart
  std::size_t count_ = 1;
  bool are_files_ = true;  // DeviceLine::is_file of all
  bool listens_ = true;    // DeviceLine::listens of one
  Replaced replaced_;
  std::vector<CanFilter> can_filters_;
  Copies copies_;  // of the first line
};

template <class Propose>
bool Lines::serve(Propose propose, bool& has_received) noexcept {
  has_received = false;
  if (!copies_.empty()) copies_.serve();
  if (!listens_) return false;
  // The limit of one call, so that a flood from the host does not delay samples. Between two calls no line carries as
  // much.
  constexpr std::size_t most_served = 256, per_frame = 16;
  bool has_more = false;
  for (std::size_t uart = 0; uart < count_; ++uart) {
    std::size_t received = 0;  // bytes, with a surcharge for each frame
    while (received < most_served && lines_[uart].listens) {
      const auto chunk = lines_[uart].port->receive();
      if (!chunk) break;
      received += per_frame + chunk->frame.bytes.size();
      propose(uart, *chunk);
    }
    has_received = has_received || received > 0;
    has_more = has_more || received >= most_served;
  }
  return has_received && !has_more;
}

}  // namespace imud
