// Channel: one emulated sensor, from the truth at an instant to the bytes on its port, and back from its host.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "core/imu.hpp"
#include "emulator/config.hpp"
#include "emulator/counters.hpp"
#include "emulator/device_clock.hpp"
#include "emulator/sync.hpp"
#include "transports/port.hpp"

namespace imud {

// Imu, device, port, pins and the sensor's clock. A sample goes through sense(), encode() and transmit(), in this
// order; encode() polls the device's deadlines up to the sample first. The host is served and deadlines are polled at
// any time between two of these calls. After construction nothing here allocates, locks, logs or throws, and only
// wait_until_sent() waits. One thread; the counters may be read by any.
class Channel {
 public:
  // Opens the port and the pins. Throws PortError.
  Channel(const ImuConfig& config, std::uint64_t seed, const Sync::OpenPort& open);

  const std::string& name() const noexcept { return name_; }
  const Grid& grid() const noexcept { return grid_; }
  const ImuCounters& counters() const noexcept { return counters_; }
  // True if its port is a CAN bus.
  bool is_can() const noexcept { return is_can_; }
  // True if the sensor samples a vehicle at rest until there is truth.
  bool rests_before_truth() const noexcept { return rests_before_truth_; }

  // --- Time ---
  // Power comes on at host time `origin`; the sensor's clock runs with the host's from there.
  void power_on(HostTime origin) noexcept;
  // Sets the clock as DeviceClock::set(), and the device's times with it.
  void set_clock(DeviceTime zero, std::optional<HostTime> origin) noexcept;
  // The grid starts: the next sample is that of instant 0.
  void start_samples() noexcept { clock_.start_samples(); }
  // A run of the truth begins: its first sample has no increments.
  void begin_run() noexcept;
  // Switches the device's supply off and on.
  void cycle_power(HostTime now) noexcept;

  // --- Samples ---
  // Takes the sample of instant `k` of the grid, from the truth at `time`, or from the vehicle at rest.
  Sample sense(const Timeline& timeline, TruthTime time, std::uint64_t k) noexcept;
  Sample sense_at_rest(Nanoseconds since_power_on, std::uint64_t k) noexcept;
  // Makes the sample's frames, after those of the device's deadlines up to it have left. `truth`: the time whose
  // edges the device receives first; nullopt: edges are discarded. `silent`: the frames are discarded.
  void encode(const Sample& sample, std::optional<TruthTime> truth, bool silent) noexcept;
  // Hands the frames to the port.
  void transmit() noexcept;
  // Counts the sample as sent, with its lateness and the time that transmit() took if a clock paces it.
  void count_sample() noexcept;
  void note_times(Nanoseconds lateness, Nanoseconds write) noexcept;
  // Waits until the port has passed on all frames handed to it and has room for more, as long as its reader, or its
  // bus, accepts some within 2 s; after that it returns at once until all is accepted again. So nothing is dropped
  // where no instant is missed by waiting. Returns when `stop` is set.
  void wait_until_sent(const std::atomic<bool>& stop) noexcept;

  // --- Host and deadlines ---
  // Executes what the host has sent, at most some 256 bytes. Returns false if there may be more, or an error that
  // stays: poll() would return at once again.
  bool serve(HostTime now) noexcept;
  // Polls the device's deadlines up to `now`; its frames leave at once.
  void poll(HostTime now) noexcept { poll_until(clock_.now(now)); }
  // Hands on what the port holds back.
  void flush() noexcept;
  // The next time at which flush() or poll() has something to do; nullopt: not by time.
  std::optional<HostTime> next_wake() const noexcept;
  // Discards what the port still holds back: it counts as dropped.
  void discard_pending() noexcept;

  Port& port() noexcept { return *port_; }
  // The time up to which the imu has used the truth of this run; nullopt before its first sample.
  std::optional<TruthTime> used_until() const noexcept;
  // Uses the truth up to `until`, which is not after the imu's next sample.
  void advance(const Timeline& timeline, TruthTime until) noexcept {
    if (has_sampled_) imu_.advance(timeline, until);
  }

 private:
  void poll_until(DeviceTime now) noexcept;
  void send(const FrameBuffer& frames) noexcept;
  void apply_uart() noexcept;
  bool holds_back() const noexcept;
  void publish() noexcept;

  const std::string name_;
  const Grid grid_;
  const bool rests_before_truth_;
  const bool is_can_;
  Imu imu_;
  std::unique_ptr<Device> device_;
  std::unique_ptr<Port> port_;
  std::optional<Sync> sync_;  // nothing if no pin is connected
  DeviceClock clock_;
  UartSettings uart_;          // the device's, as the port knows them
  std::uint64_t handed_ = 0;   // frames given to the port
  bool is_resting_ = false;    // the last sample was taken at rest
  bool has_sampled_ = false;   // in this run
  bool is_stalled_ = false;    // the port accepted nothing for too long
  FrameBuffer frames_;         // of the sample prepared
  FrameBuffer others_;         // of a deadline, of an answer, or discarded
  std::uint32_t status_ = 0;   // of the sample prepared
  bool silent_ = false;        // likewise
  bool senses_truth_ = false;  // likewise
  ImuCounters counters_;
};

}  // namespace imud
