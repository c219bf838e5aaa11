#include <arpa/inet.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>

#include "tests/transports/port_error.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {
namespace {

int option(int socket, int level, int name) {
  int value = -1;
  socklen_t size = sizeof value;
  EXPECT_EQ(::getsockopt(socket, level, name, &value, &size), 0);
  return value;
}

TEST(Tcp, Port0IsAFreeOneThatIsNamed) {
  for (const std::string spec : {"tcp-listen:127.0.0.1:0", "tcp-listen:[::1]:0"}) {
    for (const Role role : {Role::listener, Role::device}) {
      const auto listener = open_port(spec, role), other = open_port(spec, role);
      EXPECT_TRUE(listener->chosen_port().starts_with(spec.substr(0, spec.rfind(':') + 1)))
          << listener->chosen_port();
      EXPECT_NE(listener->chosen_port(), other->chosen_port());
      EXPECT_TRUE(mentions(error_of(listener->chosen_port(), role), "another process does"));
      const auto peer = open_port("tcp" + listener->chosen_port().substr(listener->chosen_port().find(':')), role);
      EXPECT_EQ(peer->chosen_port(), "");
    }
  }
}

TEST(Tcp, FramesLeaveAtOnceAndAVanishedPeerIsFound) {
  const auto listener = open_port("tcp-listen:127.0.0.1:0", Role::listener);
  const auto device =
      open_port("tcp" + listener->chosen_port().substr(listener->chosen_port().find(':')), Role::device);
  for (int i = 0; i < 5000 && (device->state() != PortState::ready || listener->state() != PortState::ready); ++i) {
    device->flush();
    listener->flush();
    ::poll(nullptr, 0, 2);
  }
  for (const Port* port : {device.get(), listener.get()}) {
    ASSERT_EQ(port->state(), PortState::ready);
    EXPECT_EQ(option(port->descriptor(), IPPROTO_TCP, TCP_NODELAY), 1);
    EXPECT_EQ(option(port->descriptor(), SOL_SOCKET, SO_KEEPALIVE), 1);
    EXPECT_LE(option(port->descriptor(), IPPROTO_TCP, TCP_KEEPIDLE) +
                  option(port->descriptor(), IPPROTO_TCP, TCP_KEEPINTVL) *
                      option(port->descriptor(), IPPROTO_TCP, TCP_KEEPCNT),
              15);
  }
}

// Nothing listens at a port that is free; no attempt is an error, nor is it a loss.
TEST(Tcp, APeerThatIsNotThereIsWaitedFor) {
  const FileDescriptor bound(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  ASSERT_EQ(::bind(bound.get(), reinterpret_cast<const sockaddr*>(&address), size), 0);
  ::getsockname(bound.get(), reinterpret_cast<sockaddr*>(&address), &size);
  const auto port = open_port(fmt::format("tcp:127.0.0.1:{}", ntohs(address.sin_port)), Role::listener);
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(port->receive(), std::nullopt);
    EXPECT_EQ(port->state(), PortState::no_reader);
    EXPECT_EQ(port->descriptor(), -1);
    ::poll(nullptr, 0, 2);
  }
  EXPECT_EQ(port->counters().lost_count, 0U);
  ASSERT_EQ(::listen(bound.get(), 1), 0);
  for (int i = 0; i < 30'000 && port->state() != PortState::ready; ++i) {
    port->receive();
    ::poll(nullptr, 0, 2);
  }
  EXPECT_EQ(port->state(), PortState::ready);
}

TEST(Tcp, ErrorsNameWhatWouldBeRight) {
  EXPECT_TRUE(mentions(error_of("tcp:127.0.0.1:0"), "right would be the other end's, from 1 to 65535"));
  EXPECT_TRUE(mentions(error_of("tcp:239.1.2.3:9810"), "right would be the address of one machine"));
  EXPECT_TRUE(mentions(error_of("tcp-listen:[ff12::1]:9810"), "right would be an address of this machine"));
  EXPECT_TRUE(mentions(error_of("tcp-listen:192.0.2.1:9810"), "right would be an address of this machine"));
  EXPECT_TRUE(mentions(error_of("tcp:127.0.0.1:9810?nodelay=1"), "unknown option 'nodelay'; tcp has none"));
  for (const std::string scheme : {"tcp:", "tcp-listen:"})
    for (const std::string address :
         {"local host:1", "127.0.0.l:1", "127.0.0.1", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:-1", "::1:5",
          "[::1]", "[127.0.0.1]:1", ":9810", "-", "/tmp/x", "127.0.0.1:1:2", "[]:1"})
      EXPECT_TRUE(mentions(error_of(scheme + address), "right would be ADDR:PORT with a numeric address or a name"))
          << address;
}

// No text is harmful, and each that is refused is refused by a PortError.
TEST(Tcp, AnySpecIsOpenedOrRefused) {
  std::uint32_t random = 1;
  const auto next = [&random] { return random = random * 1664525U + 1013904223U, random >> 8; };
  constexpr std::string_view letters = "tcp-lisenux:[]%/.?=&0123456789ADF \t\xFF";
  const std::string models[] = {"tcp:127.0.0.1:9", "tcp-listen:127.0.0.1:0", "tcp:[::1]:9",
                                "unix:/nowhere/x", "unix-listen:/nowhere/x", "tcp:[fe80::1%lo]:9"};
  int opened = 0;
  for (int i = 0; i < 20'000; ++i) {
    std::string text = models[next() % std::size(models)];
    for (std::uint32_t changes = next() % 4; changes > 0; --changes) {
      const std::size_t at = next() % text.size();
      switch (next() % 3) {
        case 0:
          text[at] = letters[next() % letters.size()];
          break;
        case 1:
          text.insert(at, 1, letters[next() % letters.size()]);
          break;
        default:
          if (text.size() > 1) text.erase(at, 1);
      }
    }
    const Transport* transport = transport_of(text);
    if (transport == nullptr || !(transport->name.starts_with("tcp") || transport->name.starts_with("unix")))
      continue;
    for (const Role role : {Role::device, Role::listener}) try {
        check_port(*transport, PortSpec::parse(text), role);
        ++opened;
      } catch (const PortError& error) {
        EXPECT_NE(std::string_view(error.what()), "") << text;
      }
  }
  EXPECT_GT(opened, 1000);
}

}  // namespace
}  // namespace imud
