// Recorder: records what the sampling thread receives, does and sends, for `--record`.
#pragma once

#include <atomic>
#include <cstdint>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "core/time.hpp"
#include "emulator/ground/packet_ring.hpp"
#include "emulator/ground/step_sink.hpp"
#include "emulator/record/record_file.hpp"
#include "transports/port.hpp"

namespace imud {

// The sampling thread calls a Recorder in the order of events; the Recorder's own thread writes the file. After
// start() the sampling thread neither allocates, locks nor waits here, unless `waits`: a packet for which the queue
// has no room is counted as lost, and the place is marked.
class Recorder final : public StepSink {
 public:
  // The size of the queue, bytes: ten seconds of four imus at 1 kHz.
  static constexpr std::size_t queue_size = 16 * 1024 * 1024;

  // `waits`: the sampling thread waits for room in the queue, because the host's clock does not pace it. Throws
  // OpenError if the file cannot be created.
  Recorder(const RecordOptions& options, bool waits, std::size_t size = queue_size);
  // Ends the record as finish() does.
  ~Recorder() override;

  // --- Before start() ---
  std::uint16_t add_interface(std::string name, std::uint16_t link_type) override;
  void set_truth_address(const Endpoint& address) override { truth_ = address; }
  // Writes the head and starts the thread. `is_live`: the truth is no capture. `config`: the run's, as TOML.
  void start(bool is_live, std::string config);

  // --- Any other thread ---
  // Called when the sampling thread has ended: writes the packets in the queue.
  void finish();
  const RecordCounters& counters() const noexcept { return counters_; }
  // The file, or the first one.
  const std::string& path() const noexcept { return path_; }

 private:
  void keep_event(const RecordEvent& event) noexcept override;
  void keep_packet(std::uint16_t interface, PacketDirection direction, HostTime time, const Frame& frame,
                   const Endpoint& peer) noexcept override;
  void push(const PacketRing::Head& head, std::span<const std::byte> bytes) noexcept;
  void write() noexcept;

  const bool waits_;
  RecordCounters counters_;
  RecordFile file_;
  const std::string path_;
  PacketRing ring_;
  std::vector<PcapngInterface> interfaces_;
  Endpoint truth_;
  std::uint64_t missing_ = 0;  // packets for which there was no room since the last that had
  std::atomic<bool> stop_ = false;
  std::thread writer_;
};

}  // namespace imud
