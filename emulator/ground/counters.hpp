// Counters: the figures that a run reports. Each is declared once, below, with the key and the words under which the
// closing summary, the log and the JSON show it. To add a counter, add its line.
//
// The sampling thread writes the figures, with relaxed atomics only; any thread reads them.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/numbers/duration_histogram.hpp"
#include "emulator/ground/truth_remarks.hpp"
#include "protocols/protocol.hpp"
#include "protocols/truth_format.hpp"
#include "transports/port.hpp"

namespace imud {

class FaultBook;

// When a text shows a counter. The JSON shows every counter, but a cause of refusal only if it occurred.
enum class Show : std::uint8_t { never, if_not_zero, if_several, always };
bool is_shown(Show show, std::uint64_t value) noexcept;

struct CounterInfo {
  std::string_view key;    // in JSON, and in limits: "imu1.KEY", "truth.KEY"
  std::string_view words;  // follow the number: "1999 frames sent"
  Show summary = Show::if_not_zero;
  Show log = Show::never;  // in the log's line, which has the counts since the line before
  bool may_fall = false;
};

struct CounterGroup;

// A count of events since the beginning of the run. In an interval it is the difference of its values at the two
// ends, or 0 if it fell.
class Counter : public std::atomic<std::uint64_t> {
 public:
  Counter(CounterGroup& group, const CounterInfo& info);
  using std::atomic<std::uint64_t>::operator=;
  void count(std::uint64_t events = 1) noexcept { fetch_add(events, std::memory_order_relaxed); }
  const CounterInfo info;
};

// An estimate or a state: in an interval it has its value at the interval's end.
class Level : public std::atomic<double> {
 public:
  // The JSON holds `scale` times the value.
  Level(CounterGroup& group, std::string_view key, double initial, double scale);
  using std::atomic<double>::operator=;
  const std::string_view key;
  const double scale;
};

// Durations, as percentiles. The JSON holds microseconds.
class Durations : public DurationHistogram {
 public:
  Durations(CounterGroup& group, std::string_view key);
  const std::string_view key;
};

// Lists the figures that are members of the derived group, in the order of their declaration.
struct CounterGroup {
  CounterGroup() = default;
  CounterGroup(const CounterGroup&) = delete;
  CounterGroup& operator=(const CounterGroup&) = delete;

  std::vector<const Counter*> counters;
  std::vector<const Level*> levels;
  std::vector<const Durations*> durations;
};

// The figures that the product of an imu declares.
class DeviceCounters {
 public:
  explicit DeviceCounters(std::span<const DeviceCounter> declared = {})
      : declared_(declared), counts_(declared.size()) {}
  std::span<const DeviceCounter> declared() const noexcept { return declared_; }
  // `counts` are in the order of the declarations; `others`, of another device of the imu, are added to them.
  void store(std::span<const std::uint64_t> counts, std::span<const std::uint64_t> others = {}) noexcept;
  std::uint64_t count(std::size_t i) const noexcept { return counts_[i].load(std::memory_order_relaxed); }

 private:
  std::span<const DeviceCounter> declared_;
  std::vector<std::atomic<std::uint64_t>> counts_;
};

// The counters of one imu.
struct ImuCounters : CounterGroup {
  explicit ImuCounters(std::span<const DeviceCounter> of_device = {}) : device(of_device) {}

  Counter samples{*this, {"samples", "samples", Show::always}};
  // Frames of samples and deadlines that the port accepted whole; frames, including replies, that it did not.
  Counter frames{*this, {"frames", "frames sent", Show::always}};
  Counter dropped{*this, {"dropped", "dropped", Show::always, Show::always}};
  // Dropped frames that were lost to an error of a file, such as a full disk.
  Counter failed{*this, {"failed", "lost to errors of the file", Show::if_not_zero, Show::if_not_zero}};
  // Frames that the ports of `also` did not accept.
  Counter copies_dropped{*this, {"copies_dropped", "dropped by the copies"}};
  // Samples that left a whole period late, or later.
  Counter missed{*this, {"missed", "missed", Show::always, Show::always}};
  // Samples later than `skip_after_ms`, whose frames were not sent.
  Counter skipped{*this, {"skipped", "skipped", Show::if_not_zero, Show::if_not_zero}};
  // Samples after the newest truth; of these, samples with motion held; of these, samples that were not sent.
  Counter extrapolated{*this, {"extrapolated", "extrapolated"}};
  Counter held{*this, {"held", "held"}};
  Counter silent{*this, {"silent", "not sent", Show::if_not_zero, Show::if_not_zero}};
  // Frames that were discarded while the output was paused by a command.
  Counter paused{*this, {"paused", "discarded while paused"}};
  // Samples of the vehicle at rest before the first truth.
  Counter at_rest{*this, {"at_rest", "at rest before the first truth"}};
  // Frames in answer to the host that the port accepted whole; `frames` does not include them.
  Counter replies{*this, {"replies", "replies sent"}};
  // A CAN controller's error frames, and times that it came to a state (PortState); frames that a serial CAN adapter
  // refused.
  Counter bus_errors{*this, {"bus_errors", "error frames", Show::if_not_zero, Show::if_not_zero}};
  Counter error_warnings{*this, {"error_warnings", "times error warning"}};
  Counter error_passives{*this, {"error_passives", "times error passive"}};
  Counter bus_offs{*this, {"bus_offs", "times bus-off", Show::if_not_zero, Show::if_not_zero}};
  Counter bus_restarts{*this, {"bus_restarts", "restarts of the bus"}};
  Counter refused{*this, {"refused", "refused by the adapter", Show::if_not_zero, Show::if_not_zero}};
  // Connections to the port that were refused, because it has another peer.
  Counter connections_refused{*this, {"connections_refused", "connections refused"}};
  // Edges on the trigger and PPS pins that Sync refused.
  Counter edges_refused{*this, {"edges_refused", "edges refused", Show::if_not_zero, Show::if_not_zero}};
  // Fixes of the receiver, magnetic headings, headings by two antennas, barometric heights and rests that the unit's
  // own filter used, and rejected. These counts begin again with a reload that changes the sensor.
  Counter fixes_used{*this, {"fixes_used", "fixes used"}};
  Counter fixes_rejected{*this, {"fixes_rejected", "fixes rejected", Show::if_not_zero, Show::if_not_zero}};
  Counter headings_used{*this, {"headings_used", "headings used"}};
  Counter headings_rejected{*this, {"headings_rejected", "headings rejected", Show::if_not_zero, Show::if_not_zero}};
  Counter antenna_headings_used{*this, {"antenna_headings_used", "headings by antennas used"}};
  Counter antenna_headings_rejected{
      *this, {"antenna_headings_rejected", "headings by antennas rejected", Show::if_not_zero, Show::if_not_zero}};
  Counter heights_used{*this, {"heights_used", "heights used"}};
  Counter heights_rejected{*this, {"heights_rejected", "heights rejected", Show::if_not_zero, Show::if_not_zero}};
  Counter rests_used{*this, {"rests_used", "rests used"}};
  Counter rests_rejected{*this, {"rests_rejected", "rests rejected", Show::if_not_zero, Show::if_not_zero}};
  // From a sample's instant to the beginning of its write, and the duration of that write.
  Durations lateness{*this, "lateness_us"};
  Durations write{*this, "write_us"};
  // From the arrival of a host's bytes or frame, as the port has stamped it, to the end of the write of the answer.
  Durations reply{*this, "reply_us"};
  DeviceCounters device;
  // The number of the first sample on the grid from the epoch; negative: it has none.
  std::atomic<std::int64_t> first_k = -1;
  std::atomic<bool> has_power = true, is_paused = false;
  std::atomic<PortState> port_state = PortState::ready, second_port_state = PortState::ready;
  std::atomic<int> port_error = 0, second_port_error = 0;  // Port::error()
  std::atomic<Port::Speeds> speeds = Port::Speeds{}, second_speeds = Port::Speeds{};
};

// The cause for which a truth was refused.
enum class Refusal : std::uint8_t {
  too_short,
  too_long,
  not_this_kind,
  bad_version,
  bad_checksum,
  bad_number,
  not_finite,
  out_of_range,
  no_columns,
  no_rate,
  outlier,
  duplicate,
  reordered,
  time_back,
  time_jump,
  other_stream,
  foreign_sender,
  count
};
// Returns the word for the cause in the summary and the JSON: "crc".
std::string_view cause(Refusal refusal) noexcept;
// Returns a phrase for the log that explains the cause and its remedy.
std::string_view remedy(Refusal refusal) noexcept;
// Returns the refusal for a decoder's result; not_this_kind for a result that is not a refusal.
Refusal refusal(TruthResult result) noexcept;

// One counter for each cause.
class RefusalCounters : public CounterGroup {
 public:
  RefusalCounters();
  // The first refusal of each cause: what was expected and what was found. Set before it is counted.
  std::array<Remark, static_cast<std::size_t>(Refusal::count)> first;
  Counter& operator[](std::size_t refusal) noexcept { return counts_[refusal]; }
  const Counter& operator[](std::size_t refusal) const noexcept { return counts_[refusal]; }

 private:
  std::deque<Counter> counts_;  // a Counter does not move
};

// The noise of the poses from which rate and specific force are derived, and the windows of the fit
// (PoseFit::Quality). Valid if `known`.
struct FitFigures : CounterGroup {
  // The root mean square of a component: rad; m, or m/s where the force is derived from velocities.
  Level attitude_noise{*this, "attitude_noise_rad", 0, 1};
  Level place_noise{*this, "place_noise_m", 0, 1};
  // The root mean square of a component of the noise in the derived rate and force, rad/s and m/s^2.
  Level rate_noise{*this, "rate_noise_rad_per_s", 0, 1};
  Level force_noise{*this, "force_noise_m_per_s2", 0, 1};
  // Delays, s: the shortest, the mean, the longest; 0: nothing is derived.
  Level rate_shortest{*this, "rate_delay_shortest_ms", 0, 1e3};
  Level rate_mean{*this, "rate_delay_mean_ms", 0, 1e3};
  Level rate_longest{*this, "rate_delay_longest_ms", 0, 1e3};
  Level force_shortest{*this, "force_delay_shortest_ms", 0, 1e3};
  Level force_mean{*this, "force_delay_mean_ms", 0, 1e3};
  Level force_longest{*this, "force_delay_longest_ms", 0, 1e3};
  std::atomic<bool> known = false;
};

// The counters of the admission of truth.
struct TruthCounters : CounterGroup {
  Counter received{*this, {"received", "received", Show::always}};  // records
  Counter accepted{*this, {"accepted", "accepted", Show::always}};
  // Records without a state, such as header rows and blank lines.
  Counter no_state{*this, {"no_state", "without state", Show::always}};
  // Truths accepted although a later one had arrived before.
  Counter inserted{*this, {"inserted", "reordered but in time"}};
  // Truths missing by the sender's sequence numbers. Falls when a reordered truth arrives.
  Counter lost{*this, {"lost", "lost", Show::if_not_zero, Show::never, true}};
  // Refused duplicates that repeat a truth by its sequence number, too.
  Counter repeated{*this, {"repeated", "repeated"}};
  // Times that a truth was later than the one before by more than StepWatch::far_above usual steps.
  Counter gaps{*this, {"gaps", "gaps", Show::if_not_zero, Show::if_not_zero}};
  // Runs of the timeline, the first included.
  Counter runs{*this, {"runs", "runs", Show::if_several}};
  // Records of a capture or a stream that are incomplete or too long.
  Counter truncated{*this, {"truncated", "cut short", Show::if_not_zero, Show::if_not_zero}};
  // Times that another sender's truth followed one that this sender had sent before (SenderWatch).
  Counter sender_changes{*this, {"sender_changes", "changes of sender", Show::if_not_zero, Show::if_not_zero}};
  // Times that the connection to the simulator was lost; connections refused, because one simulator is connected.
  Counter disconnections{*this, {"disconnections", "disconnections", Show::if_not_zero, Show::if_not_zero}};
  Counter connections_refused{*this, {"connections_refused", "connections refused"}};
  RefusalCounters refused;
  FitFigures fit;
  TruthRemarks remarks;
  std::atomic<PortState> port_state = PortState::ready;
  // Arrival of the first and of the newest truth accepted, by the port's clock.
  std::atomic<std::int64_t> first_ns = 0;
  std::atomic<std::int64_t> newest_ns = 0;
  std::atomic<std::int64_t> longest_gap_ns = 0;
  // How much of a capture has been read, from 0 to 1; negative: not known.
  std::atomic<double> progress = -1;
  // The simulation time from the first to the newest truth of each run, summed over the runs.
  std::atomic<std::int64_t> simulated_ns = 0;
};

// The relation of truth to the host's clock. Levels and durations are valid if `known`: in realtime, from a live
// port.
struct TruthQuality : CounterGroup {
  // Times that truth was missing for so long that motion was held, and times that it resumed afterwards.
  Counter stops{*this, {"stops", "interruptions"}};
  Counter returns{*this, {"returns", "resumptions"}};
  // Times that the map from host time to truth was re-anchored: after a pause, or because the simulator's time has
  // leapt or runs faster than is possible for a network. Leaps alone. Pauses that the simulator has caught up.
  Counter resumed{*this, {"resumed", "pauses or leaps"}};
  Counter leaps{*this, {"leaps", "leaps ahead"}};
  Counter caught_up{*this, {"caught_up", "pauses caught up"}};
  // Times that the automatic delay was raised, because truths were later than it allows for.
  Counter delay_raises{*this, {"delay_raises", "raises of the automatic delay"}};
  // Truths whose stamps map the epoch's clock to the simulator's time, and truths whose stamps were refused.
  Counter stamped{*this, {"stamped", "mapped by their stamps"}};
  Counter stamps_refused{*this, {"stamps_refused", "stamps refused", Show::if_not_zero, Show::if_not_zero}};
  // Simulation seconds in a host second, estimated.
  Level rate{*this, "clock_rate", 1, 1};
  // Seconds by which the simulation has fallen behind the host's clock in this run.
  Level offset_s{*this, "offset_us", 0, 1e6};
  // Seconds by which the sensors sample behind the truth.
  Level delay_s{*this, "delay_us", 0, 1e6};
  // Lateness of truths against the truths of lowest latency.
  Durations jitter{*this, "jitter_us"};
  // Age of the newest truth at the samples' instants.
  Durations age{*this, "age_us"};
  std::atomic<bool> known = false;
  // How the automatic delay was settled; delay_s is negative until it is.
  struct Settled {
    std::atomic<double> delay_s = -1;
    std::atomic<double> interval_s = 0, jitter_s = 0, duration_s = 0;
  };
  Settled settled;
  Remark stamps;  // why stamps are not used
  // The greatest differences between the motion that was extrapolated for samples and the one that was interpolated
  // for the same instants when later truth had arrived. `samples`: how many were compared.
  struct ExtrapolationError {
    std::atomic<std::uint64_t> samples = 0;
    std::atomic<double> ahead_s = 0;  // of the newest truth then
    std::atomic<double> rate_rad_per_s = 0, specific_force_m_per_s2 = 0;
  };
  ExtrapolationError extrapolation_error;
  // The number of pauses that have ended, and of the last one, ns: how long no truth came, how long the sampled time
  // stood still, and by how much it has fallen behind (0: caught up). The length of the last leap, ns.
  std::atomic<std::uint64_t> pauses = 0;
  std::atomic<std::int64_t> last_missing_ns = 0, last_held_ns = 0, last_behind_ns = 0, last_leap_ns = 0;
};

// The clock of the epoch on which the grids of samples are (`[realtime] epoch`).
struct ClockCounters : CounterGroup {
  // Times that the clock was set, and the last change of its time, s.
  Counter steps{*this, {"steps", "steps", Show::always}};
  Level last_step{*this, "last_step_us", 0, 1e6};
};

// The counters of a record (`--record`).
struct RecordCounters : CounterGroup {
  Counter packets{*this, {"packets", "packets", Show::always}};
  Counter bytes{*this, {"bytes", "bytes", Show::always}};
  Counter files{*this, {"files", "files", Show::always}};
  // Packets for which the queue had no room, or that the file did not accept.
  Counter lost{*this, {"lost", "lost", Show::always, Show::if_not_zero}};
  std::atomic<int> error = 0;  // errno of the last write that failed; 0: none has
};

// The counters of the control protocol, of all its clients together.
struct ControlCounters : CounterGroup {
  // Refused clients: too many, another user's, or without the token; clients that were closed because they did not
  // read their answers.
  Counter connections_refused{*this, {"connections_refused", "connections refused"}};
  Counter clients_closed{*this, {"clients_closed", "clients closed that read no answers"}};
  // Notifications of samples, truth and counters, and of events, that clients were too slow for.
  Counter notifications_lost{*this, {"notifications_lost", "notifications lost"}};
  Counter events_lost{*this, {"events_lost", "events lost"}};
  // Samples to be watched, and events, for which the queue from the sampling thread had no room.
  Counter samples_overrun{*this, {"samples_overrun", "samples not shown"}};
  Counter events_overrun{*this, {"events_overrun", "events not reported"}};
};

// The counters of a whole run, which outlive this.
struct RunCounters {
  const TruthCounters* truth;
  const TruthQuality* quality;
  std::vector<std::pair<std::string, const ImuCounters*>> imus;  // by name
  const RecordCounters* record = nullptr;                        // nullptr: nothing is recorded
  const FaultBook* faults = nullptr;                             // nullptr: there are none
  const ControlCounters* control = nullptr;                      // nullptr: nobody can control it
  const ClockCounters* clock = nullptr;                          // nullptr: the grids have no epoch
};

// The numbers of a group at an instant, or their change in an interval, in the order of their declaration.
struct SnapshotValues {
  std::vector<std::uint64_t> counts;
  std::vector<double> levels;
  std::vector<DurationHistogram> durations;

  explicit SnapshotValues(const CounterGroup& group);
  // Turns the numbers into numbers of the interval since `before`.
  void subtract(const SnapshotValues& before);
  std::uint64_t total() const noexcept;  // of all counts
};

// SnapshotValues with the declarations beside them: `snapshot[&ImuCounters::samples]`.
template <class Group>
class Snapshot : public SnapshotValues {
 public:
  Snapshot() : Snapshot(declared()) {}
  explicit Snapshot(const Group& group) : SnapshotValues(group) {}

  // Returns a group that serves for its declarations only; its figures keep their initial values.
  static const Group& declared() {
    static const Group group;
    return group;
  }
  std::uint64_t operator[](Counter Group::*member) const { return counts[place(declared().counters, member)]; }
  double operator[](Level Group::*member) const { return levels[place(declared().levels, member)]; }
  const DurationHistogram& operator[](Durations Group::*member) const {
    return durations[place(declared().durations, member)];
  }

 private:
  template <class Figure>
  static std::size_t place(const std::vector<const Figure*>& all, Figure Group::*member) {
    std::size_t i = 0;
    while (all[i] != &(declared().*member)) ++i;
    return i;
  }
};

}  // namespace imud
