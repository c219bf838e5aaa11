// DatagramSender: sends datagrams, optionally with the faults of a bad network; in lockstep, waits for the answer to
// each.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/numbers/duration_histogram.hpp"
#include "protocols/native_truth.hpp"
#include "tools/truth/datagram_faults.hpp"
#include "transports/port.hpp"

namespace imud {

class DatagramSender {
 public:
  struct Options {
    DatagramFaults::Rates faults;
    unsigned resend_at_most = 50;  // lockstep: repetitions of one datagram
    Nanoseconds answer_timeout = std::chrono::milliseconds(200);
  };
  struct Counters {
    std::uint64_t sent = 0;  // datagrams that the kernel accepted, faulty ones included
    std::uint64_t bytes = 0;
    std::uint64_t refused = 0;  // datagrams that the kernel did not accept, for example without a connection
    std::uint64_t unheard = 0;  // answers by UDP that nobody listens at that port
    std::uint64_t dropped = 0;  // faults made on purpose, as are the next three
    std::uint64_t duplicated = 0;
    std::uint64_t reordered = 0;
    std::uint64_t corrupted = 0;
    std::uint64_t resent = 0;
  };

  // `port` must be connected, and must outlive this.
  DatagramSender(Port& port, const Options& options);

  // Waits until `due` if it is given, and for the fault's jitter, then sends `datagram`.
  void send(std::span<const std::byte> datagram, std::optional<HostTime> due);
  // Sends like send(), and waits for the acknowledgement of `sequence`; sends the datagram again if no
  // acknowledgement comes in time. Returns nullopt if no attempt was answered, or stop_requested().
  std::optional<NativeAcknowledgement> send_and_wait(std::span<const std::byte> datagram, std::optional<HostTime> due,
                                                     std::uint32_t stream, std::uint32_t sequence);
  // Sends the datagram that is held back for reordering, if there is one.
  void finish();

  const Counters& counters() const noexcept { return counters_; }
  const DurationHistogram& lateness() const noexcept { return lateness_; }      // from `due` to sending
  const DurationHistogram& round_trip() const noexcept { return round_trip_; }  // of the attempt that was answered

 private:
  void transmit(std::span<const std::byte> datagram);
  void count_unheard();
  std::optional<NativeAcknowledgement> wait_for_answer(std::uint32_t stream, std::uint32_t sequence, HostTime until);

  Port& port_;
  const Options options_;
  DatagramFaults faults_;
  const bool is_datagram_socket_;
  static constexpr int most_to_connect = 100;  // of 10 ms
  int waits_to_connect_ = most_to_connect;     // that are left
  Counters counters_;
  DurationHistogram lateness_;
  DurationHistogram round_trip_;
  std::vector<std::byte> current_;
  std::vector<std::byte> held_;  // a reordered datagram, which is sent after the next one
  bool holds_ = false;
  HostTime last_due_;
};

}  // namespace imud
