#include "tools/truth/datagram_sender.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <time.h>

#include <algorithm>
#include <cerrno>

#include "tools/stop_signal.hpp"
#include "transports/host_clock.hpp"

namespace imud {
namespace {

// Sleeps until an absolute instant, so that delays do not add up. Returns early if stop_requested().
void sleep_until(HostTime time) noexcept {
  timespec instant{};
  instant.tv_sec = time.ns / 1'000'000'000;
  instant.tv_nsec = time.ns % 1'000'000'000;
  while (!stop_requested() && ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &instant, nullptr) == EINTR) continue;
}

// Returns the milliseconds until `time` for poll(), rounded up and not negative.
int milliseconds_until(HostTime time) noexcept {
  const std::int64_t left_ns = (time - host_now()).count();
  return left_ns <= 0 ? 0 : static_cast<int>((left_ns + 999'999) / 1'000'000);
}

// Returns an option of the socket; 0 if the descriptor is no socket.
int socket_option(int descriptor, int name) noexcept {
  int value = 0;
  socklen_t size = sizeof value;
  return ::getsockopt(descriptor, SOL_SOCKET, name, &value, &size) == 0 ? value : 0;
}

}  // namespace

DatagramSender::DatagramSender(Port& port, const Options& options)
    : port_(port),
      options_(options),
      faults_(options.faults),
      is_datagram_socket_(socket_option(port.descriptor(), SO_TYPE) == SOCK_DGRAM) {}

void DatagramSender::send(std::span<const std::byte> datagram, std::optional<HostTime> due) {
  const DatagramFaults::Fate fate = faults_.next(datagram.size());
  if (due) {
    last_due_ = std::max(last_due_, *due + fate.delay);
    sleep_until(last_due_);
    if (stop_requested()) return;
    lateness_.add(std::max(0.0, seconds(host_now() - last_due_)));
  }

  if (fate.drop) {
    ++counters_.dropped;
    return;
  }
  current_.assign(datagram.begin(), datagram.end());
  if (fate.corrupt) {
    ++counters_.corrupted;
    current_[fate.bit / 8] ^= std::byte{1} << (fate.bit % 8);
  }
  if (fate.reorder && !holds_) {
    ++counters_.reordered;
    held_.swap(current_);
    holds_ = true;
    return;
  }
  transmit(current_);
  if (fate.duplicate) {
    ++counters_.duplicated;
    transmit(current_);
  }
  finish();
}

void DatagramSender::finish() {
  if (holds_) transmit(held_);
  holds_ = false;
  count_unheard();
}

// The port sends on after ECONNREFUSED, the answer of a machine where nobody listens (udp(7)).
void DatagramSender::count_unheard() {
  if (is_datagram_socket_ && socket_option(port_.descriptor(), SO_ERROR) == ECONNREFUSED) ++counters_.unheard;
}

void DatagramSender::transmit(std::span<const std::byte> datagram) {
  // Datagrams that are sent without pacing may fill the interface's queue for a moment. The wait for a connection is
  // 1 s in all: with each datagram it would let the times of the others pass.
  constexpr int most = 9;
  const bool is_connected = port_.state() == PortState::ready;
  const Frame frame{datagram};
  count_unheard();
  for (int waits = is_connected ? most : std::min(most, waits_to_connect_);; --waits) {
    const std::uint64_t before = port_.counters().sent;
    port_.send({&frame, 1});
    if (port_.counters().sent != before) {
      ++counters_.sent;
      counters_.bytes += datagram.size();
      waits_to_connect_ = most_to_connect;
      return;
    }
    if (waits == 0 || port_.state() == PortState::lost) break;
    pollfd room{port_.descriptor(), POLLOUT, 0};
    ::poll(&room, 1, 10);
    if (!is_connected) --waits_to_connect_;
  }
  ++counters_.refused;
}

std::optional<NativeAcknowledgement> DatagramSender::send_and_wait(std::span<const std::byte> datagram,
                                                                   std::optional<HostTime> due, std::uint32_t stream,
                                                                   std::uint32_t sequence) {
  for (unsigned attempt = 0; attempt <= options_.resend_at_most && !stop_requested(); ++attempt) {
    if (attempt > 0) ++counters_.resent;
    send(datagram, attempt == 0 ? due : std::nullopt);
    const HostTime sent = host_now();
    if (const auto answer = wait_for_answer(stream, sequence, sent + options_.answer_timeout)) {
      round_trip_.add(seconds(host_now() - sent));
      return answer;
    }
  }
  return std::nullopt;
}

// Ignores answers to earlier datagrams, which may be late or belong to a duplicate.
std::optional<NativeAcknowledgement> DatagramSender::wait_for_answer(std::uint32_t stream, std::uint32_t sequence,
                                                                     HostTime until) {
  while (!stop_requested()) {
    while (const auto received = port_.receive()) {
      NativeAcknowledgement answer;
      if (decode_native_acknowledgement(received->frame.bytes, answer) && answer.stream == stream &&
          answer.sequence == sequence)
        return answer;
    }
    const int left_ms = milliseconds_until(until);
    if (left_ms == 0) break;
    pollfd descriptor{port_.descriptor(), POLLIN, 0};
    ::poll(&descriptor, 1, left_ms);
  }
  return std::nullopt;
}

}  // namespace imud
