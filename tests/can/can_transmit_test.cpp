// The transmit queue of a port on real interfaces: full ones, slow ones, and unlimited ones. Runs in tools/with-vcan,
// whose guest has a coarse clock: times are compared with lower bounds only.
#include <linux/can/error.h>
#include <poll.h>

#include <string_view>
#include <thread>

#include "tests/can/can_bus.hpp"

namespace imud {
namespace {

// A queue for an interface that has room for ten frames, and delays them for longer than any test takes.
constexpr std::string_view stuck = "netem delay 100s limit 10";

// A pair of interfaces. The queue of the first one has room for ten frames, one of which takes 6 ms.
class SlowBus {
 public:
  explicit SlowBus(std::string_view queue = "netem rate 20kbit limit 10") {
    ip("link del imudfar");
    EXPECT_TRUE(ip("link add imudnear type vxcan peer name imudfar"));
    EXPECT_TRUE(ip("link set imudnear up") && ip("link set imudfar up"));
    EXPECT_TRUE(run_command(fmt::format("tc qdisc add dev imudnear root {}", queue)));
  }
  ~SlowBus() { ip("link del imudnear"); }
};

TEST_F(Can, ATransferLongerThanTheInterfacesQueueLeavesWholeAndInOrder) {
  const SlowBus bus;
  const Node node("imudfar");
  const auto port = open("imudnear");
  std::uint64_t sent = 0;
  for (const std::uint32_t count : {15U, 60U}) {
    send_sample(*port, 1, count);
    if (count == 60) {  // if the test is held up, the bus may have sent 15 by then
      EXPECT_LT(port->counters().sent, sent + count) << "the queue was never full: the test proves nothing";
      EXPECT_TRUE(port->next_flush().has_value());
      EXPECT_FALSE(port->wants_output()) << "poll() would return at once";
    }
    ASSERT_TRUE(drain(*port));
    sent += count;
    EXPECT_EQ(port->counters().sent, sent);
    EXPECT_EQ(port->next_flush(), std::nullopt);
    const auto got = node.receive_all();
    ASSERT_EQ(got.size(), count);
    for (std::uint32_t i = 0; i < count; ++i) EXPECT_EQ(got[i].frame.can_id, 0x100 + i);
  }
  EXPECT_EQ(port->counters().dropped, 0U);
  EXPECT_EQ(port->state(), PortState::ready);
}

TEST_F(Can, AFullQueueDropsWholeSamplesAndNeverMixesTwo) {
  const SlowBus bus;
  const Node node("imudfar");
  const auto port = open("imudnear");
  constexpr std::uint32_t frames = 7;
  constexpr std::uint8_t samples = 200;
  for (std::uint8_t i = 0; i < samples; ++i) {
    send_sample(*port, i, frames);
    if (i % 20 == 0) std::this_thread::sleep_for(1ms);
  }
  ASSERT_TRUE(drain(*port));
  EXPECT_EQ(port->counters().sent + port->counters().dropped, samples * frames);
  EXPECT_GT(port->counters().dropped, 0U);
  EXPECT_GT(port->counters().sent, 10U);
  EXPECT_EQ(port->counters().dropped % frames, 0U);
  EXPECT_EQ(port->state(), PortState::ready);
  EXPECT_EQ(port->counters().lost_count, 0U);

  const auto got = node.receive_all();
  ASSERT_EQ(got.size(), port->counters().sent);
  int last = -1;
  for (std::size_t i = 0; i < got.size(); ++i) {
    EXPECT_EQ(got[i].frame.can_id, 0x100 + i % frames);
    if (i % frames == 0) {
      EXPECT_GT(got[i].frame.data[0], last);
      last = got[i].frame.data[0];
    }
    EXPECT_EQ(got[i].frame.data[0], last);
  }
}

TEST_F(Can, OldSamplesAreNotSentWhenABusMovesAgain) {
  LineController controller;
  ASSERT_TRUE(ip(fmt::format("link set {} txqueuelen 10 up type can bitrate 500000", controller.name)));
  const auto port = open(controller.name + "?max_age_ms=20");
  controller.reading = false;
  for (std::uint8_t i = 0; i < 200; ++i) send_sample(*port, i, 5);
  const std::uint64_t jammed = port->counters().sent;
  EXPECT_LT(jammed, 1000U);
  std::this_thread::sleep_for(50ms);
  controller.reading = true;
  ASSERT_TRUE(drain(*port));
  EXPECT_LT(port->counters().sent, jammed + 5) << "no more than the rest of the sample begun";
  EXPECT_EQ(port->counters().sent % 5, 0U);
  EXPECT_EQ(port->counters().sent + port->counters().dropped, 1000U);
  EXPECT_EQ(controller.frames(port->counters().sent), port->counters().sent);
  EXPECT_EQ(port->state(), PortState::ready);

  const std::uint64_t sent = port->counters().sent;
  send_sample(*port, 1, 5);
  ASSERT_TRUE(drain(*port));
  EXPECT_EQ(port->counters().sent, sent + 5);
  EXPECT_EQ(controller.frames(port->counters().sent), port->counters().sent);
}

// With a long queue of the interface, the socket's send buffer is full first, which poll() reports.
TEST_F(Can, AFullSendBufferWaitsForPoll) {
  LineController controller;
  ASSERT_TRUE(ip(fmt::format("link set {} txqueuelen 1000 up type can bitrate 500000", controller.name)));
  const auto port = open(controller.name + "?max_age_ms=1", Delivery::complete);
  controller.reading = false;
  std::uint64_t handed = 0;
  for (; !port->wants_output() && handed < 10'000; handed += 60) send_sample(*port, 1, 60);
  send_sample(*port, 2, 60);  // none of them can be sent
  handed += 60;
  EXPECT_TRUE(port->wants_output());
  EXPECT_EQ(port->next_flush(), std::nullopt);
  EXPECT_EQ(port->counters().dropped, 0U);
  pollfd room{port->descriptor(), POLLOUT, 0};
  EXPECT_EQ(::poll(&room, 1, 0), 0);
  std::this_thread::sleep_for(30ms);  // too old in realtime
  controller.reading = true;
  EXPECT_EQ(::poll(&room, 1, 20'000), 1);
  ASSERT_TRUE(drain(*port));
  EXPECT_FALSE(port->wants_output());
  EXPECT_EQ(port->counters().sent, handed);
  EXPECT_EQ(controller.frames(handed), handed);
}

TEST_F(Can, WhatIsLeftAtTheEndCountsAsDropped) {
  const SlowBus bus(stuck);
  const auto port = open("imudnear");
  send_sample(*port, 1, 60);
  EXPECT_FALSE(port->is_drained());
  port->discard_pending();
  EXPECT_TRUE(port->is_drained());
  EXPECT_EQ(port->counters().sent + port->counters().dropped, 60U);
  EXPECT_GT(port->counters().dropped, 0U);
}

TEST_F(Can, WhatWaitsIsDroppedWhenTheInterfaceGoesDown) {
  const SlowBus bus(stuck);
  const auto port = open("imudnear");
  send_sample(*port, 1, 60);
  ASSERT_TRUE(ip("link set imudnear down"));
  ASSERT_TRUE(drain(*port));
  EXPECT_EQ(port->state(), PortState::lost);
  EXPECT_GT(port->counters().dropped, 0U);
  EXPECT_EQ(port->counters().sent + port->counters().dropped, 60U);
}

// The MTU is lowered while frames wait: frames that still fit are sent.
TEST_F(Can, FdFramesThatTheInterfaceNoLongerCarriesAreDroppedAlone) {
  ASSERT_TRUE(run_command(fmt::format("tc qdisc add dev {} root {}", own, stuck)));
  const auto port = open(own, Delivery::timely);
  SampleFrames sample;
  for (std::uint32_t i = 0; i < 20; ++i) sample.add({.id = i, .fd = i == 19}, 8);
  port->send(sample);
  ASSERT_FALSE(port->is_drained());
  ASSERT_TRUE(ip(fmt::format("link set {} down", own)));
  ASSERT_TRUE(ip(fmt::format("link set {} mtu 16 up", own)));
  ASSERT_TRUE(drain(*port));
  EXPECT_EQ(port->counters().sent, 19U);
  EXPECT_EQ(port->counters().dropped, 1U);
  EXPECT_EQ(port->state(), PortState::ready);
}

// --- Virtual interfaces, where nothing may be lost

// Returns how long the sending of `samples` samples of 20 frames takes; the first frame is sent immediately.
Nanoseconds time_to_send(Port& port, int samples) {
  const HostTime begin = host_now();
  for (int i = 0; i < samples; ++i) {
    send_sample(port, 1, 20);
    EXPECT_TRUE(drain(port));
  }
  EXPECT_EQ(port.counters().sent, 20U * static_cast<unsigned>(samples));
  EXPECT_EQ(port.counters().dropped, 0U);
  return host_now() - begin;
}

TEST_F(Can, FramesToAVirtualInterfaceKeepARate) {
  // The last of 60 frames is sent 59 ms after the first, less 5 ms that a paced queue may catch up.
  EXPECT_GE(time_to_send(*open("vcan0?frames_per_s=1000", Delivery::complete), 3), 54ms);
  // 135 bits each: 27 ms at 5 kbit/s.
  EXPECT_GE(time_to_send(*open("vcan0?bitrate=5000", Delivery::complete), 1), 19 * 27ms - 5ms);
  EXPECT_GE(time_to_send(*open("vcan0?bitrate=5000&frames_per_s=1000", Delivery::complete), 1), 19 * 27ms - 5ms);
  EXPECT_GE(time_to_send(*open("vcan0?bitrate=1000000&frames_per_s=100", Delivery::complete), 1), 185ms);
  // The default is 5000 frames per second.
  EXPECT_GE(time_to_send(*open("vcan0", Delivery::complete), 25), 499 * 200us - 5ms);
  const SlowBus bus;
  EXPECT_GE(time_to_send(*open("imudfar?frames_per_s=100", Delivery::complete), 1), 185ms)
      << "a vxcan is virtual, too";
}

TEST_F(Can, FramesLeaveAtOnceWhereNoRateIsWanted) {
  LineController controller;
  ASSERT_TRUE(ip(fmt::format("link set {} txqueuelen 100 up type can bitrate 500000", controller.name)));
  const auto unlimited = open("vcan0?bitrate=5000&frames_per_s=unlimited", Delivery::complete);
  const auto in_time = open("vcan0?bitrate=5000&frames_per_s=1", Delivery::timely);
  const auto controlled = open(controller.name + "?bitrate=5000&frames_per_s=1", Delivery::complete);
  for (Port* port : {unlimited.get(), in_time.get(), controlled.get()}) {
    send_sample(*port, 1, 60);
    EXPECT_EQ(port->counters().sent, 60U);
    EXPECT_TRUE(port->is_drained());
  }
}

TEST_F(Can, UnpacedFramesOfFastLeaveInBatches) {
  PortSettings settings = Role::device;
  settings.delivery = Delivery::complete;
  settings.yields = settings.collects = true;  // as in `fast`
  const Node node("vcan0");
  // The port lowers the priority of its thread for good.
  std::jthread([&] {
    const auto port = open_port("can:vcan0?frames_per_s=unlimited", settings);
    const auto sends = [&](std::uint64_t frames) { return port->counters().sent == frames; };
    for (std::uint8_t i = 0; i < 9; ++i) send_sample(*port, i, 7);
    EXPECT_TRUE(sends(0)) << "63 frames are no batch";
    EXPECT_EQ(port->next_flush(), std::nullopt) << "a run does not wait for them";
    node.send(0x42, {1});
    EXPECT_FALSE(port->receive()) << "the host has seen nothing yet";
    send_sample(*port, 9, 7);
    EXPECT_TRUE(sends(70));
    EXPECT_TRUE(receive_next(*port));
    send_sample(*port, 10, 7);
    EXPECT_TRUE(sends(70));
    port->reply(SampleFrames().add({.id = 0x200}, 8));
    EXPECT_TRUE(sends(78)) << "an answer leaves at once, behind the samples before it";
    send_sample(*port, 11, 7);
    port->flush();
    EXPECT_TRUE(sends(85));
    send_sample(*port, 12, 7);
    EXPECT_TRUE(port->is_drained());
    EXPECT_TRUE(sends(92));
    port->reply(SampleFrames().add({.id = 0x200}, 8));
    EXPECT_TRUE(sends(93)) << "after a flush, too";
    send_sample(*port, 13, 7);
    node.send(0x43, {1});
    for (int look = 1; look < 128; ++look) EXPECT_FALSE(port->receive());
    EXPECT_TRUE(sends(93));
    EXPECT_TRUE(receive_next(*port)) << "the host of a device that has become silent";
    EXPECT_TRUE(sends(100));
    EXPECT_EQ(port->counters().dropped, 0U);
  }).join();
  const auto got = node.receive_all();
  ASSERT_EQ(got.size(), 100U);
  EXPECT_EQ(got[76].frame.can_id, 0x106U);
  EXPECT_EQ(got[77].frame.can_id, 0x200U);
}

// The receiver reads at least every 5 ms: meanwhile 25 frames arrive, and 25 more after a late flush.
TEST_F(Can, AReceiverWithADefaultBufferSeesEveryPacedFrame) {
  constexpr std::uint32_t count = 10'000;
  const Node node("vcan0", Node::Buffer::by_default);
  std::size_t seen = 0;
  const auto read_all = [&](int timeout_ms) {
    for (auto frame = node.receive(timeout_ms); frame; frame = node.receive(timeout_ms))
      EXPECT_EQ(frame->frame.can_id, 0x100 + seen++ % 50);
  };
  const auto port = open("vcan0", Delivery::complete);
  HostTime next_read;
  for (std::uint32_t sent = 0; sent < count; sent += 50) {
    send_sample(*port, 1, 50);
    for (bool drained = false; !drained; drained = port->is_drained()) {
      if (const auto next = port->next_flush())
        std::this_thread::sleep_for(std::max<Nanoseconds>(*next - host_now(), 0ns));
      if (host_now() < next_read) continue;
      read_all(0);
      next_read = host_now() + 5ms;
    }
  }
  read_all(200);
  EXPECT_EQ(port->counters().sent, count);
  EXPECT_EQ(seen, count);

  const auto unlimited = open("vcan0?frames_per_s=unlimited", Delivery::complete);
  for (int i = 0; i < 20; ++i) send_sample(*unlimited, 1, 50);
  EXPECT_EQ(unlimited->counters().sent, 1000U);
  EXPECT_LT(node.receive_all().size(), 1000U) << "the buffer holds everything: the test above proves nothing";
}

// A virtual interface has no controller: an error frame that a node sends reaches the others as one.
TEST_F(Can, ErrorFramesPassAVirtualInterface) {
  const auto receiver = open(own), sender = open(own);
  SampleFrames frames;
  frames.add({.id = CAN_ERR_PROT | CAN_ERR_BUSERROR, .error = true}, CAN_ERR_DLC);
  frames.add({.id = 0x123}, 8);
  sender->send(frames);
  EXPECT_EQ(sender->counters().sent, 2U);
  const auto error = receive_next(*receiver);
  ASSERT_TRUE(error);
  EXPECT_TRUE(error->frame.can.error);
  EXPECT_EQ(error->frame.can.id, unsigned{CAN_ERR_PROT | CAN_ERR_BUSERROR});
  EXPECT_EQ(receiver->counters().bus_errors, 1U);
  const auto data = receive_next(*receiver);
  ASSERT_TRUE(data);
  EXPECT_FALSE(data->frame.can.error);
}

}  // namespace
}  // namespace imud
