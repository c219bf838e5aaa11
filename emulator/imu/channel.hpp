// Channel: one emulated sensor, from the truth at an instant to the bytes on its port, and back from its host.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/imu.hpp"
#include "emulator/imu/awaited_truth.hpp"
#include "emulator/imu/command.hpp"
#include "emulator/imu/copies.hpp"
#include "emulator/imu/device_clock.hpp"
#include "emulator/imu/device_line.hpp"
#include "emulator/imu/reload.hpp"
#include "emulator/imu/sample_feed.hpp"
#include "emulator/imu/sync.hpp"
#include "emulator/imu/wire_port.hpp"
#include "emulator/faults/channel_faults.hpp"
#include "emulator/faults/fault_book.hpp"
#include "emulator/faults/other_units.hpp"
#include "emulator/faults/power_faults.hpp"
#include "emulator/ground/counters.hpp"
#include "emulator/ground/host.hpp"
#include "emulator/ground/step_sink.hpp"
#include "emulator/plan/config.hpp"
#include "transports/port.hpp"

namespace imud {

// An imu with its device, ports, pins and clock. A sample goes through sense(), prepare(), encode() and transmit(),
// in this order. The device receives it by encode(), at its instant: until then serve(), poll() and cycle_power() may
// change its frames, but not between encode() and transmit(). So frames leave in the order of the device's calls, and
// the calls are in the order of time. After construction nothing here allocates, locks, logs or
// throws, and only wait_until_sent() and wait_for_room() wait. One thread; the counters may be read by any.
class Channel {
 public:
  // Opens the ports and the pins of the imu with that number. `sink` records the events. `faults`: nullptr: there are
  // none. Throws PortError.
  Channel(const ImuConfig& config, std::size_t number, std::uint64_t seed, const Ports& ports,
          StepSink& sink = StepSink::none(), std::unique_ptr<ChannelFaults> faults = nullptr);

  // Prepares for faults of the wire and of the power: wraps the ports, and makes a second device with the settings as
  // delivered. `config` and `seed`: of the constructor. Called before power_on(). Throws as Protocol::make does.
  void enable_faults(const ImuConfig& config, std::uint64_t seed);

  const std::string& name() const noexcept { return name_; }
  std::uint16_t number() const noexcept { return number_; }
  const Grid& grid() const noexcept { return grid_; }
  const ImuCounters& counters() const noexcept { return counters_; }
  const std::optional<Sync>& sync() const noexcept { return sync_; }
  // Returns true if the port is a CAN bus.
  bool is_can() const noexcept { return is_can_; }
  // The filters of the CAN bus (Port::set_filters()). They do not change: any thread.
  std::span<const CanFilter> can_filters() const noexcept { return can_filters_; }
  // Returns true if the last sample was taken at rest.
  bool is_resting() const noexcept { return is_resting_; }
  // Returns true if the sensor samples a vehicle at rest until the first truth.
  bool rests_before_truth() const noexcept { return rests_before_truth_; }

  // --- Time ---
  // Switches the power on at host time `origin`, from which the sensor's clock runs with the host's.
  void power_on(HostTime origin) noexcept;
  // Sets the clock (DeviceClock::set()), and shifts the times that the device keeps by the same step.
  void set_clock(DeviceTime zero, std::optional<HostTime> origin) noexcept;
  // Starts the grid: the next sample is at instant 0.
  void start_samples() noexcept;
  // Begins a run of the truth, whose first truth is at `begin`. The first sample has no increments.
  void begin_run(TruthTime begin) noexcept;
  // Continues the run after its time has leapt. The next sample has no increments and is flagged as extrapolated.
  void pass_over() noexcept;
  // Switches the device's supply off and on at host time `now`.
  void cycle_power(HostTime now) noexcept;
  // Switches the device's supply at host time `now`. While it is off, the device neither sends nor receives, and the
  // sensor goes on; when it is switched on, the device starts as by cycle_power().
  void set_supply(bool on, HostTime now) noexcept;
  // Discards all frames while `paused`; they are counted. Sensor and device go on.
  void pause(bool paused) noexcept;

  // --- Faults, after enable_faults() ---
  // Begin a fault that acts on this imu, end one fault, or end all, between two samples (FaultSchedule). Without
  // effect if there are no faults.
  void begin_fault(const FaultConfig& fault, std::uint32_t number) noexcept {
    if (faults_ && fault.acts_on(name_)) faults_->schedule().add(fault, number);
  }
  void end_fault(std::uint32_t number) noexcept {
    if (faults_) faults_->schedule().end(number);
  }
  void end_faults() noexcept {
    if (faults_) faults_->schedule().end_all();
  }
  // Sets the faults of a sample, after sense() and before encode(): faults of the wire act on all frames from now on,
  // faults of the power at the sample's instant. After a start the next sample has new turn-on errors.
  void set_faults(std::span<const ActiveFault> wire, std::span<const ActiveFault> power) noexcept;

  // --- Samples ---
  // Take the sample of instant `k` of the grid, of the truth at `time` or of the vehicle at rest, and return it; it
  // is kept for encode().
  Sample& sense(const Timeline& timeline, TruthTime time, std::uint64_t k) noexcept;
  Sample& sense_at_rest(Nanoseconds since_power_on, std::uint64_t k) noexcept;
  // Keeps the truth time up to which the device receives edges before the sample; nullopt: edges are discarded. The
  // frames of a `silent` sample are discarded.
  void prepare(std::optional<TruthTime> truth, bool silent) noexcept;
  // Polls the device's deadlines up to the sample, and sends their frames. Then makes the frames of the sample.
  void encode() noexcept { encode(false); }
  // Sends the sample's frames, and the pulse of the output pin.
  void transmit() noexcept;
  // Called in place of encode() and transmit() if a sample is too late. Discards its frames, the frames of the
  // deadlines up to it, and the pulse. Counts it as skipped.
  void skip() noexcept;
  // Imu::set_seed(), and the bias of one axis of the gyros or the accelerometers (Imu::set_bias()).
  void set_seed(std::uint64_t seed) noexcept { imu_.set_seed(seed); }
  void set_bias(Quantity quantity, std::size_t axis, double bias) noexcept;
  // Executes a command to this imu, or to all. `faults`: the faults of the run.
  void execute(const Command& command, const FaultBook& faults, HostTime now) noexcept;
  // Exchanges the sensor for a reload's sensor, which goes on where the old one was (Imu::continue_from()). On
  // another grid the next sample is at instant 0, and keeps its time.
  // A device with other settings starts as when its supply is switched on, at host time `now`; the sensor goes on.
  void exchange_sensor(Reload::Sensor& sensor, HostTime now) noexcept;
  // Exchanges a port for a reload's port, which gets all frames from now on. The counters go on. In a repeated run
  // there is no port, and only the bit rate changes.
  void exchange_port(Reload::Line& line) noexcept;
  // Adds the counts of a replaced port since its replacement. Any thread.
  void count_replaced(std::uint64_t sent, std::uint64_t replies, std::uint64_t dropped,
                      std::uint64_t failed) noexcept;
  // Computes counters() again.
  void publish() noexcept;
  // The number and the time stamp of the next sample; nullopt: the time is not known before the first truth of a
  // run.
  std::uint64_t next_sample() const noexcept { return imu_.next(); }
  std::optional<DeviceTime> next_time() const noexcept { return clock_.next_sample(); }
  // From now on offers the samples to `feed`.
  void set_feed(SampleFeed& feed) noexcept {
    feed_ = &feed;
    awaited_.set_feed(&feed);
  }
  // Counts the sample as sent. Offers it to the feed when its truth has come.
  void count_sample() noexcept;
  // Called when truth has come: AwaitedTruth::review().
  void review_samples(const Timeline& timeline, TruthQuality::ExtrapolationError& error) noexcept {
    awaited_.review(timeline, error);
  }
  // Returns the outcomes of the expectations. Called after the last sample.
  std::vector<Expected> expected() const {
    return faults_ ? faults_->expectations().results() : std::vector<Expected>{};
  }
  // Ends the faults that act, after the last sample.
  void finish_faults() noexcept {
    if (faults_) faults_->finish();
  }
  // Records how late after its instant a sample was transmitted, and how long transmit() took.
  void record_times(Nanoseconds lateness, Nanoseconds write) noexcept;
  // Waits until the ports have sent all frames. If the reader or the bus accepts nothing for 2 s, the port is no
  // longer waited for until it has accepted all frames. It also returns when `stop` is set.
  void wait_until_sent(const std::atomic<bool>& stop) noexcept;
  // Waits in the same way until each port has room for the frames of a sample, so that nothing is dropped where the
  // host's clock does not pace.
  void wait_for_room(const std::atomic<bool>& stop) noexcept {
    if (!are_files_) wait_for_lines(stop);
    copies_.wait_for_room(stop);
  }
  // Returns true while a port holds frames back.
  bool holds_back() const noexcept;

  // --- Host and deadlines ---
  // Calls propose(uart, Port::Received) for what the host has sent, at most some 256 bytes from each port. Returns
  // false if ::poll() would return at once again, because of more bytes or a lasting error.
  template <class Propose>
  bool serve(Propose propose) noexcept {
    if (!copies_.empty()) copies_.serve();
    return !are_files_ && serve_lines(propose);
  }
  // Executes the host's bytes to the UART, at host time `now`, and sends the replies.
  void receive(Frame frame, std::size_t uart, HostTime now) noexcept;
  // Returns how often it has replied. record_reply() records how long a reply took from the arrival on.
  std::uint64_t reply_count() const noexcept { return reply_count_; }
  void record_reply(Nanoseconds duration) noexcept { counters_.reply.add(seconds(duration)); }
  // Polls the device's deadlines up to `now`, and sends their frames.
  void poll(HostTime now) noexcept { poll_until(clock_.now(now)); }
  // Sends the frames that the ports hold back, as far as they can now.
  void flush() noexcept;
  // Checks whether the ports have readers, for counters(). Does not read a host's bytes.
  void update_port_states() noexcept;
  // Returns when flush() or poll() has to be called next; nullopt if neither waits for a time.
  std::optional<HostTime> next_wake() const noexcept;
  // Discards the frames that the ports still hold back; they count as dropped.
  void discard_pending() noexcept;
  // Called at the end: Port::commit() of all ports, even if one fails. Throws the first exception.
  void commit();

  // The number of ports: 1, or 2 if the product's second UART is connected; `i` is the frames' Frame::uart.
  std::size_t port_count() const noexcept { return line_count_; }
  Port& port(std::size_t i) noexcept { return *lines_[i].port; }
  Copies& copies() noexcept { return copies_; }
  // The numbers of the first port's interface in the record, and of what the host sends to a port.
  std::uint16_t record_interface() const noexcept { return lines_[0].interface; }
  std::uint16_t host_interface(std::size_t uart) const noexcept {
    return static_cast<std::uint16_t>(lines_[uart].interface + 1);
  }
  // Returns the time up to which the imu has used the truth of this run; nullopt before its first sample.
  std::optional<TruthTime> used_until() const noexcept;
  // Integrates the truth up to `until`, which is not after the imu's next sample (Imu::advance()).
  void advance(const Timeline& timeline, TruthTime until) noexcept {
    if (has_sampled_) imu_.advance(timeline, until);
  }

 private:
  std::span<DeviceLine> lines() noexcept { return {lines_.data(), line_count_}; }
  std::span<const DeviceLine> lines() const noexcept { return {lines_.data(), line_count_}; }

  // Returns the figures that a unit has of these errors.
  static OwnFigures figures_of(const ImuModel& model) noexcept;
  // Adds the filters of a product. The device's own identifiers pass too, so that the port can confirm its frames and
  // the device detects other users.
  static void add_filters(const Protocol& protocol, const Settings& settings, double rate_hz,
                          std::vector<CanFilter>& filters);

  FeedSample feed_sample() const noexcept;
  // `too_late`: frames are discarded.
  void poll_until(DeviceTime now, bool too_late = false) noexcept;
  void encode(bool too_late) noexcept;
  void release_until(DeviceTime now, bool too_late) noexcept;
  void set_clock_offset(Nanoseconds offset) noexcept;
  // Returns the UTC, ns since 1970, of a time of clock_; nullopt if the host's clock does not pace it.
  std::optional<std::int64_t> utc_ns_of(DeviceTime time) const noexcept;
  // Passes frames of the device's time `time` to the ports of their UARTs, by Port::reply() or by Port::send().
  void send(std::span<const Frame> frames, DeviceTime time, bool is_reply = false) noexcept;
  void add_interfaces();
  void record(DeviceLine& line, std::span<const Frame> frames, std::uint64_t dropped) noexcept;
  template <class Propose>
  bool serve_lines(Propose propose) noexcept;
  void publish_states(bool has_received) noexcept;
  bool is_on() const noexcept { return is_supplied_ && power_step_.is_on; }
  void start_device(DeviceTime now) noexcept;
  void exchange_device(Reload::Sensor& sensor, HostTime now) noexcept;
  // Switches the device by the sample's faults of the power. Returns true if it starts.
  bool apply_power_faults() noexcept;
  void apply_uarts() noexcept;
  void apply_filters() noexcept;
  void wait_for_lines(const std::atomic<bool>& stop) noexcept;
  void publish_bus() noexcept;

  const std::string name_;
  const std::uint16_t number_;  // in the configuration
  Grid grid_;
  const bool rests_before_truth_;
  const bool is_can_;
  Imu imu_;
  bool device_filters_;
  SensorFilters filters_;  // that the imu has, if device_filters_
  std::unique_ptr<Device> device_;
  std::array<DeviceLine, 2> lines_;  // by Frame::uart
  std::size_t line_count_ = 1;
  bool are_files_ = true;  // DeviceLine::is_file of all
  // The counts of replaced ports since their replacement.
  struct Replaced {
    std::atomic<std::uint64_t> sent = 0, replies = 0, dropped = 0, failed = 0;
  };
  Replaced replaced_;
  std::vector<CanFilter> can_filters_;
  Copies copies_;  // of the first line
  StepSink& sink_;
  std::optional<Sync> sync_;                     // nullopt if no pin is connected
  const std::unique_ptr<ChannelFaults> faults_;  // nullptr: there are none
  std::int64_t utc_offset_ns_ = 0;               // UTC, ns since 1970, less host time; of enable_faults()
  // By how much the clock of the device is ahead of clock_, because of a fault.
  Nanoseconds clock_offset_{0};
  DeviceClock clock_;
  bool is_resting_ = false;      // the last sample was taken at rest
  bool has_sampled_ = false;     // in this run
  bool has_leapt_ = false;       // since the last sample
  TruthTime run_begin_;          // from which the times of faults count
  std::uint64_t power_ons_ = 0;  // after the first
  std::optional<PowerFaults> power_faults_;
  std::unique_ptr<Device> other_device_;  // as delivered, or after a loss of the settings the configured one
  bool has_lost_settings_ = false;
  OtherUnits* other_units_ = nullptr;       // the device, if faults have other units in its place
  bool is_supplied_ = true;                 // by set_supply()
  PowerStep power_step_, next_power_step_;  // by faults: now, and from the next sample on
  Sample sample_;                           // of sense()
  bool paused_ = false;                     // pause()
  std::optional<TruthTime> truth_;          // prepare() sets these two
  bool silent_ = false;
  bool is_discarded_ = false;  // encode() sets it: the frames of sample_ are not sent
  FrameBuffer frames_;  // of the sample
  std::uint64_t reply_count_ = 0;
  FrameBuffer others_;  // of a deadline or an answer, or of a silent sample
  ImuCounters counters_;
  AwaitedTruth awaited_;
  Nanoseconds ahead_{0};        // of sample_, from the newest truth
  SampleFeed* feed_ = nullptr;  // nullptr: nobody can watch
};

template <class Propose>
bool Channel::serve_lines(Propose propose) noexcept {
  // The limit of one call, so that a flood from the host does not delay samples. Between two calls no line carries as
  // much.
  constexpr std::size_t most_served = 256, per_frame = 16;
  bool has_received = false, has_more = false;
  for (std::size_t uart = 0; uart < line_count_; ++uart) {
    std::size_t received = 0;  // bytes, with a surcharge for each frame
    while (received < most_served && !lines_[uart].is_file) {
      const auto chunk = lines_[uart].port->receive();
      if (!chunk) break;
      received += per_frame + chunk->frame.bytes.size();
      propose(uart, *chunk);
    }
    has_received = has_received || received > 0;
    has_more = has_more || received >= most_served;
  }
  publish_states(has_received);
  return has_received && !has_more;
}

}  // namespace imud
