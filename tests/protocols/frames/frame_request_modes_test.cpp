// Requests that are understood only while settings have values: locks and modes.
#include "tests/protocols/frames/frame_unit.hpp"

namespace imud {
namespace {

constexpr std::string_view locked = R"(
frame_version = 1
name = "test"
[setting]
FORM = {values = ["A", "B"], codes = [3, 4]}
LOCK = ["on", "off"]
[[message]]
name = "a"
layout = ["A1", "alive_counter:u8"]
[[request]]
bytes = "F9 A5"
set = {LOCK = "off"}
[[request]]
layout = ["F0", "{FORM}:u8"]
when = {LOCK = "off"}
set = true
answer = "AC"
test_request = "F9 A5 F0 04"
test_answer = "AC"
[[request]]
layout = ["F0", "_:1"]
when = {LOCK = "on"}
answer = "EE"
[[request]]
bytes = "F5"
when = {LOCK = "off"}
set = {LOCK = "on"}
save = true
[[request]]
line = "show"
when = {LOCK = "off", FORM = ["A", "B"]}
answer = "{FORM}"
[[request]]
line = "show"
when = {LOCK = "on"}
answer = "locked"
)";

TEST(FrameRequestModes, ALockedUnitRefusesOrDoesNotKnow) {
  Line line = frame_line(locked);
  EXPECT_EQ(answer_to(line, "\xF0\x04"), "\xEE");
  EXPECT_EQ(answer_to(line, "show\n"), "locked");
  EXPECT_EQ(line.device->counts()[1], 0U);
  EXPECT_EQ(answer_to(line, "\xF5"), "");
  EXPECT_EQ(line.device->counts()[1], 1U);  // unknown
}

TEST(FrameRequestModes, AnUnlockedUnitTakesSettingsUntilItIsLocked) {
  Line line = frame_line(locked);
  EXPECT_EQ(answer_to(line, "\xF9\xA5\xF0\x04"), "\xAC");
  EXPECT_EQ(answer_to(line, "show\n"), "B");
  EXPECT_EQ(answer_to(line, "\xF5"), "");
  EXPECT_EQ(answer_to(line, "\xF0\x03"), "\xEE");
  line.device->power_on({});
  EXPECT_EQ(answer_to(line, "show\n"), "locked");
  EXPECT_EQ(answer_to(line, "\xF9\xA5show\n"), "B");  // it was saved
  EXPECT_EQ(line.device->counts()[1], 0U);
}

}  // namespace
}  // namespace imud
