// Session: truth in, samples out: the one path that every clock drives.
#pragma once

#include <poll.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/imu.hpp"
#include "core/timeline.hpp"
#include "emulator/config.hpp"
#include "emulator/counters.hpp"
#include "emulator/schedule.hpp"
#include "emulator/sync.hpp"
#include "emulator/truth_intake.hpp"
#include "transports/port.hpp"

namespace imud {

class Session {
 public:
  using OpenPort = std::function<std::unique_ptr<Port>(std::string_view, const PortSettings&)>;
  // Opens every port. Throws PortError. `stop` ends every wait.
  Session(const Config& config, const std::atomic<bool>& stop, const OpenPort& open = open_port);

  TruthIntake& intake() noexcept { return intake_; }
  const TruthIntake& intake() const noexcept { return intake_; }
  Timeline& timeline() noexcept { return timeline_; }
  const Timeline& timeline() const noexcept { return timeline_; }

  // A run begins: the next samples have no increments.
  void begin_run() noexcept;
  bool in_run() const noexcept { return in_run_; }
  std::uint64_t samples_in_run() const noexcept { return samples_in_run_; }

  // Power goes off and on for all devices, between two samples. By any thread.
  void restart_devices() noexcept { restart_.store(true, std::memory_order_relaxed); }

  // When each imu samples, since the grids' start.
  Schedule& schedule() noexcept { return schedule_; }

  // Makes the frames of the schedule's next sample, which is that of the truth at `time`, and goes on to the one
  // after. `time` does not fall within a run.
  void prepare(TruthTime time, DeviceTime stamp) noexcept;
  // Hands the frames of the samples prepared, in their order, to their ports. `now` gives host time and `due` is the
  // samples' instant, if lateness matters; otherwise their devices hear their hosts, too, and no frame for a CAN bus
  // is held back afterwards.
  void fire() noexcept;
  template <class Now>
  void fire(HostTime due, Now&& now) noexcept {
    for (Unit* unit : prepared_) {
      const HostTime begin = now();
      hand_over(*unit);
      note_times(*unit, begin - due, now() - begin);
    }
    finish();
  }
  // Waits until the reader of a byte link has made room for the sample prepared, for which it has 2 s. Never dropping
  // anything is right where no instant is missed by waiting.
  void wait_for_readers() noexcept;

  // A truth was accepted: lets imus that sample seldom take in what was true up to `until`, which none of them has to
  // sample before any more.
  void follow(TruthTime until) noexcept;
  // False while the timeline has no place for another truth; the imus' next samples are at `until` or later.
  bool has_room_for_truth(TruthTime until) noexcept;
  // What was true up to then is in use already.
  TruthTime settled() const noexcept { return settled_; }

  // What can be waited for now, for poll(): truth, first, and what the hosts send.
  std::span<pollfd> inputs() noexcept;
  // Lets the devices hear their hosts where poll() has seen something in inputs(). False if there was something that
  // stays, such as an error or a flood: do not wait for it again at once.
  bool serve_inputs() noexcept;
  // Lets all devices hear their hosts, and lost ports look whether their device is back.
  void serve_hosts() noexcept;
  // Hands on what ports hold back.
  void flush() noexcept;
  // At the end: gives readers up to 50 ms for what they have not read yet, and paced lines up to 500 ms for what is
  // not out; the rest counts as dropped.
  void see_off() noexcept;
  // When flush() will have something to do next, if that is a matter of time: the pace of a line.
  std::optional<HostTime> due() const noexcept;

  std::size_t imu_count() const noexcept { return units_.size(); }
  const std::string& imu_name(std::size_t i) const { return units_[i]->name; }
  const ImuCounters& imu_counters(std::size_t i) const { return units_[i]->counters; }
  TruthQuality& quality() noexcept { return quality_; }
  const TruthQuality& quality() const noexcept { return quality_; }

 private:
  struct Unit {
    Unit(const ImuConfig& config, std::uint64_t seed, std::unique_ptr<Port> opened);
    std::string name;
    Imu imu;
    Nanoseconds period;
    std::unique_ptr<Device> device;
    std::unique_ptr<Port> port;
    std::optional<Sync> sync;  // nothing if nothing is connected
    bool waits_for_reader;
    bool reader_stalls = false;
    bool has_sampled = false;  // in this run
    std::uint64_t handed = 0;  // frames given to the port
    UartSettings line;         // of the device, as the port knows it
    FrameBuffer frames;        // of the sample prepared, and its
    std::uint32_t status = 0;
    DeviceTime now;  // of the last sample
    bool silent = false;
    ImuCounters counters;
  };

  void hand_over(Unit& unit) noexcept;
  void note_times(Unit& unit, Nanoseconds lateness, Nanoseconds write) noexcept;
  void finish() noexcept;
  void take_in(TruthTime until) noexcept;
  void restart_if_asked() noexcept;
  static void follow_line(Unit& unit) noexcept;
  static bool holds_back(const Unit& unit) noexcept;  // the port, of what it was handed
  void wait_for_reader(Unit& unit) const noexcept;
  void wait_for_bus(Unit& unit) const noexcept;  // until the port holds no frame back
  bool serve_host(Unit& unit) noexcept;  // false if it said nothing, or has more to say: do not wait for it at once
  static void publish(Unit& unit) noexcept;

  const std::atomic<bool>& stop_;
  const WhenStopped when_stopped_;
  Timeline timeline_;
  TruthIntake intake_;
  std::vector<std::unique_ptr<Unit>> units_;
  Schedule schedule_;
  std::vector<Unit*> prepared_;  // in order; room for all
  FrameBuffer replies_;
  std::vector<pollfd> inputs_;
  std::atomic<bool> restart_ = false;
  bool in_run_ = false;
  bool stopped_ = false;
  TruthTime settled_;
  std::uint64_t samples_in_run_ = 0;
  std::size_t truths_since_follow_ = 0;
  TruthQuality quality_;
};

}  // namespace imud
