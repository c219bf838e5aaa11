// LockstepClient: sends imud the truth of a step and waits until imud has emitted every sample up to it.
//
// Copy this file into a simulator. It needs C++17, the standard library and POSIX sockets. Its licence is imud's
// (MIT).
//
//   imud_lockstep::LockstepClient imud("127.0.0.1", 9810);  // for: imud run imu.toml --set clock=lockstep
//   for (std::int64_t step = 0; step <= 200; ++step) {
//     imud_lockstep::Truth truth;
//     truth.simulation_time_ns = step * 10'000'000;
//     truth.sigma_BN = vehicle.sigma_BN();
//     truth.omega_BN_B = vehicle.omega_BN_B();
//     truth.specific_force_B = vehicle.specific_force_B();
//     const imud_lockstep::Answer answer = imud.step(truth);
//     if (!answer.accepted) throw std::runtime_error("imud refused the truth; its log has the cause");
//     vehicle.integrate(0.01);
//   }
//
// Frames: N inertial, B the vehicle's body. x_BN_N: of B relative to N, in N components. The datagram's layout,
// version 1 or with a stamp 2, is in imud's protocols/native_truth.hpp.
#pragma once

#include <fcntl.h>
#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>

namespace imud_lockstep {

using Vector3 = std::array<double, 3>;

// A clock that hosts share: CLOCK_TAI, CLOCK_REALTIME, and CLOCK_MONOTONIC for the processes of one host.
enum class Clock : std::uint32_t { tai = 1, utc = 2, monotonic = 3 };
struct Stamp {
  Clock clock = Clock::tai;
  std::int64_t time_ns = 0;
};

// Motion of the vehicle at an instant.
struct Truth {
  std::int64_t simulation_time_ns = 0;
  Vector3 r_BN_N{};                         // m; position of B's origin
  Vector3 v_BN_N{};                         // m/s
  Vector3 sigma_BN{};                       // attitude as modified Rodrigues parameters e tan(angle/4), of any norm
  Vector3 omega_BN_B{};                     // rad/s
  std::optional<Vector3> omegaDot_BN_B;     // rad/s^2
  std::optional<Vector3> specific_force_B;  // m/s^2; of B's origin, without gravitation: at rest it points up
  // m/s; integral of the specific force since the start. At most one of the two is given.
  std::optional<Vector3> accumulated_dv_inertial_B;  // accumulated in N, given in the B axes of the instant
  std::optional<Vector3> accumulated_dv_body_sum_B;  // sum of increments, each in the B axes at the end of its step
  // When the simulation has this time. In real time with realtime.epoch, imud maps the simulation's time by it.
  std::optional<Stamp> stamp;
};

struct Answer {
  std::uint32_t stream = 0;
  std::uint32_t sequence = 0;
  std::int64_t simulation_time_ns = 0;  // up to which imud has emitted all samples
  std::uint64_t samples = 0;            // emitted in this run, by all its imus together
  // True if imud accepted the truth: simulation_time_ns is the truth's time. False if imud refused the truth and
  // emitted nothing, because the truth's time is before the last truth's time, or too far after it
  // (truth.max_gap_ms), or because imud does not run in lockstep. A truth of the same time is a repetition, and
  // changes nothing.
  bool accepted = false;
};

struct Options {
  std::chrono::milliseconds timeout{200};  // of an attempt
  unsigned attempts = 50;    // imud may start later than the simulator, or take long to emit many samples
  std::uint32_t stream = 0;  // number of the vehicle; imud accepts the truth of one vehicle only
  // Default: taken from the clock, because imud would take a first truth with an old time and sequence for a
  // repetition, not for a new run.
  std::optional<std::uint32_t> first_sequence;
};

using Datagram = std::array<unsigned char, 208>;

// CRC-32C (Castagnoli).
inline std::uint32_t crc32c(const unsigned char* bytes, std::size_t size) noexcept {
  std::uint32_t crc = 0xFFFFFFFFU;
  for (std::size_t i = 0; i < size; ++i) {
    crc ^= bytes[i];
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1U) ^ ((crc & 1U) != 0 ? 0x82F63B78U : 0U);
  }
  return ~crc;
}

// Returns the datagram of `truth`, which requests an answer if `acknowledge`. Throws std::invalid_argument for a
// truth that imud would refuse: a number is not finite, or there are two accumulated velocities.
inline Datagram encode(const Truth& truth, std::uint32_t stream, std::uint32_t sequence, bool new_run,
                       bool acknowledge = true) {
  Datagram datagram{};
  const auto put = [&datagram](std::size_t offset, std::size_t size, std::uint64_t value) {
    for (std::size_t i = 0; i < size; ++i)
      datagram[offset + i] = static_cast<unsigned char>((value >> (8 * i)) & 0xFFU);
  };
  const auto put_vector = [&put](std::size_t offset, const Vector3& vector, const char* name) {
    for (std::size_t i = 0; i < 3; ++i) {
      if (!std::isfinite(vector[i]))
        throw std::invalid_argument(std::string(name) + " is not finite: has the simulation diverged?");
      std::uint64_t bits = 0;
      static_assert(sizeof bits == sizeof vector[i]);
      std::memcpy(&bits, &vector[i], sizeof bits);
      put(offset + 8 * i, 8, bits);
    }
  };
  unsigned flags = (acknowledge ? 16U : 0U) | (new_run ? 32U : 0U);
  const auto put_given = [&](unsigned flag, std::size_t offset, const std::optional<Vector3>& vector,
                             const char* name) {
    if (!vector) return;
    flags |= flag;
    put_vector(offset, *vector, name);
  };
  if (truth.accumulated_dv_inertial_B && truth.accumulated_dv_body_sum_B)
    throw std::invalid_argument(
        "accumulated_dv_inertial_B and accumulated_dv_body_sum_B: only one of them can be given");

  std::memcpy(datagram.data(), "IMUT", 4);
  put(4, 2, truth.stamp ? 2 : 1);
  put(8, 4, stream);
  put(12, 4, sequence);
  put(16, 8, static_cast<std::uint64_t>(truth.simulation_time_ns));
  put_vector(24, truth.r_BN_N, "r_BN_N");
  put_vector(48, truth.v_BN_N, "v_BN_N");
  put_vector(72, truth.sigma_BN, "sigma_BN");
  put_vector(96, truth.omega_BN_B, "omega_BN_B");
  put_given(1, 120, truth.omegaDot_BN_B, "omegaDot_BN_B");
  put_given(2, 144, truth.specific_force_B, "specific_force_B");
  put_given(4, 168, truth.accumulated_dv_inertial_B, "accumulated_dv_inertial_B");
  put_given(8, 168, truth.accumulated_dv_body_sum_B, "accumulated_dv_body_sum_B");
  put(6, 2, flags);
  if (truth.stamp) {
    put(192, 8, static_cast<std::uint64_t>(truth.stamp->time_ns));
    put(200, 4, static_cast<std::uint32_t>(truth.stamp->clock));
  }
  const std::size_t checksum = truth.stamp ? 204 : 196;
  put(checksum, 4, crc32c(datagram.data(), checksum));
  return datagram;
}

// A UDP socket that sends to one address, and receives from it only.
class Connection {
 public:
  // `address`: a numeric IPv4 or IPv6 address, as in imud's truth.port. Throws std::invalid_argument if the text
  // is no address, and std::system_error if nothing can be sent to the address.
  Connection(const std::string& address, std::uint16_t port)
      : name_("udp:" + (address.find(':') == std::string::npos ? address : "[" + address + "]") + ":" +
              std::to_string(port)) {
    addrinfo hints{};
    hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV;
    hints.ai_socktype = SOCK_DGRAM;
    addrinfo* found = nullptr;
    if (const int error = ::getaddrinfo(address.c_str(), std::to_string(port).c_str(), &hints, &found); error != 0)
      throw std::invalid_argument(name_ + ": " + ::gai_strerror(error) +
                                  "; right would be an address such as 127.0.0.1");
    socket_ = ::socket(found->ai_family, SOCK_DGRAM, 0);
    // A connected socket receives from its peer only, and reports an error if the peer's port is not open.
    const bool connected = socket_ >= 0 && ::connect(socket_, found->ai_addr, found->ai_addrlen) == 0;
    const int error = errno;
    ::freeaddrinfo(found);
    if (!connected) {
      if (socket_ >= 0) ::close(socket_);
      throw std::system_error(error, std::generic_category(), name_ + ": cannot send there");
    }
    ::fcntl(socket_, F_SETFD, FD_CLOEXEC);
  }
  ~Connection() { ::close(socket_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  const std::string& name() const noexcept { return name_; }  // as in imud's configuration
  int socket() const noexcept { return socket_; }

  // Returns 0 or errno.
  int send(const Datagram& datagram) const noexcept {
    // The first error may belong to an earlier datagram; therefore try once more.
    for (int i = 0; i < 2; ++i)
      if (::send(socket_, datagram.data(), datagram.size(), 0) >= 0) return 0;
    return errno;
  }

 private:
  std::string name_;
  int socket_ = -1;
};

// One run of one vehicle: the first truth is marked as the beginning of a run. Use it from one thread at a time.
class LockstepClient {
 public:
  // Throws as Connection does. Only step() shows whether imud is running.
  LockstepClient(const std::string& address, std::uint16_t port, const Options& options = {})
      : options_(options),
        connection_(address, port),
        sequence_(options.first_sequence ? *options.first_sequence
                                         : static_cast<std::uint32_t>(Clock::now().time_since_epoch().count())) {}

  // Sends `truth` and waits for imud's answer; sends the same datagram again if no answer comes in time. This is
  // harmless, as imud answers a repeated truth again and emits nothing twice. Throws std::runtime_error if no
  // attempt is answered, and std::invalid_argument as encode() does.
  Answer step(const Truth& truth) {
    const std::uint32_t sequence = sequence_++;
    const Datagram datagram = encode(truth, options_.stream, sequence, first_);
    int error = 0;
    for (unsigned attempt = 0; attempt < options_.attempts; ++attempt) {
      error = connection_.send(datagram);  // after an error no answer arrives, and the next attempt follows
      if (std::optional<Answer> answer = wait(sequence, error)) {
        answer->accepted = answer->simulation_time_ns == truth.simulation_time_ns;
        first_ = false;
        return *answer;
      }
    }
    throw std::runtime_error(
        "no answer from " + connection_.name() + " to the truth of " + std::to_string(truth.simulation_time_ns) +
        " ns, sent " + std::to_string(options_.attempts) + " times, " + std::to_string(options_.timeout.count()) +
        " ms each" + (error == 0 ? "" : " (" + std::generic_category().message(error) + ")") +
        "; right would be an imud that runs with clock = \"lockstep\" and truth.port = \"" + connection_.name() +
        "\"; if it does, its log names the truths that it refuses unanswered");
  }

 private:
  using Clock = std::chrono::steady_clock;

  // Returns the answer to `sequence`, or nullopt after the timeout; ignores all other datagrams.
  std::optional<Answer> wait(std::uint32_t sequence, int& error) const {
    const Clock::time_point until = Clock::now() + options_.timeout;
    for (Clock::time_point now = Clock::now(); now < until; now = Clock::now()) {
      const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - now);
      pollfd ready{connection_.socket(), POLLIN, 0};
      if (::poll(&ready, 1, static_cast<int>(std::min(left, std::chrono::milliseconds(1000)).count())) <= 0) continue;
      std::array<unsigned char, 64> bytes;
      const ssize_t size = ::recv(connection_.socket(), bytes.data(), bytes.size(), MSG_DONTWAIT);
      if (size < 0) error = errno;
      if (size != 32 || std::memcmp(bytes.data(), "IMUA\1\0", 6) != 0) continue;
      const auto get = [&bytes](std::size_t offset, std::size_t length) {
        std::uint64_t value = 0;
        for (std::size_t i = 0; i < length; ++i) value |= std::uint64_t{bytes[offset + i]} << (8 * i);
        return value;
      };
      if (get(8, 4) != options_.stream || get(12, 4) != sequence) continue;
      return Answer{options_.stream, sequence, static_cast<std::int64_t>(get(16, 8)), get(24, 8), false};
    }
    return std::nullopt;
  }

  const Options options_;
  const Connection connection_;
  std::uint32_t sequence_;  // of the next truth
  bool first_ = true;       // no truth was answered yet
};

}  // namespace imud_lockstep
