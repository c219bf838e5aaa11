// Monitor: writes a run's events to the log, and the run's figures to the log and the file of `--quality`.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "emulator/ground/text_file.hpp"
#include "emulator/plan/config.hpp"
#include "emulator/report/clock_watch.hpp"
#include "emulator/report/pty_readers.hpp"
#include "emulator/report/speed_mismatch.hpp"
#include "emulator/report/summary.hpp"
#include "transports/host_clock.hpp"

namespace imud {

// Reads a run's counters ten times a second, from another thread than the one that samples.
class Monitor {
 public:
  struct Options {
    double log_every_s = 10;   // interval of the line of figures; 0: none
    std::string quality_file;  // a line of JSON a second; - is standard output; empty: none
    double first_truth_s = 1;  // the log states the sensors' output if no truth has come for so long from the start
    double wrong_speed_s = 2;  // a client's wrong speed is reported if it lasts for so long
  };
  // `counters` has the imus of `config` in the same order. The counters and `config` must outlive this. `quality`:
  // Options::quality_file, opened.
  Monitor(RunCounters counters, const Config& config, const Options& options, TextFile quality = {});

  // Logs the events since the last call, and writes the lines of figures that are due.
  void update();
  // Computes the loads of the lines again, and watches the present ptys. Called when the configuration has
  // changed.
  void update_loads();
  // Opens the file of figures again, after log rotation has renamed it.
  void reopen();
  // Logs the last events after the sampling thread has ended, and returns the figures of the whole run.
  // `capture_warning`: see TruthIntake::end_warning().
  Summary finish(std::string capture_warning);
  // Returns the figures from the beginning until now.
  Summary now() const;
  // Returns why the file of figures could not be written; empty if it was.
  const std::string& quality_error() const { return quality_error_; }

 private:
  // Returns by how much a counter has risen since the last call.
  class Rise {
   public:
    std::uint64_t of(const std::atomic<std::uint64_t>& counter) noexcept {
      const std::uint64_t now = counter.load(std::memory_order_relaxed);
      return now - std::exchange(seen_, now);
    }

   private:
    std::uint64_t seen_ = 0;
  };

  void report_first_truth();
  void report_news();
  void report_refusals();
  void report_remarks();
  void report_delay();
  void report_extrapolation(bool at_end);
  void report_connection();
  void report_interruptions();
  void report_imus();
  void report_skipped();
  void report_record();
  void report_faults();
  // The reports so far about the present port of an imu.
  struct ReportedPort {
    std::string port;  // its text in the configuration
    PortState state = PortState::ready;
    int wrong_speeds = 0;  // reports of a wrong speed
    SpeedMismatch mismatch;
  };
  // The figures of a port that another thread writes.
  struct PortFigures {
    const std::atomic<PortState>& state;
    const std::atomic<Port::Speeds>& speeds;
    const std::atomic<int>& error;
  };
  void report_port(ReportedPort& reported, const std::string& imu, const std::string& port,
                   const PortFigures& now) const;
  void write_quality(const Summary& all);

  const RunCounters counters_;
  const Config& config_;
  const Options options_;
  const HostTime begin_ = host_now();
  std::vector<double> line_loads_;
  TextFile quality_;
  std::string quality_error_;
  bool quality_fails_ = false;       // at the last line
  Summary last_quality_, last_log_;  // at the last line of each
  Rise runs_, stops_, returns_, pauses_, leaps_, disconnections_, delay_raises_;
  std::uint64_t described_ = 0;              // resumptions that the line about their pause reports
  PortState truth_port_ = PortState::ready;  // as reported
  bool no_truth_reported_ = false, has_truth_ = false, skipped_reported_ = false, refused_peer_reported_ = false;
  bool record_reported_ = false, delay_reported_ = false, extrapolation_reported_ = false;
  std::size_t faults_reported_ = 0;
  bool are_faults_lost_ = false;  // reported
  const std::vector<std::string> imu_names_;
  // The reports so far: causes of refusal; imus that refuse edges; figures of products; the ports.
  std::vector<bool> remarks_, refusals_, edges_refused_;
  std::vector<std::vector<bool>> device_reported_;  // by imu and DeviceCounter
  std::vector<ReportedPort> ports_, second_ports_;
  PtyReaders pty_readers_;
  ClockWatch clock_;
};

}  // namespace imud
