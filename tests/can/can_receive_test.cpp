// The frames that a port receives: filters, and the confirmation of its own frames. Runs in tools/with-vcan.
#include <linux/can/error.h>
#include <poll.h>

#include <initializer_list>
#include <vector>

#include "tests/can/can_bus.hpp"

namespace imud {
namespace {

constexpr canid_t remote = CAN_RTR_FLAG, extended = CAN_EFF_FLAG, error = CAN_ERR_FLAG | CAN_ERR_CRTL;

class CanFilters : public Can {
 protected:
  // The identifiers, as sent, of the frames of `sent` that the port receives.
  std::vector<canid_t> received(std::initializer_list<canid_t> sent) {
    for (const canid_t id : sent) node_->send(id, {});
    node_->send(CAN_ERR_FLAG | CAN_ERR_PROT, {});  // error frames pass every filter: it marks the end
    std::vector<canid_t> all;
    while (const auto got = receive_next(*port_)) {
      const CanHeader& can = got->frame.can;
      if (can.error && can.id == CAN_ERR_PROT) return all;
      all.push_back(can.id | (can.extended ? CAN_EFF_FLAG : 0) | (can.remote ? CAN_RTR_FLAG : 0) |
                    (can.error ? CAN_ERR_FLAG : 0));
    }
    ADD_FAILURE() << "the last frame did not come";
    return all;
  }
  using Ids = std::vector<canid_t>;

  void SetUp() override {
    Can::SetUp();
    node_.emplace(own);
    port_ = open(own);
  }
  std::optional<Node> node_;
  std::unique_ptr<Port> port_;
};

TEST_F(CanFilters, WithoutAnyEverythingPasses) {
  EXPECT_EQ(received({0x123, 0x123 | extended, 0x123 | remote, error}),
            (Ids{0x123, 0x123 | extended, 0x123 | remote, error}));
}

TEST_F(CanFilters, WithNoneOnlyErrorFramesPass) {
  port_->set_filters({});
  EXPECT_EQ(received({0x123, 0x123 | extended, 0x123 | remote, error}), (Ids{error}));
}

TEST_F(CanFilters, AnIdentifier) {
  const CanFilter filters[] = {{.id = 0x123}, {.id = 0x18EA80F9, .extended = true}, {.id = 0x321}};
  port_->set_filters(filters);
  EXPECT_EQ(received({0x123, 0x122, 0x321, 0x123 | extended, 0x123 | remote, 0x18EA80F9 | extended, 0x0F9,
                      0x18EA80F8 | extended, 0x18EA80F9 | extended | remote, error}),
            (Ids{0x123, 0x321, 0x18EA80F9 | extended, error}));
}

TEST_F(CanFilters, AMask) {
  const CanFilter filters[] = {{.id = 0x700, .mask = 0x780}, {.id = 0xEA0000, .mask = 0xFF0000, .extended = true}};
  port_->set_filters(filters);
  EXPECT_EQ(received({0x700, 0x77F, 0x780, 0x6FF, 0x18EA80F9 | extended, 0x00EA0000 | extended, 0x18EB80F9 | extended,
                      0x700 | extended}),
            (Ids{0x700, 0x77F, 0x18EA80F9 | extended, 0x00EA0000 | extended}));
}

TEST_F(CanFilters, RemoteRequests) {
  const CanFilter requests[] = {{.id = 0x181, .data = false, .remote = true}};
  port_->set_filters(requests);
  EXPECT_EQ(received({0x181, 0x181 | remote, 0x182 | remote, 0x181 | extended | remote}), (Ids{0x181 | remote}));
  const CanFilter both[] = {{.id = 0x181, .remote = true}};
  port_->set_filters(both);
  EXPECT_EQ(received({0x181, 0x181 | remote, 0x182}), (Ids{0x181, 0x181 | remote}));
}

TEST_F(CanFilters, Inverted) {
  const CanFilter filters[] = {{.id = 0x100, .mask = 0x700, .inverted = true}};
  port_->set_filters(filters);
  EXPECT_EQ(received({0x100, 0x1FF, 0x200, 0x100 | extended, 0x100 | remote}),
            (Ids{0x200, 0x100 | extended, 0x100 | remote}));
}

TEST_F(CanFilters, HoldAfterTheInterfaceWasRemoved) {
  const CanFilter filters[] = {{.id = 0x123}};
  port_->set_filters(filters);
  ASSERT_TRUE(ip(fmt::format("link del {}", own)));
  send_sample(*port_, 1);
  ASSERT_EQ(port_->state(), PortState::lost);
  make_own();
  wait_until_back(*port_);
  node_.emplace(own);
  EXPECT_EQ(received({0x123, 0x124}), (Ids{0x123}));
}

TEST_F(CanFilters, AsManyAsThereIsRoomForAndMore) {
  std::vector<CanFilter> filters;
  for (std::uint32_t id = 0; id < 64; ++id) filters.push_back({.id = id});
  port_->set_filters(filters);
  EXPECT_EQ(received({0, 63, 64}), (Ids{0, 63}));
  filters.push_back({.id = 64});
  port_->set_filters(filters);
  EXPECT_EQ(received({0, 64, 0x123}), (Ids{0, 64, 0x123})) << "everything passes";
}

// --- The port's own frames

// Lets the port receive until nothing more arrives; expects nothing but confirmations.
void collect_confirmations(Port& port) {
  pollfd ready{port.descriptor(), POLLIN, 0};
  while (::poll(&ready, 1, 200) == 1) EXPECT_EQ(port.receive(), std::nullopt);
}

std::size_t confirmed(Port& port) {
  std::size_t count = 0;
  while (port.next_confirmation()) ++count;
  return count;
}

TEST_F(Can, OwnFramesAreConfirmedAndNotReceived) {
  const Node node("vcan0");
  const auto port = open("vcan0?confirm=yes");
  const HostTime before = host_now();
  send_sample(*port, 1, 2);
  node.send(0x055, {1});
  SampleFrames sample;
  port->send(sample.add({.id = 0x1ABCDEF, .extended = true}, 8).add({.id = 0x7F, .fd = true}, 12));
  const auto received = receive_next(*port);
  ASSERT_TRUE(received.has_value());
  EXPECT_EQ(received->frame.can.id, 0x055U);
  EXPECT_EQ(port->receive(), std::nullopt);
  const HostTime after = host_now();
  EXPECT_EQ(port->counters().received, 1U);
  HostTime last = before - 20ms;  // the guest's stamps have the resolution of its tick
  for (const std::uint32_t id : {0x100U, 0x101U, 0x1ABCDEFU, 0x7FU}) {
    const auto confirmation = port->next_confirmation();
    ASSERT_TRUE(confirmation.has_value());
    EXPECT_EQ(confirmation->can.id, id);
    EXPECT_EQ(confirmation->can.extended, id == 0x1ABCDEF);
    EXPECT_EQ(confirmation->can.fd, id == 0x7F);
    EXPECT_GE(confirmation->time, last);
    EXPECT_LE(confirmation->time, after);
    last = confirmation->time - 20ms;
  }
  EXPECT_EQ(port->next_confirmation(), std::nullopt);
}

TEST_F(Can, TheLatestConfirmationsAreKept) {
  const auto port = open("vcan0?confirm=yes");
  for (std::uint8_t i = 0; i < 2; ++i) send_sample(*port, i, 50);
  collect_confirmations(*port);
  std::vector<std::uint32_t> ids;
  while (const auto confirmation = port->next_confirmation()) ids.push_back(confirmation->can.id);
  ASSERT_EQ(ids.size(), Port::max_confirmations);
  EXPECT_EQ(ids.front(), 0x100 + 36U);
  EXPECT_EQ(ids.back(), 0x100 + 49U);
}

TEST_F(Can, OwnFramesAreConfirmedIfTheyPassTheFilters) {
  const auto port = open("vcan0?confirm=yes");
  const CanFilter filters[] = {{.id = 0x101}};
  port->set_filters(filters);
  send_sample(*port, 1, 3);
  collect_confirmations(*port);
  EXPECT_EQ(confirmed(*port), 1U);
}

TEST_F(Can, WithoutConfirmationOwnFramesDoNotComeBack) {
  const auto port = open("vcan0");
  send_sample(*port, 1, 3);
  pollfd ready{port->descriptor(), POLLIN, 0};
  EXPECT_EQ(::poll(&ready, 1, 100), 0);
  EXPECT_EQ(port->receive(), std::nullopt);
  EXPECT_EQ(confirmed(*port), 0U);
}

// Two units on one bus in the same process: the frames of the other one are not taken for an echo.
TEST_F(Can, AnotherPortsFramesWithTheSameIdentifierAreReceived) {
  const auto port = open("vcan0?confirm=yes");
  const auto other = open("vcan0?confirm=yes");
  send_sample(*other, 9);
  const auto received = receive_next(*port);
  ASSERT_TRUE(received.has_value());
  EXPECT_EQ(received->frame.can.id, 0x100U);
  EXPECT_EQ(confirmed(*port), 0U);
}

TEST_F(Can, ARealDriversFramesAreConfirmed) {
  LineController controller;
  ASSERT_TRUE(ip(fmt::format("link set {} txqueuelen 100 up type can bitrate 500000", controller.name)));
  const auto port = open(controller.name + "?confirm=yes");
  send_sample(*port, 1, 50);
  ASSERT_TRUE(drain(*port));
  EXPECT_EQ(controller.frames(50U), 50U);
  collect_confirmations(*port);
  EXPECT_EQ(confirmed(*port), 50U);
}

// A driver that echoes frames itself, as vcan does with echo=1 (WITH_VCAN_ECHO=1), does so after it has sent them;
// otherwise the kernel echoes them when the interface's queue accepts them.
TEST_F(Can, FramesInTheInterfacesQueueAreConfirmedAsTheDriverDoes) {
  ASSERT_TRUE(run_command(fmt::format("tc qdisc add dev {} root netem delay 200s limit 100", own)));
  const auto port = open(std::string(own) + "?confirm=yes");
  send_sample(*port, 2, 3);
  EXPECT_EQ(port->counters().sent, 3U);
  collect_confirmations(*port);
  EXPECT_EQ(confirmed(*port), run_command("grep -q Y /sys/module/vcan/parameters/echo") ? 0U : 3U);
}

TEST_F(Can, ArrivalIsStampedByTheKernel) {
  const Node node("vcan0");
  const auto port = open("vcan0");
  const HostTime before = host_now();
  node.send(0x123, {1});
  pollfd ready{port->descriptor(), POLLIN, 0};
  ASSERT_EQ(::poll(&ready, 1, 5000), 1);
  const HostTime there = host_now();
  std::this_thread::sleep_for(200ms);
  const auto received = port->receive();
  ASSERT_TRUE(received.has_value());
  EXPECT_GE(received->time, before - 20ms);
  EXPECT_LE(received->time, there + 20ms) << "when it came, not when it was read";
}

}  // namespace
}  // namespace imud
