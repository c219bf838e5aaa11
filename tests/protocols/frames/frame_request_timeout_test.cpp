// Requests that are not completed: how long they hide the requests behind them.
#include <chrono>

#include "tests/protocols/frames/frame_unit.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

// A frame is 7E, the command, the number of bytes, the bytes, and their sum with the head.
constexpr std::string_view framed_and_lines = R"(
frame_version = 1
name = "test"
[setting]
P = {min = 0, max = 255}
[[message]]
name = "a"
layout = ["A1", "alive_counter:u8"]
[[request]]
layout = ["@h", "7E B5", "length:u8:@d..@e", "@d", "{P}:u8", "_:*", "@e", "check:sum8:@h..@e"]
set = true
answer = ["AC", "{P}:u8"]
[[request]]
bytes = "C0"
answer = ["C1"]
[[request]]
bytes = "C2"
delay_ms = 400
answer = ["C3"]
[[request]]
line = "show"
answer = "{P}\n"
)";

class FrameRequestTimeout : public testing::Test {
 protected:
  // Returns the answers, in hexadecimal, up to and at this time after the start.
  std::string at(Nanoseconds time, std::string_view request) {
    const std::vector<std::byte> bytes = *hex_bytes_in(request);
    return after(time, [&](FrameBuffer& replies) { line_.device->receive({bytes}, DeviceTime{} + time, replies); });
  }
  std::string text_at(Nanoseconds time, std::string_view text) {
    return after(time, [&](FrameBuffer& replies) {
      line_.device->receive({std::as_bytes(std::span(text))}, DeviceTime{} + time, replies);
    });
  }
  std::string at(Nanoseconds time) {
    return after(time, [](FrameBuffer&) {});
  }
  std::uint64_t unknown() const { return line_.device->counts()[1]; }

  Line line_ = frame_line(framed_and_lines);

 private:
  template <class Act>
  std::string after(Nanoseconds time, Act act) {
    const auto replies = std::make_unique<FrameBuffer>();
    while (line_.device->deadline() && *line_.device->deadline() <= DeviceTime{} + time)
      line_.device->poll(*line_.device->deadline(), *replies);
    act(*replies);
    std::vector<std::byte> all;
    for (const Frame& frame : replies->frames()) all.insert(all.end(), frame.bytes.begin(), frame.bytes.end());
    return hex_text(all);
  }
};

// A host that asks twice a second, behind noise that looks like the begin of a long request.
TEST_F(FrameRequestTimeout, AHostThatKeepsAskingIsAnsweredAfterASecond) {
  EXPECT_EQ(at(0ms, "7E B5 F0"), "");
  EXPECT_EQ(at(100ms, "C0"), "");
  EXPECT_EQ(at(600ms, "C0"), "");
  EXPECT_EQ(at(999ms), "");
  EXPECT_EQ(at(1000ms), "C1 C1");
  EXPECT_EQ(at(1100ms, "C0"), "C1");
  EXPECT_EQ(unknown(), 3U);
  EXPECT_FALSE(line_.device->deadline());
}

// Each byte of the noise looks like a begin, and more noise follows.
TEST_F(FrameRequestTimeout, MuchNoiseDoesNotAddUp) {
  EXPECT_EQ(at(0ms, "7E B5 F0 7E B5 F1 7E B5 F2"), "");
  EXPECT_EQ(at(500ms, "7E B5 F3 C0"), "");
  EXPECT_EQ(at(900ms, "C0"), "");
  EXPECT_EQ(at(1000ms), "");  // the noise of 500 ms is left
  EXPECT_EQ(unknown(), 9U);
  EXPECT_EQ(at(1899ms), "");
  EXPECT_EQ(at(1900ms), "C1 C1");
  EXPECT_EQ(unknown(), 12U);
}

// A request in pieces is not hurt by noise before it, and none is cut off within a second of its first byte.
TEST_F(FrameRequestTimeout, ARequestInPiecesIsKeptForASecond) {
  EXPECT_EQ(at(0ms, "7E"), "");
  EXPECT_EQ(at(900ms, "7E B5 01"), "");
  EXPECT_EQ(at(1700ms, "07 3B"), "AC 07");
  EXPECT_EQ(unknown(), 1U);
  EXPECT_EQ(at(2000ms, "7E B5 F0"), "");
  EXPECT_EQ(at(2500ms, "7E B5 01"), "");
  EXPECT_EQ(at(3400ms, "08 3C"), "AC 08");  // the noise has gone at 3 s
  EXPECT_EQ(unknown(), 4U);
  EXPECT_EQ(at(5000ms, "7E B5 01"), "");
  EXPECT_EQ(at(6000ms, "E9 1D"), "");
  EXPECT_EQ(unknown(), 9U);
}

// People type slowly: for a line the time counts from the newest byte.
TEST_F(FrameRequestTimeout, ALineMayBeTyped) {
  EXPECT_EQ(text_at(0ms, "s"), "");
  EXPECT_EQ(text_at(800ms, "h"), "");
  EXPECT_EQ(text_at(1600ms, "o"), "");
  EXPECT_EQ(text_at(2400ms, "w"), "");
  EXPECT_EQ(text_at(3200ms, "\n"), "30 0A");
  EXPECT_EQ(text_at(4000ms, "sh"), "");
  EXPECT_EQ(text_at(5000ms, "ow\n"), "");
  EXPECT_EQ(unknown(), 4U);
  // Noise before the line costs a second, and the line is left.
  EXPECT_EQ(at(6000ms, "7E B5 F0"), "");
  EXPECT_EQ(text_at(6500ms, "sh"), "");
  EXPECT_EQ(text_at(7200ms, "ow\n"), "30 0A");
  EXPECT_EQ(unknown(), 7U);
}

TEST_F(FrameRequestTimeout, DelayedAnswersAndAStepOfTheClock) {
  EXPECT_EQ(at(0ms, "7E B5 F0 C2"), "");
  line_.device->step_clock(10s);
  ASSERT_TRUE(line_.device->deadline());
  EXPECT_EQ(*line_.device->deadline() - DeviceTime{}, 11s);
  EXPECT_EQ(at(11s), "");
  EXPECT_EQ(at(11399ms), "");
  EXPECT_EQ(at(11400ms), "C3");
  EXPECT_EQ(at(12s, "7E"), "");
  line_.device->power_on(DeviceTime{} + 12s);
  EXPECT_FALSE(line_.device->deadline());
  EXPECT_EQ(at(12s, "C0"), "C1");
}

}  // namespace
}  // namespace imud
