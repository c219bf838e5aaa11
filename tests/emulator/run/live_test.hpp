// Shared by the tests of `imud run` with truth by UDP: a simulator, and the start of the program.
#pragma once

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <optional>

#include "protocols/native_truth.hpp"
#include "tests/emulator/run/run_test.hpp"
#include "tests/support/free_port.hpp"
#include "tools/truth/motion.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {

// The simulator of the test.
class Simulator {
 public:
  Simulator() : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    address_.sin_family = AF_INET;
    address_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address_.sin_port = htons(static_cast<std::uint16_t>(free_udp_port()));
    // A connected socket reports if no socket has the port (ECONNREFUSED).
    ::connect(socket_.get(), reinterpret_cast<const sockaddr*>(&address_), sizeof address_);
  }
  std::string port() const { return fmt::format("udp:127.0.0.1:{}", ntohs(address_.sin_port)); }

  using Datagram = std::array<std::byte, 208>;
  // A truth of the spiral with angular acceleration, specific force and accumulated velocity.
  static Truth truth(std::int64_t ms, std::uint32_t sequence, bool acknowledge) {
    Truth t = find_motion("spiral")->at(TruthTime{ms * 1'000'000}, {});
    t.sequence = sequence;
    t.acknowledge = acknowledge;
    return t;
  }
  static Datagram encode(const Truth& t) {
    Datagram d{};
    encode_native_truth(t, d);
    return d;
  }
  void send(std::span<const std::byte> bytes) {
    // An error of an earlier datagram is returned in place of sending this one.
    for (int i = 0; i < 2 && ::send(socket_.get(), bytes.data(), bytes.size(), 0) < 0; ++i) {
    }
  }
  // Returns the answer; nullopt if none arrives within `timeout_ms`.
  std::optional<NativeAcknowledgement> answer(int timeout_ms) {
    was_refused_ = false;
    const auto first = receive(timeout_ms);
    return first || !was_refused_ ? first : receive(timeout_ms);
  }
  // Sends the truth, and waits for the answer. Sends it again only while no socket has the port: imud may not run
  // yet.
  std::optional<NativeAcknowledgement> exchange(const Truth& t) {
    const Datagram d = encode(t);
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    send(d);
    while (std::chrono::steady_clock::now() < end) {
      was_refused_ = false;
      const auto acknowledgement = receive(1000);
      if (acknowledgement && acknowledgement->sequence == t.sequence) return acknowledgement;
      if (!was_refused_) continue;
      ::poll(nullptr, 0, 5);
      send(d);
    }
    return std::nullopt;
  }

 private:
  std::optional<NativeAcknowledgement> receive(int timeout_ms) {
    pollfd ready{socket_.get(), POLLIN, 0};
    if (::poll(&ready, 1, timeout_ms) <= 0) return std::nullopt;
    std::array<std::byte, 64> bytes{};
    const ssize_t size = ::recv(socket_.get(), bytes.data(), bytes.size(), 0);
    was_refused_ = size < 0 && errno == ECONNREFUSED;
    NativeAcknowledgement acknowledgement{};
    if (size < 0 ||
        !decode_native_acknowledgement(std::span(bytes).first(static_cast<std::size_t>(size)), acknowledgement))
      return std::nullopt;
    return acknowledgement;
  }

  FileDescriptor socket_;
  sockaddr_in address_{};
  bool was_refused_ = false;  // the datagram before the last receive() was refused
};

class LiveTest : public RunTest {
 protected:
  void start(Program& imud, const std::string& config, std::vector<std::string> more = {}) {
    std::vector<std::string> arguments = {"run", config, "--summary", path("summary.json")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    imud.start(arguments);
  }
  Simulator simulator_;
};

}  // namespace imud
