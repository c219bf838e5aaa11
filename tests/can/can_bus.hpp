// Shared by the tests of CAN ports: frames to send, received frames, and an interface for the test alone.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <poll.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "tests/can/can_node.hpp"
#include "transports/host_clock.hpp"
#include "transports/port.hpp"

namespace imud {

using namespace std::chrono_literals;

// The frames of one sample.
class SampleFrames {
 public:
  SampleFrames& add(CanHeader header, std::size_t size, std::uint8_t first = 1) {
    const auto room = buffer_.room(size);
    for (std::size_t i = 0; i < size; ++i) room[i] = static_cast<std::byte>(first + i);
    buffer_.push(size, header);
    return *this;
  }
  operator std::span<const Frame>() const { return buffer_.frames(); }

 private:
  FrameBuffer buffer_;
};

// Sends `count` classic frames. The identifier is 0x100 plus the frame's index; the data begin with the sample's
// number.
inline void send_sample(Port& port, std::uint8_t number, std::uint32_t count = 1) {
  SampleFrames sample;
  for (std::uint32_t i = 0; i < count; ++i) sample.add({.id = 0x100 + i}, 8, number);
  port.send(sample);
}

// Returns the next frame that the port receives; nullopt if there is none for 2 s. A vcan delivers a frame with a
// short delay.
inline std::optional<Port::Received> receive_next(Port& port) {
  for (int i = 0; i < 20; ++i) {
    pollfd ready{port.descriptor(), POLLIN, 0};
    if (::poll(&ready, 1, 100) == 1)
      if (const auto received = port.receive()) return received;
  }
  return std::nullopt;
}

// Flushes the port whenever the port requests this. Returns false if the port still holds frames after a minute.
inline bool drain(Port& port) {
  const HostTime end = host_now() + 60s;
  while (!port.is_drained()) {
    if (host_now() > end) return false;
    pollfd room{port.wants_output() ? port.descriptor() : -1, POLLOUT, 0};
    const auto next = port.next_flush();
    const Nanoseconds pause = next ? std::clamp<Nanoseconds>(*next - host_now(), 0ns, 10ms) : 10ms;
    const timespec timeout{0, pause.count()};
    ::ppoll(&room, 1, &timeout, nullptr);
  }
  return true;
}

inline void wait_until_back(Port& port) {
  for (int i = 0; i < 1000 && port.state() == PortState::lost; ++i) {
    send_sample(port, 0);
    std::this_thread::sleep_for(10ms);
  }
  ASSERT_EQ(port.state(), PortState::ready);
}

class Can : public ::testing::Test {
 protected:
  // An interface that the test may take down and remove.
  static constexpr const char* own = "imudcan";
  void SetUp() override {
    ASSERT_NE(::if_nametoindex("vcan0"), 0U) << "run it in tools/with-vcan";
    ip(fmt::format("link del {}", own));
    make_own();
  }
  void TearDown() override { ip(fmt::format("link del {}", own)); }
  static void make_own(int mtu = 72) {
    ASSERT_TRUE(ip(fmt::format("link add {} type vcan", own)));
    ASSERT_TRUE(ip(fmt::format("link set {} mtu {} up", own, mtu)));
  }
  static std::unique_ptr<Port> open(const std::string& interface, Delivery delivery = Delivery::timely) {
    PortSettings settings = Role::device;
    settings.delivery = delivery;
    return open_port("can:" + interface, settings);
  }
};

}  // namespace imud
