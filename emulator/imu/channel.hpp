// Channel: one emulated sensor, from the truth at an instant to the bytes on its port, and back from its host.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "emulator/faults/channel_faults.hpp"
#include "emulator/faults/fault_book.hpp"
#include "emulator/ground/counters.hpp"
#include "emulator/ground/step_sink.hpp"
#include "emulator/imu/awaited_truth.hpp"
#include "emulator/imu/command.hpp"
#include "emulator/imu/lines.hpp"
#include "emulator/imu/ports.hpp"
#include "emulator/imu/reload.hpp"
#include "emulator/imu/sensor.hpp"
#include "emulator/imu/sync.hpp"
#include "emulator/imu/unit.hpp"
#include "emulator/plan/config.hpp"

namespace imud {

// The three parts of an imu, and the order in which a sample, a deadline and the host's bytes go through them. A
// sample is taken by `sensor`, and then goes through prepare(), encode() and transmit(). The device receives it by
// encode(), at its instant: until then receive(), poll() and cycle_power() may change its frames, but not between
// encode() and transmit(). So frames leave in the order of the device's calls, and the calls are in the order of
// time. After construction nothing here allocates, locks, logs or throws, and only the wait functions of `lines`
// wait. One thread; the counters may be read by any.
class Channel {
 public:
  // Opens the ports and the pins of the imu with that number. `sink` takes the frames. `faults` is nullptr if
  // there are none. Throws PortError.
  Channel(const ImuConfig& config, std::size_t number, std::uint64_t seed, const Ports& ports,
          StepSink& sink = StepSink::none(), std::unique_ptr<ChannelFaults> faults = nullptr);
  // Prepares for faults of the wire and of the power, which the constructor does if there are faults. `config` and
  // `seed` must be the arguments of the constructor. Must be called before power_on(). Throws as Protocol::make does.
  void enable_faults(const ImuConfig& config, std::uint64_t seed);

  const std::string name;
  const std::uint16_t number;     // in the configuration
  const bool rests_before_truth;  // samples a vehicle at rest until the first truth
  const bool is_can;              // the port is a CAN bus
  const std::unique_ptr<ChannelFaults> faults;
  Sensor sensor;
  Unit unit;
  Lines lines;
  std::optional<Sync> sync;  // nullopt if no pin is connected
  AwaitedTruth awaited;
  ImuCounters counters;
  std::uint64_t reply_count = 0;  // how often the device has replied

  // --- Time ---
  // Switches the power on at host time `origin`, from which the sensor's clock runs with the host's.
  void power_on(HostTime origin) noexcept;
  // Sets the clock (DeviceClock::set()), and shifts the times that the device keeps by the same step.
  void set_clock(DeviceTime zero, std::optional<HostTime> origin) noexcept;
  // Begins a run of the truth, whose first truth is at `begin`; nullopt: the run goes on after its time has leapt.
  void begin_run(std::optional<TruthTime> begin) noexcept;
  // Switches the device's supply off and on at host time `now`.
  void cycle_power(HostTime now) noexcept;

  // --- Changes while the run goes on, between two samples ---
  // Executes a command to this imu, or to all. While its supply is off, the device neither sends nor receives, and
  // the sensor goes on; when it is switched on, the device starts as by cycle_power(). `book`: the faults of the run.
  void execute(const Command& command, const FaultBook& book, HostTime now) noexcept;
  // Exchanges the model, and the device if the reload has one. The new device starts. The reload then holds the old
  // model and the old device.
  void exchange(Reload::Sensor& next, HostTime now) noexcept;
  // Exchanges a port. Frames that the old port holds back stay in the old port.
  void exchange(Reload::Line& next) noexcept;
  // Sets the faults of the power at the last sample, after enable_faults(). They act at the sample's instant. After a
  // start the next sample has new turn-on errors.
  void set_power_faults(std::span<const ActiveFault> faults_of_power) noexcept;

  // --- Samples, after Sensor::sense() ---
  // A sample on its way to the device and the ports.
  struct Outgoing {
    Sample* sample = nullptr;
    std::optional<TruthTime> truth;  // up to which the device receives edges before it; nullopt: edges are discarded
    bool is_silent = false;          // its frames are discarded
    bool is_shown = false;           // the feed gets it
  };
  // On a cache line of its own, because an EncodingThread uses the rest of the channel.
  struct alignas(64) Prepared : Outgoing {};
  Prepared prepared;  // by prepare()
  // Prepares the sample that Sensor::sense() has taken, and sets its faults of the power.
  void prepare(const std::optional<TruthTime>& truth, bool silent) noexcept;
  // Polls the device's deadlines up to the sample, and sends their frames. Then the sample's faults of the wire act
  // on all frames, and the frames of the sample are made. If the sample is `skipped`, it counts as skipped, all these
  // frames are discarded, and transmit() must not follow. transmit() and count_sample() must be called for the same
  // sample.
  void encode(const Outgoing& outgoing, bool skipped = false) noexcept;
  // Sends the sample's frames, and the pulse of the output pin.
  void transmit() noexcept;
  // Counts the sample as sent. Offers it to the feed when its truth has come. The counters of the parts follow by
  // flush(), or after some samples.
  void count_sample() noexcept {
    constexpr std::uint32_t rare = status::truth_extrapolated | status::truth_stale | status::at_rest;
    counters.samples.count();
    if ((outgoing_.sample->status & rare) != 0 || outgoing_.is_silent || outgoing_.is_shown) [[unlikely]]
      count_rare_sample();
    constexpr int most_unpublished = 64;
    if (++unpublished_ == most_unpublished) publish();
  }

  // --- Host and deadlines ---
  // Executes the host's bytes to the UART, at host time `now`, and sends the replies.
  void receive(Frame frame, std::size_t uart, HostTime now) noexcept;
  // Polls the device's deadlines up to `now`, and sends their frames.
  void poll(HostTime now) noexcept { poll_until(sensor.clock().now(now), false); }
  // Sends the frames that the ports hold back, as far as they can now. Publishes the counters if there is news.
  // `at_end`: after the last sample; first sends the frames that a fault withholds until the next sample.
  void flush(bool at_end = false) noexcept {
    if (at_end) send_exchanged();
    if (lines.flush() || unpublished_ > 0) publish();
  }
  // Lines::wait_until_sent().
  void wait_until_sent(const std::atomic<bool>& stop) noexcept {
    if (lines.wait_until_sent(stop)) publish();
  }
  // Returns when flush() or poll() has to be called next; nullopt if neither waits for a time.
  std::optional<HostTime> next_wake() const noexcept;
  // Computes the counters of the parts again.
  void publish() noexcept;

 private:
  void set_supply(bool on, HostTime now) noexcept;
  void start_device(DeviceTime now) noexcept;
  void set_bias(Quantity quantity, std::size_t axis, double bias) noexcept;
  void count_rare_sample() noexcept;
  void poll_until(DeviceTime now, bool too_late) noexcept {
    const std::optional<DeviceTime> deadline = unit.deadline();
    if ((faults && faults->messages().holds_back()) || (deadline && *deadline <= now)) poll_due(now, too_late);
  }
  void poll_due(DeviceTime now, bool too_late) noexcept;
  void send_exchanged() noexcept;
  void release_until(DeviceTime now, bool too_late) noexcept;
  void send(std::span<const Frame> frames, DeviceTime time, bool is_reply = false) noexcept;
  // Lets the sensor follow the device, whose settings may have changed.
  void follow_device() noexcept { sensor.follow(unit.device().filters(), unit.device().navigation_requests()); }
  FeedSample feed_sample() noexcept;
  std::optional<FeedSolution> feed_solution() noexcept;

  Outgoing outgoing_;
  bool paused_ = false;        // by a command: all frames are discarded, and counted
  int unpublished_ = 0;        // samples that were counted since publish()
  bool is_discarded_ = false;  // encode() sets it: the frames of the sample are not sent
};

}  // namespace imud
