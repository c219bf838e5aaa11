// Addresses with a name in place of numbers: getaddrinfo(3).
#include "transports/socket/host_address.hpp"

#include <gtest/gtest.h>

#include "tests/support/text.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

std::string error_of(const std::string& text) {
  try {
    static_cast<void>(HostAddress::parse(text).numeric());
  } catch (const PortError& error) {
    return error.what();
  }
  return {};
}

TEST(HostAddress, NumbersStayAndLocalhostIsIPv4) {
  const std::pair<std::string, std::string> addresses[] = {
      {"127.0.0.1:9810", "127.0.0.1"}, {"[::1]:9810", "::1"}, {"localhost:9810", "127.0.0.1"}};
  for (const auto& [text, numeric] : addresses) {
    const NumericAddress found = HostAddress::parse(text).numeric();
    EXPECT_EQ(found.address, numeric);
    EXPECT_EQ(found.port, 9810);
  }
}

TEST(HostAddress, ANameIsLookedUpOnlyIfAsked) {
  const HostAddress address = HostAddress::parse("no-such-host.invalid:80");  // RFC 2606, section 2
  EXPECT_TRUE(address.is_name);
  EXPECT_EQ(address.port, 80);
  EXPECT_THROW(static_cast<void>(address.numeric()), PortError);
}

TEST(HostAddress, FaultsNameWhatWouldBeRight) {
  EXPECT_TRUE(contains(error_of("no-such-host.invalid:80"), "there is no host \"no-such-host.invalid\" ("));
  EXPECT_TRUE(
      contains(error_of("no-such-host.invalid:80"), "right would be its address, or a name that this machine"));
  for (const std::string text : {"127.0.0.l:9", "27.0.0.l:9", "a..b:9", "-a:9", "a-:9", "a b:9", ":9", "host",
                                 "host:", "host:x", "host:65536", "[localhost]:9", "a.1:9"})
    EXPECT_TRUE(contains(error_of(text), "right would be ADDR:PORT with a numeric address or a name")) << text;
  EXPECT_TRUE(contains(error_of(std::string(300, 'a') + ":9"), "no name of a host"));
}

TEST(HostAddress, AFrameGoesToAName) {
  const auto listener = open_port("udp:localhost:0", Role::listener);
  const std::string chosen = listener->chosen_port();
  ASSERT_TRUE(chosen.starts_with("udp:localhost:")) << chosen;
  const auto device = open_port(chosen, Role::device);
  const std::byte byte{1};
  const Frame frame{{&byte, 1}};
  device->send({&frame, 1});
  const auto received = listener->receive();
  ASSERT_TRUE(received.has_value());
  EXPECT_EQ(received->frame.bytes.size(), 1U);
}

}  // namespace
}  // namespace imud
