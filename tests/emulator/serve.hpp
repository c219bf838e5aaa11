// Lets a channel execute what its host has sent.
#pragma once

#include "emulator/imu/channel.hpp"

namespace imud {

inline void serve(Channel& channel, HostTime now) {
  bool has_received = false;
  channel.lines.serve(
      [&](std::size_t uart, const Port::Received& received) { channel.receive(received.frame, uart, now); },
      has_received);
}

}  // namespace imud
