// A run in real time with a control socket.
#pragma once

#include <cstdint>
#include <string>

#include "tests/emulator/control/control_client.hpp"
#include "tests/emulator/run/live_test.hpp"

namespace imud {

class ControlledRun : public LiveTest {
 protected:
  // Writes the configuration of one imu at 1 kHz, with these keys of [control], and returns its path.
  std::string running(const std::string& control = {}, const std::string& more = {}) {
    return write(
        "config.toml",
        fmt::format("clock = \"realtime\"\nrealtime.skip_after_ms = 3600000\n[control]\nsocket = \"{}\"\n{}[truth]\n"
                    "port = \"{}\"\ndelay_ms = 0\n{}[[imu]]\n"
                    "rate_hz = 1000\nprotocol = \"native\"\nport = \"udp:127.0.0.1:9\"\nbefore_first = \"rest\"\n"
                    "gyro.max_rad_per_s = 100\naccelerometer.max_m_per_s2 = 1000\n",
                    path("socket"), control, simulator_.port(), more));
  }
  static std::uint64_t samples(ControlClient& client) {
    return client.call("status")["result"]["imus"][0]["samples"].get<std::uint64_t>();
  }
};

// The port that imud has chosen for `[control] listen`.
inline std::uint16_t tcp_port(const Program& imud) {
  const std::string errors = imud.errors(), words = "control: TCP port ";
  const std::size_t at = errors.find(words);
  return at == errors.npos ? std::uint16_t{0}
                           : static_cast<std::uint16_t>(std::stoi(errors.substr(at + words.size())));
}

}  // namespace imud
