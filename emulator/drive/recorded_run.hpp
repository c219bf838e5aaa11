// RecordedRun: repeats a run from its record (`imud replay CONFIG RECORD`).
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "emulator/drive/pace.hpp"
#include "emulator/engine/engine.hpp"
#include "emulator/ground/host.hpp"
#include "transports/capture/pcapng_reader.hpp"
#include "transports/capture/record_packet.hpp"

namespace imud {

// Drives an Engine as the Loop did when the record was made: in the order and at the times of its events. Truth, the
// hosts' bytes, and the edges at the pins come from the record. Hosts at the imus' ports are ignored. Several imus
// of the Engine may have one name: each repeats the run's imu of that name. A received packet may precede its
// event, and other interfaces may precede the record's interfaces: mergecap and reordercap write such files. One
// thread.
class RecordedRun {
 public:
  // Opens the record. Throws PortError if the file is no record, does not begin with the run's begin, or lacks an imu
  // of the configuration.
  RecordedRun(const PortSpec& spec, const Config& config);

  // Returns `config` with the recorded run's values of all keys that a capture changes.
  Config adapted(Config config) const;
  // Returns the ports of an Engine: the truth port and the pins are fed by run(), `others` opens the others.
  Ports ports(Ports others);

  struct Options {
    // Samples leave when as much time has passed as in the recorded run; nullopt: at once.
    std::optional<PaceOptions> pace = std::nullopt;
    std::optional<Nanoseconds> duration = std::nullopt;  // of the recorded run; run() ends after it
    // Called for a sample of the imu with an even number when its truth has not come: every other imu of the engine
    // is a twin without errors, whose samples are taken when the truth of their instants has come, in their order.
    // nullptr: there are no twins.
    std::function<void(std::size_t imu)> awaits_truth = nullptr;
  };
  // Runs to the end of the record, or until `stop` is set.
  void run(Engine& engine, Host& host, const Options& options, const std::atomic<bool>& stop) noexcept;

  // Describes how the replay differs from the run; empty if it does not. Valid after run().
  std::string difference() const;
  std::string_view end_warning() const noexcept { return reader_.end_warning(); }

 private:
  class Input;
  HostTime time_of(const PcapngPacket& packet) const noexcept;
  bool is_plausible(const RecordEvent& event, HostTime time) noexcept;
  void find_second_run() noexcept;
  std::string change() const;
  void execute(const RecordEvent& event) noexcept;
  void propose(const RecordEvent& event) noexcept;
  void repeat_command(const RecordEvent& event) noexcept;
  void begin_fault(const RecordEvent& event, std::span<const std::byte> text);
  void add_to_reload(std::span<const std::byte> piece);
  void feed(const PcapngPacket& packet, const std::string& interface, HostTime time) noexcept;
  void receive(const RecordEvent& event, std::span<const std::byte> bytes, std::uint16_t link) noexcept;
  void process_truth(const RecordEvent& event) noexcept;
  void take_sample(std::uint16_t imu, const RecordEvent& event) noexcept;
  bool awaits_truth(std::uint16_t imu, const RecordEvent& event) noexcept;
  void take_awaited(bool all) noexcept;
  void take_awaited_of(std::uint16_t imu, bool all) noexcept;
  void transmit(const RecordEvent& event) noexcept;
  HostTime wait_until(HostTime instant) noexcept;
  void poll(std::int64_t polled_ns) noexcept;
  // Calls function(number) for each imu of the event's name.
  template <class Function>
  void for_imus(const RecordEvent& event, Function function) noexcept;

  PcapngReader reader_;
  std::optional<PcapngPacket> first_;  // the begin of the run, read ahead
  // A received packet that stands before its event.
  struct Early {
    PcapngPacket packet;
    std::vector<std::byte> bytes;
  };
  std::deque<Early> early_;       // before the begin of the run
  std::deque<Early> from_hosts_;  // of hosts, before the events of their reception
  std::uint16_t base_ = 0;        // number of the first interface of the record in the file
  const std::vector<ImuConfig> imus_;
  const bool has_frame_faults_;                // ControlConfig::frame_faults
  std::multimap<std::string, Input*> inputs_;  // by the name of the interface
  bool is_live_ = true;
  std::int64_t offset_ns_ = 0;  // from host times to packet times

  Engine* engine_ = nullptr;
  Host* host_ = nullptr;
  const std::atomic<bool>* stop_ = nullptr;
  Options options_;
  std::optional<Pace> pace_;
  std::optional<Nanoseconds> shift_;  // from host times of the run to host times of the replay
  std::optional<HostTime> begin_;     // of the run
  std::map<std::uint16_t, std::deque<RecordEvent>> awaited_;  // samples of twins whose truth has not come
  std::map<std::uint16_t, std::int64_t> last_samples_;        // numbers on the imus' grids
  std::optional<RecordEvent> receive_;                        // the next packet of its host is received
  std::optional<RecordEvent> begin_fault_;                    // the next packet of the events is its fault
  std::optional<RecordEvent> reload_;                         // the next packets of the events are its text
  std::string reload_text_;
  Config config_;  // the configuration of the run now
  bool ended_ = false, has_end_ = false;
  bool lacks_end_ = false;                 // the record has ended before its run
  std::int64_t files_ = 0;                 // files of the record that have begun
  std::optional<std::int64_t> next_file_;  // the number of another file than the next one, at which run() has ended
  std::uint64_t packets_ = 0, lost_ = 0, differing_ = 0, faults_missing_ = 0, reloads_missing_ = 0;
  bool is_damaged_ = false;  // at the last packet
  HostTime instant_;         // of the last samples
};

template <class Function>
void RecordedRun::for_imus(const RecordEvent& event, Function function) noexcept {
  const std::size_t interface = std::size_t{base_} + event.interface;
  if (interface >= reader_.interfaces().size()) return;
  const std::string& name = reader_.interfaces()[interface].name;
  for (const auto& channel : engine_->channels())
    if (channel->name == name) function(channel->number);
}

}  // namespace imud
