// DatagramSender: sends datagrams through a network that may be bad, and in lockstep waits for the answer to each.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/duration_histogram.hpp"
#include "protocols/native_truth.hpp"
#include "tools/datagram_faults.hpp"
#include "transports/port.hpp"

namespace imud {

class DatagramSender {
 public:
  struct Options {
    DatagramFaults::Rates faults;
    unsigned resend_at_most = 10;  // lockstep
    Nanoseconds answer_time_out = std::chrono::milliseconds(200);
  };
  struct Counters {
    std::uint64_t sent = 0;  // datagrams that the kernel took, whatever became of them before
    std::uint64_t bytes = 0;
    std::uint64_t refused = 0;  // that it did not take
    std::uint64_t dropped = 0;  // on purpose, and so the next three
    std::uint64_t duplicated = 0;
    std::uint64_t reordered = 0;
    std::uint64_t corrupted = 0;
    std::uint64_t resent = 0;
  };

  // `port` is connected, and outlives this.
  DatagramSender(Port& port, const Options& options);

  // Sends `datagram` at `due`, if that is given and not past, later by the fault's jitter.
  void send(std::span<const std::byte> datagram, std::optional<HostTime> due);
  // As send(), then waits for the acknowledgement of `sequence`; sends again when none comes in time. nullopt if none
  // came at all, or stop_wished().
  std::optional<NativeAcknowledgement> send_and_wait(std::span<const std::byte> datagram, std::optional<HostTime> due,
                                                     std::uint32_t stream, std::uint32_t sequence);
  // Sends what is still held back for being reordered.
  void finish();

  const Counters& counters() const noexcept { return counters_; }
  const DurationHistogram& lateness() const noexcept { return lateness_; }      // behind what was due
  const DurationHistogram& round_trip() const noexcept { return round_trip_; }  // of the attempt that was answered

 private:
  void transmit(std::span<const std::byte> datagram);
  std::optional<NativeAcknowledgement> wait_for_answer(std::uint32_t stream, std::uint32_t sequence, HostTime until);

  Port& port_;
  const Options options_;
  DatagramFaults faults_;
  Counters counters_;
  DurationHistogram lateness_;
  DurationHistogram round_trip_;
  std::vector<std::byte> current_;
  std::vector<std::byte> held_;  // reordered, to leave after the next one
  bool holds_ = false;
  HostTime last_due_;
};

}  // namespace imud
