// What all streams by a socket have in common, with a device's port at one end and a listener's at the other.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>

#include <chrono>
#include <csignal>
#include <functional>
#include <thread>

#include "tests/support/allocations.hpp"
#include "tests/transports/numbered_frames.hpp"
#include "tests/transports/port_error.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

// Calls `condition` until it is true, for up to a minute.
bool soon(const std::function<bool()>& condition) {
  for (int i = 0; i < 30'000; ++i) {
    if (condition()) return true;
    std::this_thread::sleep_for(2ms);
  }
  return false;
}

// The two ends of a kind of stream.
struct Ends {
  const char* name;
  std::string (*listening)(const ScratchFolder& folder);
  const char* connecting;  // the scheme
};

class StreamSockets : public ::testing::TestWithParam<Ends> {
 protected:
  void listen(const PortSettings& settings = Role::listener) {
    server = open_listener(GetParam().listening(folder), settings);
  }
  std::unique_ptr<Port> open_listener(const std::string& spec, const PortSettings& settings) {
    auto port = open_port(spec, settings);
    address = spec.substr(spec.find(':') + 1);
    if (const std::string chosen = port->chosen_port(); !chosen.empty())
      address = chosen.substr(chosen.find(':') + 1);
    return port;
  }
  std::unique_ptr<Port> connect(const PortSettings& settings = Role::device) const {
    return open_port(std::string(GetParam().connecting) + ":" + address, settings);
  }
  // Connects, and waits until both ends know it.
  void join() {
    if (!client) client = connect();
    ASSERT_TRUE(soon([&] {
      client->flush();
      server->flush();
      return client->state() == PortState::ready && server->state() == PortState::ready;
    }));
  }
  static void receive_all(Port& port, NumberedReader& reader) {
    while (const auto received = port.receive()) reader.feed(received->frame.bytes);
  }
  static std::vector<std::uint32_t> up_to(std::uint32_t end) {
    std::vector<std::uint32_t> all(end);
    for (std::uint32_t i = 0; i < end; ++i) all[i] = i;
    return all;
  }

  ScratchFolder folder;
  std::string address;
  std::unique_ptr<Port> server, client;
  NumberedFrames frames;
  NumberedReader reader;
};

INSTANTIATE_TEST_SUITE_P(
    All, StreamSockets,
    ::testing::Values(Ends{"Tcp", [](const ScratchFolder&) { return std::string("tcp-listen:127.0.0.1:0"); }, "tcp"},
                      Ends{"Tcp6", [](const ScratchFolder&) { return std::string("tcp-listen:[::1]:0"); }, "tcp"},
                      Ends{"Unix", [](const ScratchFolder& folder) { return "unix-listen:" + folder / "socket"; },
                           "unix"}),
    [](const auto& kind) { return std::string(kind.param.name); });

TEST_P(StreamSockets, WholeFramesInOrderBothWays) {
  listen();
  EXPECT_EQ(server->state(), PortState::no_reader);
  join();
  for (const auto& ends : {std::pair(client.get(), server.get()), std::pair(server.get(), client.get())}) {
    Port *const from = ends.first, *const to = ends.second;
    NumberedFrames sent;
    NumberedReader received;
    from->send(sent.next(20));
    from->reply(sent.next(3));
    ASSERT_TRUE(soon([&] {
      receive_all(*to, received);
      return received.numbers.size() == 23;
    }));
    EXPECT_EQ(received.numbers, up_to(23));
    EXPECT_EQ(received.broken + received.unfinished(), 0U);
    EXPECT_EQ(from->counters().sent, 23U);
    EXPECT_EQ(from->counters().replies, 3U);
    EXPECT_EQ(from->counters().dropped, 0U);
    EXPECT_GT(to->counters().received, 0U);
    EXPECT_FALSE(to->at_end());
  }
}

TEST_P(StreamSockets, FramesBeforeThePeerIsThereAreDropped) {
  listen();
  server->send(frames.next(5));
  EXPECT_EQ(server->counters().dropped, 5U);
  EXPECT_EQ(server->receive(), std::nullopt);
  join();
  client->send(frames.next(2));
  ASSERT_TRUE(soon([&] {
    receive_all(*server, reader);
    return reader.numbers.size() == 2;
  }));
  EXPECT_EQ(reader.numbers, (std::vector<std::uint32_t>{5, 6}));
}

TEST_P(StreamSockets, AReaderThatStopsLosesWholeFrames) {
  listen();
  join();
  for (int i = 0; i < 100'000 && client->counters().dropped < 100; ++i) client->send(frames.next(10));
  EXPECT_GE(client->counters().dropped, 100U);
  EXPECT_FALSE(client->is_drained());
  ASSERT_TRUE(soon([&] {
    receive_all(*server, reader);
    return client->is_drained() && reader.numbers.size() == client->counters().sent;
  }));
  const std::uint32_t last = frames.made();
  client->send(frames.next(1));
  ASSERT_TRUE(soon([&] {
    receive_all(*server, reader);
    return !reader.numbers.empty() && reader.numbers.back() == last;
  }));
  EXPECT_EQ(reader.broken + reader.unfinished(), 0U);
  EXPECT_EQ(reader.numbers.size(), client->counters().sent);
  EXPECT_EQ(client->counters().sent + client->counters().dropped, frames.made());
  EXPECT_EQ(client->counters().lost_count, 0U);
}

TEST_P(StreamSockets, APeerThatLeavesAndReturns) {
  listen();
  for (std::uint64_t times = 1; times <= 3; ++times) {
    join();
    client->send(frames.next(4));
    client.reset();
    NumberedReader each;
    ASSERT_TRUE(soon([&] {
      receive_all(*server, each);
      return server->counters().lost_count == times;
    }));
    EXPECT_EQ(each.numbers.size(), 4U) << "all that was sent before is received";
    EXPECT_EQ(each.broken + each.unfinished(), 0U);
    EXPECT_EQ(server->state(), PortState::no_reader);
    EXPECT_EQ(server->receive(), std::nullopt);
  }
}

TEST_P(StreamSockets, AServerThatEndsAndReturns) {
  listen();
  join();
  const std::string at =
      GetParam().connecting == std::string("tcp") ? "tcp-listen:" + address : "unix-listen:" + address;
  for (std::uint64_t times = 1; times <= 2; ++times) {
    server->send(frames.next(4));
    server.reset();
    NumberedReader each;
    ASSERT_TRUE(soon([&] {
      receive_all(*client, each);
      return client->state() == PortState::lost;
    }));
    EXPECT_EQ(each.numbers.size(), 4U);
    EXPECT_EQ(client->counters().lost_count, times);
    EXPECT_EQ(client->descriptor(), -1);
    client->send(frames.next(3));
    EXPECT_EQ(client->counters().dropped, 3 * times);
    server = open_listener(at, Role::listener);
    const auto back = std::chrono::steady_clock::now();
    join();
    EXPECT_LT(std::chrono::steady_clock::now() - back, 30s);
  }
}

// What the peer has sent is received although it does not receive any more; SIGPIPE would end this process.
TEST_P(StreamSockets, AFailureToSendLosesNoInput) {
  const auto before = std::signal(SIGPIPE, SIG_DFL);
  listen();
  join();
  client->send(frames.next(30));
  client.reset();
  NumberedFrames answers;
  for (int i = 0; i < 10; ++i) {
    server->send(answers.next(1));
    std::this_thread::sleep_for(2ms);
  }
  EXPECT_GT(server->counters().dropped, 0U);
  EXPECT_EQ(server->counters().lost_count, 0U);
  ASSERT_TRUE(soon([&] {
    receive_all(*server, reader);
    return server->counters().lost_count == 1;
  }));
  EXPECT_EQ(reader.numbers.size(), 30U);
  std::signal(SIGPIPE, before);
}

// A sender that never receives finds the loss, too.
TEST_P(StreamSockets, ASenderConnectsAgain) {
  listen();
  join();
  server->send(frames.next(3));  // which the client never receives
  const std::string at =
      GetParam().connecting == std::string("tcp") ? "tcp-listen:" + address : "unix-listen:" + address;
  server.reset();
  server = open_listener(at, Role::listener);
  ASSERT_TRUE(soon([&] {
    client->send(frames.next(1));
    receive_all(*server, reader);
    return !reader.numbers.empty();
  }));
  EXPECT_EQ(client->counters().lost_count, 1U);
  EXPECT_EQ(reader.broken, 0U);
}

TEST_P(StreamSockets, OnePeerAtATime) {
  listen();
  join();
  const auto second = connect();
  ASSERT_TRUE(soon([&] {
    second->receive();
    EXPECT_EQ(server->receive(), std::nullopt);
    return second->counters().lost_count > 0;
  }));
  EXPECT_GT(server->counters().connections_refused, 0U);
  client->send(frames.next(2));
  ASSERT_TRUE(soon([&] {
    receive_all(*server, reader);
    return reader.numbers.size() == 2;
  }));
  EXPECT_EQ(server->counters().lost_count, 0U);
  client.reset();
  ASSERT_TRUE(soon([&] {  // now the second one is the peer
    second->receive();
    server->receive();
    return server->state() == PortState::ready && second->state() == PortState::ready;
  }));
}

// A simulator that was started again while the input of the one before is still waiting.
TEST_P(StreamSockets, TheNextPeerWaitsUntilTheInputOfTheLastIsReceived) {
  listen();
  join();
  for (int i = 0; i < 4; ++i) client->send(frames.next(50));
  client.reset();
  client = connect();
  ASSERT_TRUE(soon([&] {
    client->send(frames.next(1));
    return client->state() == PortState::ready && client->counters().sent > 0;
  }));
  ASSERT_TRUE(soon([&] {
    receive_all(*server, reader);
    return !reader.numbers.empty() && reader.numbers.back() == frames.made() - 1;
  }));
  EXPECT_EQ(reader.broken, 0U);
  EXPECT_EQ(reader.numbers.size(), 200 + client->counters().sent);
  EXPECT_EQ(server->counters().connections_refused, 0U);
}

TEST_P(StreamSockets, NothingIsAllocated) {
  listen();
  join();
  const auto use = [&] {
    const std::uint64_t before = allocations();
    for (int i = 0; i < 200; ++i) {
      for (Port* port : {server.get(), client.get()}) {
        port->send(frames.next(5));
        port->receive();
        port->flush();
      }
    }
    EXPECT_EQ(allocations(), before);
  };
  use();
  server.reset();
  const std::uint64_t before = allocations();
  ASSERT_TRUE(soon([&] { return !client->receive() && client->state() == PortState::lost; }));
  for (int i = 0; i < 200; ++i) client->send(frames.next(1));
  EXPECT_EQ(allocations(), before);
}

TEST_P(StreamSockets, ADeviceReceivesLittleAtATime) {
  listen(Role::device);
  join();
  client->send(frames.next(40));
  ASSERT_TRUE(soon([&] {
    while (const auto received = server->receive()) {
      EXPECT_LE(received->frame.bytes.size(), 256U);
      reader.feed(received->frame.bytes);
    }
    return reader.numbers.size() == 40;
  }));
}

}  // namespace
}  // namespace imud
