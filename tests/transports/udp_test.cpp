#include <arpa/inet.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <fstream>

#include "tests/support/free_port.hpp"
#include "tests/transports/numbered_frames.hpp"
#include "tests/transports/port_error.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/host_clock.hpp"

namespace imud {
namespace {

std::string local_spec() { return fmt::format("udp:127.0.0.1:{}", free_udp_port()); }

Frame frame_of(std::string_view text) { return {std::as_bytes(std::span(text))}; }

std::string text_of(const Port::Received& received) {
  return {reinterpret_cast<const char*>(received.frame.bytes.data()), received.frame.bytes.size()};
}

TEST(Udp, AFrameIsADatagram) {
  for (const std::string& spec : {local_spec(), fmt::format("udp:[::1]:{}", free_udp_port(AF_INET6))}) {
    const auto listener = open_port(spec, Role::listener);
    const auto device = open_port(spec, Role::device);
    EXPECT_EQ(listener->receive(), std::nullopt);
    NumberedFrames frames;
    NumberedReader reader;
    const HostTime before = host_now();
    device->send(frames.next(20));
    for (int i = 0; i < 20; ++i) {
      const auto received = listener->receive();
      ASSERT_TRUE(received.has_value());
      EXPECT_LE(before, received->time);
      EXPECT_LE(received->time, host_now());
      reader.feed(received->frame.bytes);
      EXPECT_EQ(reader.unfinished(), 0U);
    }
    EXPECT_EQ(listener->receive(), std::nullopt);
    EXPECT_EQ(reader.numbers.size(), 20U);
    EXPECT_EQ(reader.broken, 0U);
    EXPECT_EQ(device->counters().sent, 20U);
    EXPECT_EQ(listener->counters().received, 20U);
    EXPECT_FALSE(listener->at_end());
  }
}

TEST(Udp, Port0IsAFreeOneThatIsNamed) {
  for (const std::string spec : {"udp:127.0.0.1:0", "udp:[::1]:0"}) {
    const auto listener = open_port(spec, Role::listener), other = open_port(spec, Role::listener);
    EXPECT_TRUE(listener->chosen_port().starts_with(spec.substr(0, spec.rfind(':') + 1))) << listener->chosen_port();
    EXPECT_NE(listener->chosen_port(), other->chosen_port());
    const auto device = open_port(listener->chosen_port(), Role::device);
    device->send({{frame_of("x")}});
    EXPECT_TRUE(listener->receive());
    EXPECT_EQ(device->chosen_port(), "");
    EXPECT_TRUE(mentions(error_of(spec, Role::device), "only a listener's port is chosen"));
  }
}

TEST(Udp, AReplyIsCountedAsOne) {
  const auto listener = open_port("udp:127.0.0.1:0", Role::listener);
  const auto device = open_port(listener->chosen_port(), Role::device);
  device->send({{frame_of("x")}});
  device->reply({{frame_of("y")}});
  device->send({{frame_of("z")}});
  EXPECT_EQ(device->counters().sent, 3U);
  EXPECT_EQ(device->counters().replies, 1U);
}

TEST(Udp, ListenerAnswersWhoSentLast) {
  const std::string spec = local_spec();
  const auto listener = open_port(spec, Role::listener);
  const auto first = open_port(spec, Role::device);
  const auto second = open_port(spec, Role::device);
  listener->send({{frame_of("to nobody")}});
  EXPECT_EQ(listener->counters().dropped, 1U);

  first->send({{frame_of("one")}});
  second->send({{frame_of("two")}});
  ASSERT_EQ(text_of(listener->receive().value()), "one");
  listener->send({{frame_of("to one")}});
  ASSERT_EQ(text_of(listener->receive().value()), "two");
  listener->send({{frame_of("to two")}});
  EXPECT_EQ(text_of(first->receive().value()), "to one");
  EXPECT_EQ(first->receive(), std::nullopt);
  EXPECT_EQ(text_of(second->receive().value()), "to two");
  EXPECT_EQ(listener->counters().sent, 2U);
}

TEST(Udp, AListenerSendsToItsPeerUntilItHasReceived) {
  const auto peer = open_port("udp:127.0.0.1:0", Role::listener),
             other = open_port("udp:127.0.0.1:0", Role::listener);
  const std::string there = peer->chosen_port().substr(4);
  const auto listener = open_port("udp:127.0.0.1:0?peer=" + there, Role::listener);
  listener->send({{frame_of("first")}});
  const auto first = peer->receive();
  ASSERT_TRUE(first);
  EXPECT_EQ(text_of(*first), "first");
  peer->send({{frame_of("answer")}});
  EXPECT_TRUE(listener->receive());
  const auto device = open_port(listener->chosen_port(), Role::device);
  device->send({{frame_of("x")}});
  EXPECT_TRUE(listener->receive());
  listener->send({{frame_of("second")}});
  EXPECT_TRUE(device->receive());
  EXPECT_FALSE(peer->receive());
  for (const auto& [options, fault] : {std::pair{"?peer=127.0.0.1:0", "peer= needs a port from 1 to 65535"},
                                       {"?peer=127.0.0.1", "ADDR:PORT"},
                                       {"?peer=[::1]:9", "one address is IPv4 and one IPv6"}})
    EXPECT_TRUE(mentions(error_of(std::string("udp:127.0.0.1:0") + options, Role::listener), fault)) << options;
  EXPECT_TRUE(mentions(error_of("udp:127.0.0.1:9?peer=127.0.0.1:9", Role::device), "peer= is for a listener"));
}

TEST(Udp, EmptyDatagramIsNotNothing) {
  const std::string spec = local_spec();
  const auto listener = open_port(spec, Role::listener);
  const auto device = open_port(spec, Role::device);
  device->send({{frame_of(""), frame_of("x")}});
  const auto received = listener->receive();
  ASSERT_TRUE(received.has_value());
  EXPECT_EQ(received->frame.bytes.size(), 0U);
  EXPECT_EQ(text_of(listener->receive().value()), "x");
}

TEST(Udp, LongestDatagramArrivesWholeAndALongerOneIsDropped) {
  const std::string spec = local_spec();
  const auto listener = open_port(spec, Role::listener);
  const auto device = open_port(spec, Role::device);
  const std::string longest(65507, 'l'), longer(65508, 'x');
  device->send({{frame_of(longer), frame_of(longest)}});
  EXPECT_EQ(text_of(listener->receive().value()), longest);
  EXPECT_EQ(listener->receive(), std::nullopt);
  EXPECT_EQ(device->counters().sent, 1U);
  EXPECT_EQ(device->counters().dropped, 1U);
  EXPECT_EQ(device->state(), PortState::ready);
}

TEST(Udp, RefusalOfEarlierFramesLosesNoLaterOnes) {
  const std::string spec = local_spec();
  const auto device = open_port(spec, Role::device);
  NumberedFrames frames;
  for (int i = 0; i < 50; ++i) device->send(frames.next(2));
  EXPECT_EQ(device->counters().sent, 100U);
  EXPECT_EQ(device->counters().dropped, 0U);
  EXPECT_EQ(device->receive(), std::nullopt);
  device->send(frames.next(1));

  const auto listener = open_port(spec, Role::listener);
  device->send(frames.next(3));
  std::size_t arrived = 0;
  while (listener->receive()) ++arrived;
  EXPECT_EQ(arrived, 3U);
}

TEST(Udp, RefusalIsNotTakenForWhatCameBack) {
  const std::string spec = local_spec();
  const auto device = open_port(spec, Role::device);
  {
    const auto listener = open_port(spec, Role::listener);
    device->send({{frame_of("a")}});
    ASSERT_TRUE(listener->receive().has_value());
    listener->send({{frame_of("answer")}});
  }
  device->send({{frame_of("b")}});  // refused: the error waits before the answer
  EXPECT_EQ(text_of(device->receive().value()), "answer");
}

TEST(Udp, AListenerNamesTheSender) {
  for (const std::string& spec : {local_spec(), fmt::format("udp:[::1]:{}", free_udp_port(AF_INET6))}) {
    const auto listener = open_port(spec, Role::listener);
    const auto first = open_port(spec, Role::device), second = open_port(spec, Role::device);
    std::vector<Endpoint> senders;
    for (Port* device : {first.get(), second.get(), first.get()}) {
      device->send({{frame_of("x")}});
      const auto received = listener->receive();
      ASSERT_TRUE(received.has_value());
      senders.push_back(received->from);
    }
    EXPECT_EQ(senders[0], senders[2]);
    EXPECT_NE(senders[0], senders[1]);
    const std::string address = spec.substr(4, spec.rfind(':') - 4);
    EXPECT_TRUE(EndpointText(senders[0]).whole().starts_with(address + ":")) << EndpointText(senders[0]).whole();
  }
}

// One system call takes two datagrams, so that the port knows of a single one that it is the last.
TEST(Udp, TheLastDatagramIsKnownAsSuch) {
  const std::string spec = local_spec();
  const auto listener = open_port(spec, Role::listener);
  const auto first = open_port(spec, Role::device), second = open_port(spec, Role::device);
  for (const std::string_view text : {"1", "2", "3"}) {
    first->send({{frame_of(text)}});
    second->send({{frame_of(text)}});
  }
  first->send({{frame_of("4")}});
  std::string texts;
  std::vector<Endpoint> senders;
  for (int i = 0; i < 7; ++i) {
    const auto received = listener->receive();
    ASSERT_TRUE(received.has_value());
    EXPECT_EQ(received->is_last, i == 6) << i;
    texts += text_of(*received);
    senders.push_back(received->from);
  }
  EXPECT_EQ(texts, "1122334");
  for (std::size_t i = 0; i < 7; ++i) EXPECT_EQ(senders[i] == senders[0], i % 2 == 0) << i;
  EXPECT_EQ(listener->receive(), std::nullopt);
  first->send({{frame_of("5")}});
  EXPECT_EQ(text_of(listener->receive().value()), "5");
}

TEST(Udp, AListenerAdmitsOneSender) {
  const std::string spec = local_spec();
  const auto device = open_port(spec, Role::device), other = open_port(spec, Role::device);
  const auto sender_of = [&](Port& sender) {
    const auto listener = open_port(spec, Role::listener);
    sender.send({{frame_of("x")}});
    return listener->receive().value().from;
  };
  const Endpoint admitted = sender_of(*device), foreign = sender_of(*other);
  PortSettings settings = Role::listener;
  settings.from = admitted;
  {
    const auto listener = open_port(spec, settings);
    other->send({{frame_of("foreign"), frame_of("foreign")}});
    device->send({{frame_of("ours")}});
    other->send({{frame_of("foreign")}});
    EXPECT_EQ(text_of(listener->receive().value()), "ours");
    EXPECT_EQ(listener->counters().foreign, 2U);
    EXPECT_EQ(listener->counters().foreign_from, foreign);
    EXPECT_EQ(listener->receive(), std::nullopt);
    EXPECT_EQ(listener->counters().foreign, 3U);
    EXPECT_EQ(listener->counters().received, 1U);
    listener->send({{frame_of("answer")}});  // to the admitted one, although the other has sent later
    EXPECT_EQ(text_of(device->receive().value()), "answer");
    EXPECT_EQ(other->receive(), std::nullopt);
  }
  settings.from->port = 0;
  const auto listener = open_port(spec, settings);
  other->send({{frame_of("of any port")}});
  EXPECT_EQ(text_of(listener->receive().value()), "of any port");
}

TEST(Udp, AMulticastGroupIsJoined) {
  const std::string group = fmt::format("udp:239.255.13.13:{}?interface=lo", free_udp_port());
  const auto listener = open_port(group, Role::listener);
  const auto second = open_port(group, Role::listener);
  const auto device = open_port(group, Role::device);
  device->send({{frame_of("to all")}});
  EXPECT_EQ(text_of(listener->receive().value()), "to all");
  EXPECT_EQ(text_of(second->receive().value()), "to all");
}

// The kernel's list of memberships: this machine may have no route for IPv6 multicast over loopback.
TEST(Udp, AnIpv6GroupIsJoined) {
  const auto memberships = [] {
    std::ifstream file("/proc/net/igmp6");
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  constexpr std::string_view address = "ff121357000000000000000000002468";
  EXPECT_FALSE(mentions(memberships(), address));
  for (const std::string text : {"udp:[ff12:1357::2468]:{}?interface=lo", "udp:[ff12:1357::2468%lo]:{}"}) {
    const auto listener = open_port(fmt::format(fmt::runtime(text), free_udp_port(AF_INET6)), Role::listener);
    EXPECT_TRUE(mentions(memberships(), address)) << memberships();
  }
}

TEST(Udp, AnInterfaceIsForMulticast) {
  EXPECT_TRUE(mentions(error_of("udp:127.0.0.1:9810?interface=lo"), "127.0.0.1 is no multicast address"));
  EXPECT_TRUE(mentions(error_of("udp:239.255.13.13:9810?interface=lo9"), "no such network interface"));
  EXPECT_TRUE(mentions(error_of("udp:239.255.13.13:9810?iface=lo"), "udp knows: interface"));
}

TEST(Udp, NamesTheCauseIfItCannotBeOpened) {
  const std::string spec = local_spec();
  const auto listener = open_port(spec, Role::listener);
  EXPECT_TRUE(mentions(error_of(spec, Role::listener), spec.substr(4)));
  EXPECT_TRUE(mentions(error_of(spec, Role::listener), "another process"));
  EXPECT_TRUE(mentions(error_of("udp:192.0.2.1:9810", Role::listener), "an address of this machine"));
  EXPECT_TRUE(mentions(error_of("udp:localhost"), "numeric"));
  EXPECT_TRUE(mentions(error_of("udp:no-such-host.invalid:9810"), "there is no host \"no-such-host.invalid\" ("));
  EXPECT_TRUE(mentions(error_of("udp:no-such-host.invalid:9810"), "right would be its address, or a name that"));
}

}  // namespace
}  // namespace imud
