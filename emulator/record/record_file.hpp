// RecordFile: the pcapng file of a record, or a ring of such files.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "emulator/ground/counters.hpp"
#include "emulator/ground/packet_ring.hpp"
#include "transports/capture/record_packet.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {

struct RecordOptions {
  std::string file;             // empty: nothing is recorded; "-": standard output, without max_bytes
  std::uint64_t max_bytes = 0;  // of a file, after which the next one begins; 0: there is one file
  std::uint64_t max_files = 0;  // the number of files that are kept; 0: all
};

// Writes packets in batches of whole blocks. If a write fails, the file ends with its last whole block, the packets
// of the batch are counted as lost, and the next batch is tried as usual; an event `lost` then marks the place. One
// thread, except for the counters.
class RecordFile {
 public:
  // Opens and locks FILE.pcapng, or FILE-00001.pcapng if max_bytes is set. begin() empties it. Throws OpenError.
  RecordFile(const RecordOptions& options, RecordCounters& counters);

  // The head of each file.
  struct Head {
    std::vector<PcapngInterface> interfaces;  // the first has the events, the second the configuration
    std::string config;                       // TOML
    std::int64_t offset_ns = 0;               // from host time to the packets' times
    std::uint8_t flags = 0;                   // of the event `begin`
    Endpoint truth;                           // the truth port's own address, for the headers of its datagrams
  };
  // Replaces an older record with all its pieces: writes the head of the first file, at host time `now`.
  void begin(Head head, HostTime now);
  // Adds a packet to the batch, which is written when it is large.
  void add(const PacketRing::Head& head, std::span<const std::byte> bytes);
  // Writes the batch.
  void flush();

  const std::string& path() const noexcept { return path_; }

 private:
  std::string numbered(std::uint64_t number) const;
  bool open_next();
  void append_head();
  void append_event(const RecordEvent& event);
  bool write_batch() noexcept;

  const RecordOptions options_;
  RecordCounters& counters_;
  std::string path_;
  FileDescriptor file_;
  std::uint64_t number_ = 0;   // of the file
  std::uint64_t size_ = 0;     // bytes of the file, which are whole blocks
  std::uint64_t missing_ = 0;  // packets that are lost since the last one that was written
  bool has_head_ = false;      // the file's head has been written

  Head head_;
  std::int64_t time_ns_ = 0;  // of the last packet
  std::vector<std::byte> batch_, packet_;
  std::uint64_t packets_ = 0;  // in the batch, without its head
};

}  // namespace imud
