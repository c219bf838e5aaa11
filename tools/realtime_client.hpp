// RealtimeClient: sends imud the truths of a simulation at the pace of the host's clock, without waiting for imud.
//
// Copy this file and lockstep_client.hpp, which encodes the datagrams, into a simulator. They need C++17, the
// standard library and POSIX. Their licence is imud's (MIT).
//
//   imud_lockstep::RealtimeClient imud("127.0.0.1", 9810);  // for: imud run imu.toml
//   for (std::int64_t step = 0; running; ++step) {
//     imud_lockstep::Truth truth;
//     truth.simulation_time_ns = step * 10'000'000;
//     truth.sigma_BN = vehicle.sigma_BN();
//     truth.omega_BN_B = vehicle.omega_BN_B();
//     truth.specific_force_B = vehicle.specific_force_B();
//     imud.send(truth);  // waits until 10 ms have passed since the last one was due
//     vehicle.integrate(0.01);
//   }
#pragma once

#include <time.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>

#include "lockstep_client.hpp"

namespace imud_lockstep {

// One run of one vehicle: the first truth is marked as the beginning of a run, and is sent at once. Each further
// truth is due when as much time of CLOCK_MONOTONIC has passed since the first truth was sent as there is
// simulation time between the two truths; therefore delays do not add up. With Options::clock, that clock is used,
// and each truth is stamped with the time at which it is due: imuds on several hosts then sample the same truth at
// the same instant (realtime.epoch, truth.delay_ms). Use it from one thread at a time.
class RealtimeClient {
 public:
  struct Options {
    std::uint32_t stream = 0;          // number of the vehicle; imud accepts the truth of one vehicle only
    std::uint32_t first_sequence = 0;  // of the first truth
    std::optional<Clock> clock;        // of the stamps; none: without stamps
  };
  struct Counters {
    std::uint64_t sent = 0;        // truths that the network accepted
    std::uint64_t refused = 0;     // truths that it did not accept: imud is not running, or the network is down
    std::int64_t lateness_ns = 0;  // of the last truth: from the instant at which it was due to sending
    std::int64_t max_lateness_ns = 0;
  };

  // Throws as Connection does. imud may start later.
  RealtimeClient(const std::string& address, std::uint16_t port) : RealtimeClient(address, port, Options()) {}
  RealtimeClient(const std::string& address, std::uint16_t port, const Options& options)
      : stream_(options.stream),
        clock_(options.clock),
        sequence_(options.first_sequence),
        connection_(address, port) {}

  // Waits until `truth` is due, then sends it; sends it at once if it is late. Returns false if the network did
  // not accept the truth; it may accept the next one. Throws std::invalid_argument as encode() does, or if the
  // simulation time is not later than the previous truth's.
  bool send(const Truth& truth) {
    if (last_ && truth.simulation_time_ns <= last_->simulation_ns)
      throw std::invalid_argument("simulation_time_ns is " + std::to_string(truth.simulation_time_ns) + " after " +
                                  std::to_string(last_->simulation_ns) +
                                  "; right would be a time that increases; for a new run make a new client");
    const std::int64_t due_ns = last_ ? last_->due_ns + (truth.simulation_time_ns - last_->simulation_ns) : now_ns();
    Truth stamped = truth;
    if (clock_) stamped.stamp = Stamp{*clock_, due_ns};
    const Datagram datagram = encode(stamped, stream_, sequence_, counters_.sent == 0, false);
    sleep_until(due_ns);
    const bool is_sent = connection_.send(datagram) == 0;
    ++(is_sent ? counters_.sent : counters_.refused);
    counters_.lateness_ns = std::max<std::int64_t>(0, now_ns() - due_ns);
    counters_.max_lateness_ns = std::max(counters_.max_lateness_ns, counters_.lateness_ns);
    last_ = Instant{truth.simulation_time_ns, due_ns};
    ++sequence_;
    return is_sent;
  }

  const Counters& counters() const noexcept { return counters_; }

 private:
  struct Instant {
    std::int64_t simulation_ns;
    std::int64_t due_ns;
  };

  clockid_t clock() const noexcept {
    if (clock_ == Clock::tai) return CLOCK_TAI;
    return clock_ == Clock::utc ? CLOCK_REALTIME : CLOCK_MONOTONIC;
  }
  std::int64_t now_ns() const noexcept {
    timespec now{};
    ::clock_gettime(clock(), &now);
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
  }
  void sleep_until(std::int64_t instant_ns) const noexcept {
    timespec instant{};
    instant.tv_sec = static_cast<time_t>(instant_ns / 1'000'000'000);
    instant.tv_nsec = static_cast<long>(instant_ns % 1'000'000'000);
    while (::clock_nanosleep(clock(), TIMER_ABSTIME, &instant, nullptr) == EINTR) continue;
  }

  const std::uint32_t stream_;
  const std::optional<Clock> clock_;
  std::uint32_t sequence_;  // of the next truth
  const Connection connection_;
  std::optional<Instant> last_;
  Counters counters_;
};

}  // namespace imud_lockstep
