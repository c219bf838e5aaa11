// These tests compare each transport with what its entry in the table declares, and see which one a file's name
// selects.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "tests/transports/capture_builder.hpp"
#include "tests/transports/port_error.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

WireTime wire_time(const std::string& port, const Frame& frame, const UartSettings& uart = {}) {
  PortSettings settings = Role::device;
  settings.uart = uart;
  const PortSpec spec = PortSpec::parse(port);
  return find_transport(spec.scheme)->wire_time(spec, settings, frame);
}

TEST(Transports, AFrameTakesTheTimeOfItsBits) {
  const std::vector<std::byte> bytes(120);
  const Frame serial{bytes}, can{std::span(bytes).first(8)};
  WireTime time = wire_time("pty:x?baud=57600&parity=odd&stop=2", serial);
  EXPECT_EQ(time.bits, 1440);
  EXPECT_EQ(time.bit_rate, 57'600);
  EXPECT_EQ(time.seconds, 0.025);
  EXPECT_EQ(wire_time("pty:x", serial, {115'200, Parity::even, 1}).bits, 1320) << "the device's UART";
  EXPECT_EQ(wire_time("pty:x", serial).bits, 1200);
  EXPECT_EQ(wire_time("pty:x", serial).seconds, 0) << "its speed is not known";
  EXPECT_EQ(wire_time("serial:x", serial).bit_rate, 115'200);
  EXPECT_EQ(wire_time("serial:x?bits=7&stop=2", serial).bits, 1200);
  EXPECT_EQ(wire_time("serial:x?baud=9600", serial).seconds, 0.125);
  EXPECT_EQ(wire_time("can:x", can).bits, 135);
  EXPECT_EQ(wire_time("can:x", can).seconds, 0);
  EXPECT_EQ(wire_time("can:x?bitrate=500000", can).average_seconds, wire_time("can:x", can).average_bits / 500e3);
  EXPECT_LT(wire_time("can:x", can).average_bits, 135);
  EXPECT_EQ(time.average_bits, 1440) << "a UART's characters are of one length";
  EXPECT_EQ(wire_time("can:x?bitrate=500000&data_bitrate=2000000", can).seconds, 135 / 500e3);
  const Frame fd{std::span(bytes).first(64), {.fd = true, .bit_rate_switch = true}};
  time = wire_time("can:x?bitrate=500000&data_bitrate=2000000", fd);
  EXPECT_EQ(time.bits, 34 + 678);
  EXPECT_DOUBLE_EQ(time.seconds, 34 / 500e3 + 678 / 2e6);
  EXPECT_DOUBLE_EQ(wire_time("can:x?bitrate=500000", fd).seconds, 712 / 500e3);
  for (const char* instant : {"udp", "file", "pcap"}) EXPECT_EQ(find_transport(instant)->wire_time, nullptr);
  EXPECT_EQ(wire_time("canfile:x?bitrate=500000", can).seconds, 135 / 500e3);
}

TEST(Transports, AFileNameFindsTheTransportOfACapture) {
  EXPECT_EQ(capture_port("flight.csv"), "file:flight.csv");
  EXPECT_EQ(capture_port("flight.txt"), "file:flight.txt");
  EXPECT_EQ(capture_port("flight.pcap?port=9810"), "pcap:flight.pcap?port=9810");
  EXPECT_EQ(capture_port("flight.pcapng"), "pcap:flight.pcapng");
  EXPECT_EQ(capture_port("flight"), "pcap:flight");
  EXPECT_EQ(capture_port("csv"), "pcap:csv");
  EXPECT_EQ(capture_port("file:x.pcap"), "file:x.pcap");
  EXPECT_EQ(capture_port("pcap:x.csv"), "pcap:x.csv");
  EXPECT_EQ(capture_port("udp:x.csv"), "file:udp:x.csv") << "it does not end: a file's name";
  EXPECT_EQ(capture_port("file"), "pcap:file");
}

// A file whose name says nothing is a capture if it is one, and otherwise text: a table of poses may have any name.
TEST(Transports, AFileWithoutAKnownSuffixIsReadAsWhatItIs) {
  const ScratchFolder folder;
  const std::string poses = folder / "pose.tum", packets = folder / "flight.dump";
  capture::write_file(poses, "0.00 0 0 0 0 0 0 1\n");
  capture::write_file(packets, capture::file_header({}, 101));
  EXPECT_EQ(capture_port(poses), "file:" + poses);
  EXPECT_EQ(capture_port(packets), "pcap:" + packets);
}

TEST(Transports, ThoseThatEndAreOpenedByListeners) {
  int captures = 0, devices = 0;
  std::string outputs;  // without CAN
  for (const Transport* transport : transports()) {
    captures += transport->ends ? 1 : 0;
    devices += transport->serves_device ? 1 : 0;
    EXPECT_TRUE(transport->ends || transport->suffixes.empty()) << transport->name;
    EXPECT_TRUE(transport->uart == Uart::none || transport->wire_time != nullptr) << transport->name;
    EXPECT_TRUE(transport->serves_device || transport->ends) << transport->name;
    const auto check_device = [&] { check_port(*transport, PortSpec::parse(transport->example), Role::device); };
    if (transport->serves_device)
      EXPECT_NO_THROW(check_device()) << transport->name;
    else
      EXPECT_THROW(check_device(), PortError) << transport->name;
    if (transport->serves_device && !transport->carries_can)
      (outputs += outputs.empty() ? "" : " or ") += transport->syntax.substr(0, transport->syntax.find('?'));
  }
  EXPECT_TRUE(outputs.starts_with("file:PATH or pty:LINK or serial:/dev/ttyUSB0 or tcp:ADDR:PORT or ")) << outputs;
  EXPECT_EQ(captures, 4);
  EXPECT_EQ(devices, static_cast<int>(transports().size()) - 2);
  const ScratchFolder folder;
  EXPECT_EQ(error_of("pcap:" + folder / "x"),
            "pcap:" + folder / "x" + ": can only be read; right for output would be " + outputs);
}

// Each option is in the manual, and accepts its range and nothing else.
TEST(Transports, OptionsAreThoseOfTheEntry) {
  std::ifstream input(IMUD_SOURCE_DIR "/transports/README.md");
  const std::string manual(std::istreambuf_iterator<char>(input), {});
  std::size_t options = 0;
  for (const Transport* transport : transports()) {
    const Role role = transport->serves_device ? Role::device : Role::listener;
    const PortSpec example = PortSpec::parse(transport->example);
    EXPECT_EQ(example.scheme, transport->name);
    EXPECT_NO_THROW(check_port(*transport, example, role)) << transport->example;
    for (const PortOption& option : transport->options) {
      ++options;
      EXPECT_FALSE(option.help.empty()) << option.key;
      EXPECT_TRUE(mentions(manual, fmt::format("`{}`", option.key))) << option.key;
      const auto accepts = [&](const std::string& value, Role as = Role::device) {
        PortSpec spec = PortSpec::parse(fmt::format("{}:{}", transport->name, example.address));
        spec.options[std::string(option.key)] = value;
        try {
          check_port(*transport, spec, transport->serves_device ? as : Role::listener);
          return true;
        } catch (const PortError&) {
          return false;
        }
      };
      if (option.has_range()) {
        for (const std::int64_t value : {option.min, option.max})
          EXPECT_TRUE(accepts(std::to_string(value))) << option.key << value;
        for (const std::int64_t value : {option.min - 1, option.max + 1})
          EXPECT_FALSE(accepts(std::to_string(value))) << option.key << value;
      }
      const std::string words = fmt::format("{} ", option.choices);
      for (std::size_t at = 0; words.size() > 1 && at < words.size(); at = words.find(' ', at) + 1) {
        const std::string word = words.substr(at, words.find(' ', at) - at);
        EXPECT_TRUE(accepts(word)) << option.key << word;
        EXPECT_EQ(accepts(word, Role::listener), !option.device_only || !transport->serves_device) << option.key;
      }
      EXPECT_FALSE((option.has_range() || !option.choices.empty()) && accepts("nonsense")) << option.key;
    }
    PortSpec unknown = example;
    unknown.options["nonsense"] = "1";
    EXPECT_THROW(check_port(*transport, unknown, role), PortError) << transport->name;
  }
  EXPECT_GE(options, 15U);
}

TEST(Transports, StandardInputIsReadByTheTransportForItsContent) {
  EXPECT_EQ(standard_input_port(false), "file:-");
  EXPECT_EQ(standard_input_port(true), "pcap:-");
  EXPECT_EQ(standard_input_port(true, true), "canfile:-");
}

TEST(Transports, StandardOutputIsKnownByEachOfItsNames) {
  const Transport& file = *find_transport("file");
  for (const char* name : {"-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"})
    EXPECT_TRUE(file.is_standard_output(PortSpec::parse(std::string("file:") + name))) << name;
  EXPECT_FALSE(file.is_standard_output(PortSpec::parse("file:stdout")));
}

}  // namespace
}  // namespace imud
