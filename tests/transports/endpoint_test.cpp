#include "transports/endpoint.hpp"

#include <gtest/gtest.h>

#include <string>

#include "transports/port_spec.hpp"

namespace imud {
namespace {

TEST(Endpoint, TextAndBack) {
  for (const std::string text : {"127.0.0.1:9810", "255.255.255.255:65535", "[::1]:1", "[fe80::1:2]:40000",
                                 "[2001:db8:1111:2222:3333:4444:5555:6666]:65535"}) {
    const Endpoint endpoint = Endpoint::parse(text);
    EXPECT_EQ(EndpointText(endpoint).whole(), text);
    const std::string address(EndpointText(endpoint).address());
    EXPECT_EQ(text.find(address), text.starts_with('[') ? 1U : 0U);
    const Endpoint any_port = Endpoint::parse(address);
    EXPECT_EQ(any_port.port, 0);
    EXPECT_EQ(any_port.address, endpoint.address);
    EXPECT_TRUE(any_port.admits(endpoint));
    EXPECT_TRUE(endpoint.admits(endpoint));
    EXPECT_FALSE(endpoint.admits(any_port));
    EXPECT_FALSE(any_port.admits(Endpoint::parse("10.0.0.1:9810")));
  }
  // A socket for IPv6 reports the senders of IPv4 so.
  EXPECT_EQ(Endpoint::parse("[::ffff:10.0.0.1]:5"), Endpoint::parse("10.0.0.1:5"));
}

TEST(Endpoint, OnlyNumericAddresses) {
  for (const std::string text : {"", ":", "localhost", "1.2.3", "1.2.3.4:", "1.2.3.4:0", "1.2.3.4:65536", "[::1]",
                                 "[::1]:", "::1:x", "1.2.3.4:5:6", "1.2.3.4 "})
    EXPECT_THROW(Endpoint::parse(text), PortError) << text;
}

}  // namespace
}  // namespace imud
