// Loop: the order of steps, the same for every clock: truth in, samples out, hosts and deadlines between them.
#pragma once

#include <atomic>
#include <optional>

#include "emulator/drive/epoch_grid.hpp"
#include "emulator/drive/hosts.hpp"
#include "emulator/drive/pace.hpp"
#include "emulator/drive/pacer.hpp"
#include "emulator/engine/engine.hpp"
#include "emulator/engine/schedule.hpp"
#include "emulator/ground/host.hpp"

namespace imud {

struct LoopOptions {
  PaceOptions pace;                  // where no clock of the host paces, `spin` is at the begin of each wait
  std::optional<Nanoseconds> limit;  // of simulation time: the run of a capture ends there
  Epoch epoch = Epoch::none;         // of the grids of samples; none unless the truth is live
};

// Drives an Engine by live truth or a capture, at the instants of a Pacer. One round does the first of these that is
// pending: take truth from the port; prepare the next instant's samples; wait for the instant, truth,
// hosts, deadlines and paced lines; encode and transmit the samples. Allocates nothing after construction. One
// thread.
class Loop {
 public:
  // `clock`: the counters of the epoch's clock.
  Loop(Engine& engine, Host& host, Pacer& pacer, const LoopOptions& options, ClockCounters& clock,
       const std::atomic<bool>& stop);

  // Returns within 20 ms after `stop` is set, and when the capture ends or reaches its limit.
  void run() noexcept;

 private:
  void round() noexcept;

  // Truth.
  bool wants_truth() const noexcept;
  // A capture may have no descriptor to wait for.
  bool has_no_input() const noexcept { return !intake_.is_live() && intake_.descriptor() < 0; }
  void take_truth() noexcept;
  void apply_truth() noexcept;
  bool make_room_for_truth() noexcept;
  void begin_run() noexcept;
  void pass_over() noexcept;
  TruthTime earliest_sample() noexcept;
  TruthTime latest_sample() const noexcept;
  // The next samples need a truth that a simulator sends, which is waited for.
  bool awaits_truth() const noexcept {
    return waits_for_truth_ && intake_.is_live() && pacer_.truth(next_due()) > latest_sample();
  }

  // Samples.
  HostTime next_due() const noexcept { return origin_ + schedule_.next().offset; }
  bool is_at_rest(HostTime instant) const noexcept { return !engine_.in_run() || instant < first_truth_; }
  bool is_prepared() const noexcept { return !engine_.prepared().empty(); }
  bool is_due() const noexcept { return is_prepared() && host_.now() >= due_ - pace_.spin(); }
  EpochGrid::Placement start_grid(std::size_t imu, HostTime start) noexcept;
  void set_ahead_of_next() noexcept;
  void prepare() noexcept;
  void transmit(HostTime now) noexcept;
  void skip(HostTime now) noexcept;

  // Commands.
  void cycle_power_if_requested(HostTime now) noexcept {
    if (engine_.power_cycle.take()) cycle_power(now);
  }
  void cycle_power(HostTime now) noexcept;
  bool has_commands() const noexcept {
    return engine_.control() != nullptr && engine_.control()->commands.has_batch();
  }
  void execute_commands() noexcept;
  void execute(const Command& command, HostTime now) noexcept;
  void change_pacing(const Command& command) noexcept;

  void send_all() noexcept;
  void complete(HostTime now) noexcept;
  void follow_epoch(const Channel& channel) noexcept;
  void wait(HostTime until) noexcept;
  void look(HostTime until) noexcept;
  void serve_all() noexcept;

  Engine& engine_;
  Host& host_;
  Pacer& pacer_;
  Pace pace_;
  Hosts hosts_;
  const std::atomic<bool>& stop_;
  StepSink& sink_;
  TruthIntake& intake_;
  const Timeline& timeline_;
  const bool paced_;            // by the host's clock
  const bool waits_for_truth_;  // samples wait for their truth; false: the sensors have power before the first truth
  const Nanoseconds spin_;      // the thread does not sleep for the first spin_ of a wait
  Schedule schedule_;
  EpochGrid epoch_;
  std::optional<Nanoseconds> limit_;  // how long truth is sampled, from the run's start on; nullopt: forever
  TruthTime run_start_;
  HostTime origin_;       // of the schedule
  HostTime first_truth_;  // the instant at which the first truth is sampled; earlier samples are at rest
  HostTime due_;          // the instant whose samples are prepared, or are prepared next
  bool prepared_at_rest_ = false;

  bool ended_ = false;
  bool settling_ = false;    // truth arrives, and the run begins when the pacer is settled
  HostTime newest_arrival_;  // of the newest truth
  HostTime served_;          // when all hosts were served last
  HostTime looked_;          // when truth and hosts were looked at last
  int budget_;               // how many truths may be taken before the next sample
  bool truth_waits_ = true;  // truth may be waiting at its port
  bool more_truth_ = false;  // more truth is waiting than was taken
  bool has_room_ = true;     // the timeline has room for more truth
  bool unserved_ = false;    // a look has to serve the hosts before the next samples
  bool unreviewed_ = false;  // truths were observed since the last review
  bool unapplied_ = false;   // a truth was accepted since apply_truth()
  std::size_t truths_since_advance_ = 0;
};

}  // namespace imud
