// Every protocol on CAN sends only the identifiers, lengths and rates that its entry lists, and has filters that pass
// what it receives.
#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <utility>

#include "tests/protocols/can_text.hpp"
#include "tests/protocols/conformance_cases.hpp"
#include "tests/protocols/recording.hpp"

namespace imud {
namespace {

using Identifier = std::pair<std::uint32_t, bool>;  // identifier, and whether it is extended

class CanMessages : public testing::TestWithParam<ConformanceCase> {};

TEST_P(CanMessages, AreListedByWhatSendsOnCan) {
  const Protocol& protocol = GetParam().protocol;
  EXPECT_EQ(protocol.can_messages != nullptr, protocol.link == Link::can);
  EXPECT_EQ(protocol.can_filters != nullptr, protocol.link == Link::can);
}

// Three seconds of a device without host.
TEST_P(CanMessages, CoverEveryFrameThatADeviceSends) {
  const Protocol& protocol = GetParam().protocol;
  if (protocol.link != Link::can) return;
  const Settings& settings = GetParam().settings;
  const double rate_hz = protocol.product != nullptr ? protocol.product(settings).rate_hz : 100.0;
  const std::vector<CanMessage> messages = protocol.can_messages(settings, rate_hz);
  std::map<Identifier, CanMessage> listed;
  for (const CanMessage& message : messages) listed[{message.can.id, message.can.extended}] = message;
  EXPECT_EQ(listed.size(), messages.size()) << "an identifier is listed twice";
  ASSERT_GT(listed.size(), 0U);

  const std::unique_ptr<Device> device = protocol.make(settings);
  const auto frames = std::make_unique<FrameBuffer>();
  std::map<Identifier, int> seen;
  const Grid grid(rate_hz);
  for (int second = 0; second < 3; ++second) {
    std::map<Identifier, int> counts;
    const auto take = [&] {
      for (const Frame& frame : frames->frames()) {
        const Identifier id{frame.can.id, frame.can.extended};
        ASSERT_EQ(listed.count(id), 1U) << std::hex << frame.can.id;
        EXPECT_EQ(frame.can.fd, listed[id].can.fd);
        EXPECT_EQ(frame.can.bit_rate_switch, listed[id].can.bit_rate_switch);
        EXPECT_LE(frame.bytes.size(), listed[id].max_size);
        ++counts[id];
        ++seen[id];
      }
      frames->clear();
    };
    Sample sample;
    for (std::uint64_t k = 0; grid.nominal_offset(k) < std::chrono::seconds(1); ++k) {
      sample.time = DeviceTime{} + std::chrono::seconds(second) + grid.nominal_offset(k);
      while (device->deadline() && *device->deadline() <= sample.time) {
        device->poll(*device->deadline(), *frames);
        take();
      }
      device->sample(sample, *frames);
      ++sample.counter;
      take();
    }
    for (const auto& [id, count] : counts) EXPECT_LE(count, listed[id].max_frames_per_s) << std::hex << id.first;
  }
  EXPECT_GT(seen.size(), 0U) << "the device sent nothing: the test proves nothing";
}

// The kernel discards what no filter passes: such a frame is none that the device answers.
TEST_P(CanMessages, FiltersPassWhatADeviceReceives) {
  const Protocol& protocol = GetParam().protocol;
  const HostInputs& host = Conformance::of(protocol).host;
  if (protocol.link != Link::can || host.bodies.empty()) return;
  const std::vector<CanFilter> filters = protocol.can_filters(GetParam().settings);
  const std::unique_ptr<Device> device = protocol.make(GetParam().settings);
  const auto replies = std::make_unique<FrameBuffer>();
  int passed = 0;
  for (const std::string_view body : host.bodies)
    each_frame(host.frame(body), [&](const Frame& frame) {
      const bool is_passed = std::ranges::any_of(filters, [&](const CanFilter& filter) {
        const bool is_kind = frame.can.remote ? filter.remote : filter.data;
        return is_kind && filter.extended == frame.can.extended && ((frame.can.id ^ filter.id) & filter.mask) == 0;
      });
      passed += is_passed ? 1 : 0;
      device->receive(frame, {}, *replies);
      EXPECT_TRUE(is_passed || replies->frames().empty()) << can_text(frame);
      replies->clear();
    });
  EXPECT_GT(passed, 0);
}

INSTANTIATE_TEST_SUITE_P(AllProtocols, CanMessages,
                         testing::ValuesIn(conformance_cases([](const Protocol&) { return true; })), case_name);

TEST(CanMessagesTest, OfNativeCan) {
  const Protocol& protocol = protocol_named("native-can");
  Settings settings(protocol.settings);
  settings.set("can_id", std::int64_t{0x200});
  std::vector<CanMessage> messages = protocol.can_messages(settings, 200);
  ASSERT_EQ(messages.size(), 7U);
  for (std::uint32_t i = 0; i < 7; ++i) {
    EXPECT_EQ(messages[i].can.id, 0x200 + i);
    EXPECT_FALSE(messages[i].can.extended || messages[i].can.fd);
    EXPECT_EQ(messages[i].max_size, 8U);
    EXPECT_EQ(messages[i].max_frames_per_s, 200);
  }
  settings.set("fd", true);
  settings.set("extended", true);
  messages = protocol.can_messages(settings, 1000);
  ASSERT_EQ(messages.size(), 1U);
  EXPECT_TRUE(messages[0].can.extended && messages[0].can.fd && messages[0].can.bit_rate_switch);
  EXPECT_EQ(messages[0].can.id, 0x200U);
  EXPECT_EQ(messages[0].max_size, 64U);
  EXPECT_EQ(messages[0].max_frames_per_s, 1000);
  EXPECT_TRUE(protocol.can_filters(settings).empty()) << "it listens to nothing";
}

}  // namespace
}  // namespace imud
