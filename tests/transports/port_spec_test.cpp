#include "transports/port_spec.hpp"

#include <gtest/gtest.h>

#include "tests/transports/port_error.hpp"

namespace imud {
namespace {

template <class Action>
std::string message_of(Action action) {
  try {
    action();
  } catch (const PortError& error) {
    return error.what();
  }
  return {};
}

TEST(PortSpec, IsTakenApart) {
  const PortSpec spec = PortSpec::parse("serial:/dev/ttyUSB0?baud=921600&parity=even");
  EXPECT_EQ(spec.scheme, "serial");
  EXPECT_EQ(spec.address, "/dev/ttyUSB0");
  EXPECT_EQ(spec.integer("baud", 50, 4'000'000), 921600);
  EXPECT_EQ(spec.text("parity"), "even");
  EXPECT_EQ(spec.integer("stop", 1, 2), std::nullopt);
  EXPECT_EQ(spec.text("flow"), std::nullopt);
}

TEST(PortSpec, AddressMayHoldColons) {
  EXPECT_EQ(PortSpec::parse("udp:[::1]:9810").address, "[::1]:9810");
  EXPECT_TRUE(PortSpec::parse("udp:[::1]:9810").options.empty());
}

TEST(PortSpec, RefusesWhatHasNotTheForm) {
  for (const char* text : {"", "udp", ":", "udp:", ":127.0.0.1", "udp:?x=1", "file:a?", "file:a?x", "file:a?=1",
                           "file:a?x=", "file:a?x=1&", "file:a?x=1&x=2"}) {
    const std::string message = message_of([&] { PortSpec::parse(text); });
    EXPECT_TRUE(mentions(message, std::string("'") + text + "'")) << text;
    EXPECT_TRUE(mentions(message, "scheme:address")) << text;
  }
}

TEST(PortSpec, IntegerIsWholeAndWithinItsRange) {
  const PortSpec spec = PortSpec::parse("x:y?a=12&b=12.5&c=-3&d=99999999999999999999&e=0x10&f=+1");
  EXPECT_EQ(spec.integer("a", 12, 12), 12);
  EXPECT_EQ(spec.integer("c", -3, 0), -3);
  for (const char* key : {"b", "d", "e", "f"})
    EXPECT_TRUE(mentions(message_of([&] { spec.integer(key, 0, 100); }), "right would be an integer from 0 to 100"));
  EXPECT_TRUE(mentions(message_of([&] { spec.integer("a", 0, 11); }), "a=12"));
  EXPECT_TRUE(mentions(message_of([&] { spec.integer("a", 13, 20); }), "from 13 to 20"));
}

TEST(PortSpec, OneOfTakesTheFirstByDefault) {
  const PortSpec spec = PortSpec::parse("x:y?parity=odd&flow=xon");
  EXPECT_EQ(spec.one_of("parity", "none even odd"), "odd");
  EXPECT_EQ(spec.one_of("other", "none even odd"), "none");
  EXPECT_EQ(message_of([&] { spec.one_of("flow", "none rtscts"); }),
            "x:y: flow=xon: right would be one of: none rtscts");
}

TEST(PortSpec, UnknownOptionIsNamedWithThoseThereAre) {
  const PortSpec spec = PortSpec::parse("serial:/dev/ttyS0?baud=1&bauds=2");
  constexpr PortOption known[] = {{"baud", ""}, {"bauds", "", 0, 0, {}, true}};
  EXPECT_EQ(message_of([&] { spec.allow_only(known, false); }),
            "serial:/dev/ttyS0: unknown option 'bauds'; serial knows: baud");
  EXPECT_EQ(message_of([&] { spec.allow_only({}, true); }),
            "serial:/dev/ttyS0: unknown option 'baud'; serial has none");
  EXPECT_NO_THROW(spec.allow_only(known, true));
}

TEST(PortSpec, ValuesOfOptionsAreInTheirRanges) {
  constexpr PortOption known[] = {
      {"rate", "", 1, 10, "unlimited"}, {"stop", "", 1, 2}, {"flow", "", 0, 0, "none xon"}};
  const auto allow = [&](const std::string& options) { PortSpec::parse("x:y" + options).allow_only(known, true); };
  for (const std::string good : {"", "?rate=10", "?rate=unlimited", "?stop=1&flow=xon&rate=1", "?flow=none"})
    EXPECT_NO_THROW(allow(good)) << good;
  for (const std::string bad : {"?rate=0", "?rate=11", "?rate=unlimite", "?stop=3", "?stop=one", "?flow=no"})
    EXPECT_THROW(allow(bad), PortError) << bad;
}

TEST(NumericAddress, TakesNumericAddressesOfBothKinds) {
  EXPECT_EQ(NumericAddress::parse("127.0.0.1:9810").address, "127.0.0.1");
  EXPECT_EQ(NumericAddress::parse("127.0.0.1:9810").port, 9810);
  EXPECT_EQ(NumericAddress::parse("[::1]:1").address, "::1");
  EXPECT_EQ(NumericAddress::parse("[fe80::1%eth0]:65535").address, "fe80::1%eth0");
  EXPECT_EQ(NumericAddress::parse("[fe80::1%eth0]:65535").port, 65535);
}

TEST(NumericAddress, KnowsLoopbackAddresses) {
  for (const char* text : {"127.0.0.1:1", "127.1.2.3:0", "[::1]:1", "[0:0::1]:1"})
    EXPECT_TRUE(NumericAddress::parse(text).is_loopback()) << text;
  for (const char* text : {"0.0.0.0:1", "12.7.0.1:1", "[::]:1", "[fe80::1%lo]:1", "[::ffff:127.0.0.1]:1"})
    EXPECT_FALSE(NumericAddress::parse(text).is_loopback()) << text;
  EXPECT_FALSE(NumericAddress::try_parse("localhost:1"));
}

TEST(NumericAddress, RefusesTheRestAndNamesTheRemedy) {
  for (const char* text : {"", "127.0.0.1", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:-1", "localhost:1",
                           "127.0.0.1:1x", "::1:9810", "[]:1", "[::1]", "[127.0.0.1]:1", "127.0.0.256:1", ":9810"})
    EXPECT_TRUE(mentions(message_of([&] { NumericAddress::parse(text); }), "127.0.0.1:9810")) << text;
}

TEST(OpenPort, UnknownTransportIsNamedWithThoseThereAre) {
  const std::string message = error_of("rs232:/dev/ttyS0");
  EXPECT_TRUE(mentions(message, "rs232"));
  for (const Transport* transport : transports()) {
    EXPECT_TRUE(mentions(message, std::string(transport->name) + ":"));
    EXPECT_TRUE(transport->syntax.starts_with(std::string(transport->name) + ":"));
    EXPECT_FALSE(transport->summary.empty());
    EXPECT_FALSE(transport->document.empty());
    EXPECT_EQ(find_transport(transport->name), transport);
  }
}

TEST(OpenPort, EveryTransportRefusesAnUnknownOption) {
  for (const Transport* transport : transports()) {
    const std::string spec = std::string(transport->name) + ":x?no_such_option=1";
    for (const Role role : {Role::device, Role::listener})
      EXPECT_TRUE(mentions(error_of(spec, role), "unknown option 'no_such_option'")) << spec;
  }
}

}  // namespace
}  // namespace imud
