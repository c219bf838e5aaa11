// Session: truth in, samples out: the one path that every clock drives.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/duration_histogram.hpp"
#include "core/imu.hpp"
#include "core/timeline.hpp"
#include "emulator/config.hpp"
#include "emulator/truth_intake.hpp"
#include "transports/port.hpp"

namespace imud {

// What one imu has done. Written by the thread that samples, read by any (lateness: only when that has ended).
struct ImuCounters {
  std::atomic<std::uint64_t> samples = 0;
  std::atomic<std::uint64_t> frames = 0;   // that the port took whole
  std::atomic<std::uint64_t> dropped = 0;  // that it did not
  std::atomic<std::uint64_t> extrapolated = 0;  // samples after the newest truth, held ones included
  std::atomic<std::uint64_t> held = 0;          // of these, with motion frozen
  std::atomic<PortState> port_state = PortState::ready;
  DurationHistogram lateness;
};

// Host time of the samples' instants; how a clock paces the session.
class Pace {
 public:
  // Waits until the instant `due` has come. False: stop now. Returns how late it is.
  virtual bool wait(TruthTime due, Nanoseconds& lateness) noexcept = 0;

 protected:
  ~Pace() = default;
};

class Session {
 public:
  // Opens every port. Throws PortError. `stop` ends every wait.
  Session(const Config& config, const std::atomic<bool>& stop);
  // Gives readers up to 50 ms for what they have not read yet.
  ~Session();

  TruthIntake& intake() noexcept { return intake_; }
  const TruthIntake& intake() const noexcept { return intake_; }
  const Timeline& timeline() const noexcept { return timeline_; }

  // A run begins: the sample grids start at `start`, the timeline's first truth or, after a pause, its newest.
  void begin_run(TruthTime start) noexcept;
  // Emits every sample due up to `limit`, in the order of their instants, each when `pace` lets it. Without a pace each
  // leaves at once, or, as no instant is missed by that, when a slow reader of a byte link has made room for it, for
  // which it has 2 s. False if it is time to stop.
  bool advance(TruthTime limit, Pace* pace) noexcept;
  // A truth was accepted: lets imus that sample seldom take it in.
  void follow() noexcept;
  // False while the timeline has no place for another truth before samples are emitted.
  bool has_room_for_truth() noexcept;
  // The instant of the next sample; only in a run.
  TruthTime next_due() const noexcept;
  // Lets the devices hear what their hosts sent.
  void serve_hosts() noexcept;
  void flush() noexcept;

  std::uint64_t samples_in_run() const noexcept { return samples_in_run_; }
  bool in_run() const noexcept { return in_run_; }

  std::size_t imu_count() const noexcept { return units_.size(); }
  const std::string& imu_name(std::size_t i) const { return units_[i]->name; }
  const ImuCounters& imu_counters(std::size_t i) const { return units_[i]->counters; }

 private:
  struct Unit {
    Unit(const ImuConfig& config, std::uint64_t seed);
    TruthTime due(TruthTime start) const { return start + grid.offset(index); }
    std::string name;
    Imu imu;
    Grid grid;
    std::unique_ptr<Device> device;
    std::unique_ptr<Port> port;
    bool waits_for_reader;
    bool reader_stalls = false;
    std::uint64_t handed = 0;  // frames given to the port
    std::uint64_t index = 0;  // of the next sample in this run
    FrameBuffer frames;
    ImuCounters counters;
  };

  void emit(Unit& unit, TruthTime due) noexcept;
  void wait_for_reader(Unit& unit) const noexcept;
  void serve_host(Unit& unit) noexcept;
  static void hand_over(Unit& unit) noexcept;
  void take_in_truth() noexcept;
  static void publish(Unit& unit) noexcept;
  Unit& next_unit() noexcept;

  const std::atomic<bool>& stop_;
  Timeline timeline_;
  TruthIntake intake_;
  std::vector<std::unique_ptr<Unit>> units_;
  TruthTime start_;
  bool in_run_ = false;
  std::uint64_t samples_in_run_ = 0;
  std::size_t truths_since_follow_ = 0;
};

}  // namespace imud
