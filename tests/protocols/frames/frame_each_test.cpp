// Requests that exist for each row of words, and several forms of unknown bytes that are answered.
#include "protocols/frames/host/frame_requests.hpp"
#include "tests/protocols/frames/frame_unit.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

// Registers of 16 bits: 57, the address and the value write, 52 and the address read. Sums at the end.
std::string registers(std::string_view more = "") {
  return R"(
frame_version = 1
name = "test"
byte_order = "big"
[setting]
R0 = {min = 0, max = 0xFFFF}
R1 = {min = 0, max = 0xFFFF, delivered = 0x1234}
R2 = {min = 0, max = 7, delivered = 5}
[[message]]
name = "a"
polled = true
layout = ["A1", "alive_counter:u8"]
[[request]]
each = [["00", "R0"], ["01", "R1"], ["02", "R2"]]
layout = ["@h", "57 $1", "{$2}:u16", "check:sum8:@h.."]
set = true
answer = ["@h", "77", "$1", "check:sum8:@h.."]
otherwise = ["EE", "$1"]
test_request = ["57 01 00 09 61", "57 00 01 02 5A", "57 02 00 08 61"]
test_answer = ["77 01 78", "77 00 77", "EE 02"]
[[request]]
each = [["00", "R0"], ["01", "R1"], ["02", "R2"]]
layout = ["@h", "52 $1", "check:sum8:@h.."]
answer = ["@h", "72 $1", "{$2}:u16", "check:sum8:@h.."]
test_request = "57 01 00 09 61 52 01 53"
test_answer = "77 01 78 72 01 00 09 7C"
[[request]]
each = [["one", "R1", "1"], ["two", "R2", "2"]]
line = "$1 $3 $$"
set = {"$2" = "$3"}
answer = "$1 {$2}"
[[unknown]]
layout = ["@h", "52", "_:1", "check:sum8:@h.."]
answer = ["FE", "{1}"]
test_request = "52 09 5B"
test_answer = "FE 09"
[[unknown]]
layout = ["@h", "52", "_:2"]
answer = ["FD"]
test_request = "52 09 5C"
test_answer = "FD"
[[unknown]]
answer = "? {line}"
)" + std::string(more);
}

TEST(FrameEach, RegistersKeepWhatTheHostWrites) {
  EXPECT_EQ(faults_of(registers()), "");
  Line line = frame_line(registers());
  EXPECT_EQ(hex_answer(line, "52 00 52 52 01 53 52 02 54"), "72 00 00 00 72 72 01 12 34 B9 72 02 00 05 79");
  EXPECT_EQ(hex_answer(line, "57 01 00 09 61 57 00 BE EF 04 57 02 00 03 5C"), "77 01 78 77 00 77 77 02 79");
  EXPECT_EQ(hex_answer(line, "52 00 52 52 01 53 52 02 54"), "72 00 BE EF 1F 72 01 00 09 7C 72 02 00 03 77");
  EXPECT_EQ(hex_answer(line, "57 02 00 08 61"), "EE 02");
  EXPECT_EQ(answer_to(line, "two 2 $$\n"), "two 2");
  EXPECT_EQ(hex_answer(line, "52 02 54"), "72 02 00 02 76");
  EXPECT_EQ(line.device->counts()[1], 0U);
  EXPECT_EQ(FrameRequests(*frames_of_text(registers(), "test.toml")).all().size(), 8U);
}

TEST(FrameEach, TheFirstFormOfUnknownBytesIsAnswered) {
  Line line = frame_line(registers());
  EXPECT_EQ(hex_answer(line, "52 77 C9"), "FE 77");
  EXPECT_EQ(hex_answer(line, "52 77 C8"), "FD");
  EXPECT_EQ(hex_answer(line, "52 00 53"), "FD");
  EXPECT_EQ(answer_to(line, "three\n"), "? three");
  EXPECT_EQ(line.device->counts()[1], 14U);
}

TEST(FrameEach, Faults) {
  const auto request = [](const std::string& keys) {
    std::string text = registers();
    return text.insert(text.find("[[unknown]]"), "[[request]]\n" + keys + "\n");
  };
  const std::pair<std::string, const char*> cases[] = {
      {request("each = []\nbytes = \"44 $1\""), "each: give 1 to 256 rows of words"},
      {request("each = [\"00\"]\nbytes = \"44 $1\""), "each: give 1 to 256 rows of words"},
      {request("each = [[\"00\"], [\"01\", \"R1\"]]\nbytes = \"44 $1\""), "all rows have equally many words"},
      {request("each = [[\"00\"], [\"01\"]]\nbytes = \"44 $2\""), "a row has 1 words; there is no $2"},
      {request("each = [[\"00\"], [\"00\"]]\nbytes = \"44 $1\""), "matches the same bytes"},
      {request("each = [[\"R8\"]]\nlayout = [\"44\", \"{$1}:u16\"]\nset = true"), "there is no setting \"R8\""},
      {registers("[[unknown]]\nanswer = \"no\""), "lines have one answer"},
      {registers("[[unknown]]\nlayout = [\"44\"]\nanswer = [\"45\"]\ntest_request = \"44\"\ntest_answer = \"46\""),
       "unknown: test_request: the unit answers 45, not 46"},
  };
  for (const auto& [text, wanted] : cases) EXPECT_TRUE(contains(faults_of(text), wanted)) << text << faults_of(text);
}

}  // namespace
}  // namespace imud
