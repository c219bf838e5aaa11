// Runs in tools/with-vcan: vcan0 exists, and the test may make, change and remove interfaces.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <linux/can/error.h>
#include <poll.h>
#include <sys/resource.h>

#include <chrono>
#include <iterator>
#include <optional>
#include <thread>

#include "tests/can/can_bus.hpp"
#include "tests/transports/port_error.hpp"

namespace imud {
namespace {

// In lockstep, too, frames are complete, but a simulator waits for imud.
TEST_F(Can, OnlyAPortThatYieldsLowersThePriority) {
  for (const bool yields : {false, true}) {
    int before = 0, after = 0;
    std::thread([&] {
      before = ::getpriority(PRIO_PROCESS, 0);
      PortSettings settings = Role::device;
      settings.delivery = Delivery::complete;
      settings.yields = yields;
      const auto port = open_port("can:vcan0", settings);
      after = ::getpriority(PRIO_PROCESS, 0);
    }).join();
    ASSERT_LT(before, 19);
    EXPECT_EQ(after, yields ? 19 : before);
  }
}

TEST_F(Can, EveryKindOfFrameInOneSample) {
  const Node node("vcan0");
  const auto port = open("vcan0");
  SampleFrames sample;
  sample.add({.id = 0x7FF}, 8)
      .add({.id = 0x1FFFFFFF, .extended = true}, 0)
      .add({.id = 0x123, .extended = true}, 3)
      .add({.id = 0x055, .remote = true}, 0)
      .add({.id = 0x201, .fd = true}, 64)
      .add({.id = 0x18FF0000, .extended = true, .fd = true, .bit_rate_switch = true}, 12);
  port->send(sample);
  EXPECT_EQ(port->counters().sent, 6U);
  EXPECT_EQ(port->counters().dropped, 0U);

  const auto got = node.receive_all();
  ASSERT_EQ(got.size(), 6U);
  const canid_t ids[] = {0x7FF, 0x1FFFFFFF | CAN_EFF_FLAG, 0x123 | CAN_EFF_FLAG, 0x055 | CAN_RTR_FLAG,
                         0x201, 0x18FF0000 | CAN_EFF_FLAG};
  const unsigned sizes[] = {8, 0, 3, 0, 64, 12};
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(got[i].frame.can_id, ids[i]) << i;
    EXPECT_EQ(got[i].frame.len, sizes[i]) << i;
    EXPECT_EQ(got[i].fd, i >= 4) << i;
    for (std::uint8_t k = 0; k < sizes[i]; ++k) EXPECT_EQ(got[i].frame.data[k], k + 1) << i;
  }
  EXPECT_EQ(got[4].frame.flags & CANFD_BRS, 0);
  EXPECT_EQ(got[5].frame.flags & CANFD_BRS, CANFD_BRS);
  EXPECT_EQ(port->receive(), std::nullopt) << "own frames are not received";
}

TEST_F(Can, FdLengthIsPaddedWithZerosToTheNextThatADlcStandsFor) {
  const Node node("vcan0");
  const auto port = open("vcan0");
  for (unsigned size = 0; size <= 64; ++size) {
    SampleFrames sample;
    port->send(sample.add({.id = 1, .fd = true}, size, 0x80));
    const auto got = node.receive();
    ASSERT_TRUE(got.has_value()) << size;
    unsigned legal = size;
    while (legal > 8 && legal != 12 && legal != 16 && legal != 20 && legal != 24 && legal != 32 && legal != 48 &&
           legal != 64)
      ++legal;
    EXPECT_EQ(got->frame.len, legal) << size;
    for (unsigned k = 0; k < legal; ++k) EXPECT_EQ(got->frame.data[k], k < size ? 0x80 + k : 0) << size;
  }
}

TEST_F(Can, WhatTheInterfaceCannotCarryIsDroppedAlone) {
  const Node node("vcan0");
  const auto port = open("vcan0");
  SampleFrames sample;
  sample.add({.id = 1}, 8)
      .add({.id = 2}, 9)
      .add({.id = 3, .fd = true}, 65)
      .add({.id = 0x800}, 1)
      .add({.id = 0x20000000, .extended = true}, 1)
      .add({.id = 4, .fd = true, .remote = true}, 0)
      .add({.id = 6}, 8);
  port->send(sample);
  EXPECT_EQ(port->counters().sent, 2U);
  EXPECT_EQ(port->counters().dropped, 5U);
  const auto got = node.receive_all();
  ASSERT_EQ(got.size(), 2U);
  EXPECT_EQ(got[0].frame.can_id, 1U);
  EXPECT_EQ(got[1].frame.can_id, 6U);
}

TEST_F(Can, FdFramesNeedTheInterfacesMtu) {
  ASSERT_TRUE(ip(fmt::format("link set {} down", own)));
  ASSERT_TRUE(ip(fmt::format("link set {} mtu 16 up", own)));
  const auto port = open(own);
  SampleFrames sample;
  sample.add({.id = 1, .fd = true}, 8);
  port->send(sample);
  EXPECT_EQ(port->counters().dropped, 1U);
  EXPECT_EQ(port->state(), PortState::ready);
  EXPECT_TRUE(mentions(error_of(fmt::format("can:{}?mtu=72", own)), "mtu 72"));

  ASSERT_TRUE(ip(fmt::format("link set {} down", own)));
  send_sample(*port, 1);
  ASSERT_TRUE(ip(fmt::format("link set {} mtu 72 up", own)));
  port->send(sample);
  EXPECT_EQ(port->counters().sent, 1U);
  EXPECT_EQ(port->state(), PortState::ready);

  const auto classic_only = open_port(fmt::format("can:{}?mtu=16", own), Role::device);
  classic_only->send(sample);
  EXPECT_EQ(classic_only->counters().dropped, 1U);
}

TEST_F(Can, ReceivesFramesOfOthers) {
  const Node node("vcan0");
  const auto port = open("vcan0");
  EXPECT_EQ(port->receive(), std::nullopt);
  node.send(0x080, {7});
  node.send(0x18EA80F9 | CAN_EFF_FLAG, {1, 2, 3});
  node.send(0x701 | CAN_RTR_FLAG, {});
  canfd_frame fd{};
  fd.can_id = 0x123;
  fd.len = 64;
  fd.flags = CANFD_BRS;
  fd.data[63] = 0xEE;
  node.send(fd, true);
  node.send(CAN_ERR_FLAG | CAN_ERR_CRTL, {0, CAN_ERR_CRTL_TX_WARNING, 0, 0, 0, 0, 96, 0});

  auto received = receive_next(*port);
  ASSERT_TRUE(received.has_value());
  EXPECT_EQ(received->frame.can.id, 0x080U);
  EXPECT_FALSE(received->frame.can.extended || received->frame.can.fd || received->frame.can.remote);
  ASSERT_EQ(received->frame.bytes.size(), 1U);
  EXPECT_EQ(received->frame.bytes[0], std::byte{7});
  received = receive_next(*port);
  ASSERT_TRUE(received.has_value());
  EXPECT_EQ(received->frame.can.id, 0x18EA80F9U);
  EXPECT_TRUE(received->frame.can.extended);
  EXPECT_EQ(received->frame.bytes.size(), 3U);
  received = receive_next(*port);
  ASSERT_TRUE(received.has_value());
  EXPECT_EQ(received->frame.can.id, 0x701U);
  EXPECT_TRUE(received->frame.can.remote);
  received = receive_next(*port);
  ASSERT_TRUE(received.has_value());
  EXPECT_TRUE(received->frame.can.fd && received->frame.can.bit_rate_switch);
  ASSERT_EQ(received->frame.bytes.size(), 64U);
  EXPECT_EQ(received->frame.bytes[63], std::byte{0xEE});
  received = receive_next(*port);
  ASSERT_TRUE(received.has_value());
  EXPECT_TRUE(received->frame.can.error);
  EXPECT_EQ(received->frame.can.id, canid_t{CAN_ERR_CRTL});
  EXPECT_EQ(received->frame.bytes.size(), 8U);
  EXPECT_EQ(port->receive(), std::nullopt);
  EXPECT_EQ(port->counters().received, 5U);
  EXPECT_EQ(port->state(), PortState::error_warning);
}

TEST_F(Can, BusOffIsALossUntilTheControllerRestarts) {
  const Node node("vcan0");
  const auto port = open("vcan0");
  node.send(CAN_ERR_FLAG | CAN_ERR_BUSOFF, {0, 0, 0, 0, 0, 0, 0, 0});
  node.send(CAN_ERR_FLAG | CAN_ERR_CRTL, {0, 0, 0, 0, 0, 0, 0, 0});
  EXPECT_TRUE(receive_next(*port).has_value());
  EXPECT_EQ(port->state(), PortState::lost);
  EXPECT_TRUE(receive_next(*port).has_value());
  send_sample(*port, 1, 3);
  EXPECT_EQ(port->state(), PortState::lost);
  EXPECT_EQ(port->counters().dropped, 3U);
  EXPECT_EQ(port->counters().lost_count, 1U);
  node.send(CAN_ERR_FLAG | CAN_ERR_RESTARTED, {0, 0, 0, 0, 0, 0, 0, 0});
  EXPECT_TRUE(receive_next(*port).has_value());
  EXPECT_EQ(port->state(), PortState::ready);
  send_sample(*port, 2, 3);
  EXPECT_EQ(port->counters().sent, 3U);
}

TEST_F(Can, RealDriverInBusOff) {
  LineController controller;
  ASSERT_TRUE(ip(fmt::format("link set {} txqueuelen 10 up type can bitrate 500000", controller.name)));
  const auto port = open(controller.name + "?max_age_ms=60000");
  for (std::uint8_t i = 0; i < 10; ++i) send_sample(*port, i, 3);
  ASSERT_TRUE(drain(*port));
  EXPECT_EQ(port->counters().sent, 30U);
  EXPECT_EQ(controller.frames(30U), 30U);

  controller.send("sb000256\r");
  auto received = receive_next(*port);
  ASSERT_TRUE(received.has_value());
  EXPECT_TRUE(received->frame.can.error && (received->frame.can.id & CAN_ERR_BUSOFF) != 0);
  EXPECT_EQ(port->state(), PortState::lost);
  for (std::uint8_t i = 0; i < 10; ++i) send_sample(*port, i, 3);
  EXPECT_EQ(port->counters().dropped, 30U);
  EXPECT_EQ(port->next_flush(), std::nullopt);

  ASSERT_TRUE(ip(fmt::format("link set {} down", controller.name)));
  ASSERT_TRUE(ip(fmt::format("link set {} up", controller.name)));
  send_sample(*port, 1, 3);
  EXPECT_EQ(port->state(), PortState::ready);
  EXPECT_EQ(port->counters().dropped, 30U);
  EXPECT_EQ(port->counters().sent, 33U);
  EXPECT_EQ(controller.frames(33U), 33U);
}

TEST_F(Can, DownAndUp) {
  const Node node(own);
  const auto port = open(own);
  send_sample(*port, 1, 3);
  for (std::uint64_t time = 1; time <= 2; ++time) {
    ASSERT_TRUE(ip(fmt::format("link set {} down", own)));
    for (int i = 0; i < 10; ++i) send_sample(*port, 2, 3);
    EXPECT_EQ(port->state(), PortState::lost);
    EXPECT_EQ(port->counters().lost_count, time);
    EXPECT_EQ(port->counters().dropped, 30 * time);
    EXPECT_EQ(port->receive(), std::nullopt);
    ASSERT_TRUE(ip(fmt::format("link set {} up", own)));
    send_sample(*port, 3, 3);
    EXPECT_EQ(port->state(), PortState::ready);
    EXPECT_EQ(port->counters().dropped, 30 * time) << "the first sample that can go does go";
  }
  EXPECT_EQ(port->counters().sent, 9U);
  // The node's own socket reports once that the interface was down.
  std::size_t got = 0;
  for (int i = 0; i < 20; ++i) got += node.receive().has_value();
  EXPECT_EQ(got, 9U);
}

TEST_F(Can, DownAndUpUnnoticedLosesNothing) {
  const auto port = open(own);
  ASSERT_TRUE(ip(fmt::format("link set {} down", own)) && ip(fmt::format("link set {} up", own)));
  const Node node(own);
  send_sample(*port, 1, 3);
  EXPECT_EQ(port->counters().sent, 3U);
  EXPECT_EQ(node.receive_all().size(), 3U);
  ASSERT_TRUE(ip(fmt::format("link set {} down", own)) && ip(fmt::format("link set {} up", own)));
  const Node other(own);
  other.send(0x123, {1});
  EXPECT_TRUE(receive_next(*port).has_value());
  EXPECT_EQ(port->state(), PortState::ready);
}

TEST_F(Can, FramesFromBeforeDoNotMakeItUp) {
  const Node node(own);
  const auto port = open(own);
  node.send(0x123, {1});
  pollfd ready{port->descriptor(), POLLIN, 0};
  ASSERT_EQ(::poll(&ready, 1, 5000), 1);
  ASSERT_TRUE(ip(fmt::format("link set {} down", own)));
  EXPECT_TRUE(port->receive().has_value());
  EXPECT_EQ(port->state(), PortState::lost);
  send_sample(*port, 1);
  EXPECT_EQ(port->counters().lost_count, 1U);
}

TEST_F(Can, OpenedWhileDownComesUp) {
  ASSERT_TRUE(ip(fmt::format("link set {} down", own)));
  const auto port = open(own);
  EXPECT_EQ(port->state(), PortState::lost);
  send_sample(*port, 1);
  ASSERT_TRUE(ip(fmt::format("link set {} up", own)));
  send_sample(*port, 2);
  EXPECT_EQ(port->state(), PortState::ready);
  EXPECT_EQ(port->counters().sent, 1U);
  EXPECT_EQ(port->counters().dropped, 1U);
}

TEST_F(Can, RemovedAndMadeAgain) {
  const auto port = open(own);
  for (std::uint64_t time = 1; time <= 2; ++time) {
    const std::uint64_t sent = port->counters().sent;
    ASSERT_TRUE(ip(fmt::format("link del {}", own)));
    for (int i = 0; i < 10; ++i) send_sample(*port, 1, 3);
    EXPECT_EQ(port->state(), PortState::lost);
    EXPECT_EQ(port->counters().lost_count, time);
    EXPECT_EQ(port->counters().sent, sent);
    EXPECT_EQ(port->descriptor(), -1);
    make_own();
    wait_until_back(*port);
    EXPECT_GE(port->descriptor(), 0);
    const Node node(own);
    send_sample(*port, 2, 3);
    EXPECT_EQ(node.receive_all().size(), 3U);
    node.send(0x321, {1});
    ASSERT_TRUE(receive_next(*port).has_value());
  }
}

TEST_F(Can, ReceivingNoticesTheRemovalAndTheReturn) {
  const auto port = open(own);
  ASSERT_TRUE(ip(fmt::format("link del {}", own)));
  EXPECT_EQ(port->receive(), std::nullopt);
  EXPECT_EQ(port->state(), PortState::lost);
  make_own();
  for (int i = 0; i < 1000 && port->state() == PortState::lost; ++i) {
    EXPECT_EQ(port->receive(), std::nullopt);
    std::this_thread::sleep_for(10ms);
  }
  ASSERT_EQ(port->state(), PortState::ready);
  const Node node(own);
  node.send(0x321, {1});
  EXPECT_TRUE(receive_next(*port).has_value());
}

TEST_F(Can, NamesTheCauseIfItCannotBeOpened) {
  EXPECT_TRUE(mentions(error_of("can:nosuchcan"), "no such interface"));
  EXPECT_TRUE(mentions(error_of("can:lo"), "is it a CAN interface?"));
  EXPECT_TRUE(mentions(error_of("can:namelongerthan15"), "too long for an interface"));
  EXPECT_TRUE(mentions(error_of("can:vcan0?bitrate=0"), "from 5000 to 1000000"));
  EXPECT_TRUE(mentions(error_of("can:vcan0?data_bitrate=1"), "data_bitrate=1"));
  EXPECT_TRUE(mentions(error_of("can:vcan0?mtu=73"), "any 16 72"));
  EXPECT_TRUE(mentions(error_of("can:vcan0?frames_per_s=0"), "from 1 to 1000000"));
  EXPECT_TRUE(mentions(error_of("can:vcan0?max_age_ms=0"), "from 1 to 60000"));
  EXPECT_TRUE(mentions(error_of("can:vcan0?confirm=1"), "no yes"));
  EXPECT_EQ(error_of("can:vcan0?bitrate=500000&data_bitrate=2000000&mtu=72&frames_per_s=unlimited&max_age_ms=20"
                     "&confirm=yes"),
            "");
}

}  // namespace
}  // namespace imud
