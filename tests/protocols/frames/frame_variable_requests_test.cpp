// Requests whose length varies, and the answer to all that is well formed, but not described.
#include "protocols/frames/host/frame_requests.hpp"
#include "tests/protocols/frames/frame_unit.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

// A frame is 7E, the command, the number of bytes, the bytes, their sum with the head, 0A.
std::string varying(std::string_view more = "") {
  return R"(
frame_version = 1
name = "test"
[setting]
P1 = {min = 0, max = 1000, delivered = 5}
P2 = {min = 0, max = 1000, delivered = 6}
FORM = {values = ["A", "B"], codes = [0, 1]}
[[message]]
name = "a"
polled = true
when = {FORM = "A"}
layout = ["A1", "alive_counter:u8"]
[[request]]
layout = ["@h", "7E B5", "length:u8:@d..@e", "@d", "{FORM}:u8", "{items}", "@e", "check:sum8:@h..@e", "0A"]
items = [["01", "{P1}:u16"], ["02", "{P2}:u16"], ["F0", "??", "_:1"]]
set = true
answer = ["AC", "{2}", "{P1}:u16 be", "{P2}:u16 be"]
otherwise = ["EE", "{1}"]
[[request]]
layout = ["@h", "7E 0C", "length:u8:@d..@e+1", "@d", "??", "_:*", "{FORM}:u8", "@e", "check:sum8:@h..@e", "0A"]
when = {FORM = "A"}
set = true
answer = ["AC", "{0-3}"]
[[request]]
bytes = "C0"
poll = "a"
[unknown]
layout = ["@h", "7E ??", "length:u8:@d..@e", "@d", "_:*", "@e", "check:sum8:@h..@e", "0A"]
answer = ["15", "{1}"]
test_request = ["7E 77 00 F5 0A", "7E B5 01 07 3B 0A"]
test_answer = ["15 77", ""]
)" + std::string(more);
}

// Returns the text in hexadecimal with length, sum and end.
std::string framed(const std::string& command, const std::string& content, int plus = 0) {
  std::vector<std::byte> bytes = *hex_bytes_in("7E " + command);
  const std::vector<std::byte> data = content.empty() ? std::vector<std::byte>() : *hex_bytes_in(content);
  bytes.push_back(static_cast<std::byte>(static_cast<int>(data.size()) + plus));
  bytes.insert(bytes.end(), data.begin(), data.end());
  unsigned sum = 0;
  for (const std::byte byte : bytes) sum += std::to_integer<unsigned>(byte);
  bytes.push_back(static_cast<std::byte>(sum));
  bytes.push_back(std::byte{0x0A});
  return hex_text(bytes);
}

std::string text_of_hex(std::string_view hex) {
  const std::vector<std::byte> bytes = *hex_bytes_in(hex);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::string without_test(std::string text) {
  const std::size_t at = text.find("test_request");
  return text.erase(at, text.find('\n', text.find("test_answer")) - at);
}

class FrameVariableRequests : public testing::Test {
 protected:
  Line line_ = frame_line(without_test(varying()));
  std::string send(std::string_view request) { return hex_answer(line_, request); }
  std::uint64_t unknown() const { return line_.device->counts()[1]; }
};

TEST_F(FrameVariableRequests, ItemsSetTheirSettings) {
  EXPECT_EQ(send(framed("B5", "00")), "AC 01 00 05 00 06");  // none
  EXPECT_EQ(send(framed("B5", "00 02 34 01")), "AC 04 00 05 01 34");
  EXPECT_EQ(send(framed("B5", "00 02 07 00 F0 AA BB 01 09 00")), "AC 0A 00 09 00 07");
  EXPECT_EQ(send(framed("B5", "00 01 01 00 01 02 00 01 03 00")), "AC 0A 00 03 00 07");  // the last one counts
  std::string many = "00";
  for (int i = 0; i < 80; ++i) many += i % 2 == 0 ? " 01 04 00" : " 02 08 00";
  EXPECT_EQ(send(framed("B5", many)), "AC F1 00 04 00 08");
  EXPECT_EQ(unknown(), 0U);
  EXPECT_EQ(send(framed("B5", "00 02 01 00 01 E9 03")), "EE B5");  // 1001
  EXPECT_EQ(send(framed("B5", "07 02 01 00")), "EE B5");
  EXPECT_EQ(send(framed("B5", "00")), "AC 01 00 04 00 08") << "a refused request has no effect";
  // A list with an item of another kind, or with a part of one, is unknown.
  EXPECT_EQ(send(framed("B5", "00 03 01 00")), "15 B5");
  EXPECT_EQ(send(framed("B5", "00 01 01 00 02 01")), "15 B5");
  EXPECT_EQ(send(framed("B5", "")), "15 B5");
}

TEST_F(FrameVariableRequests, AnyNumberOfBytesEndsByTheLength) {
  EXPECT_EQ(send(framed("0C", "11 00", 1)), "AC 7E 0C 03 11");
  std::string content = "22";
  for (int i = 0; i < 100; ++i) content += " 7E";
  // One byte after another.
  const std::string request = text_of_hex(framed("0C", content + " 00", 1));
  for (std::size_t i = 0; i + 1 < request.size(); ++i) ASSERT_EQ(answer_to(line_, request.substr(i, 1)), "") << i;
  EXPECT_EQ(answer_to(line_, request.substr(request.size() - 1)), text_of_hex("AC 7E 0C 67 22"));
  EXPECT_EQ(unknown(), 0U);
  // The value after them is set, and locks the request.
  EXPECT_EQ(send(framed("0C", "33 01 02 03 01", 1)), "AC 7E 0C 06 33");
  EXPECT_EQ(send(framed("0C", "33 01 02 03 01", 0)), "15 0C");
}

// The longest request has 1023 bytes, also if it begins like a line, whose limit is 255.
TEST(FrameLongRequests, HaveUpTo1023Bytes) {
  Line line = frame_line(R"(
frame_version = 1
name = "test"
byte_order = "big"
[[message]]
name = "a"
layout = ["A1", "alive_counter:u8"]
[[request]]
layout = ["@h", "\"B\"", "length:u16:@d..@e", "@d", "_:*", "@e", "check:sum8:@h..@e"]
answer = ["AC", "{1-2}"]
[[request]]
line = "show"
answer = "here"
)");
  const auto request = [](std::size_t size) {
    std::string text{'B', static_cast<char>(size >> 8), static_cast<char>(size & 0xFF)};
    text.append(size, 'x');
    unsigned sum = 0;
    for (const char c : text) sum += static_cast<unsigned char>(c);
    return text + static_cast<char>(sum);
  };
  EXPECT_EQ(answer_to(line, request(300)), text_of_hex("AC 01 2C"));
  EXPECT_EQ(answer_to(line, request(0x2020)), "");  // too long
  EXPECT_EQ(line.device->counts()[1], 0x2020U + 4);
  for (const std::size_t size : {252U, 253U, 800U, 1019U}) {
    const std::string text = request(size);
    for (std::size_t i = 0; i + 1 < text.size(); ++i) ASSERT_EQ(answer_to(line, text.substr(i, 1)), "") << i;
    EXPECT_EQ(answer_to(line, text.substr(text.size() - 1)).size(), 3U) << size;
  }
  EXPECT_EQ(answer_to(line, request(1021) + "\nshow\n"), "here");
  EXPECT_EQ(line.device->counts()[1], 0x2020U + 4 + 1025);
}

TEST_F(FrameVariableRequests, WhatIsWellFormedButUnknownIsAnsweredAndCounted) {
  EXPECT_EQ(send(framed("99", "01 02 03")), "15 99");
  EXPECT_EQ(unknown(), 8U);
  EXPECT_EQ(send(framed("98", "")), "15 98");
  EXPECT_EQ(unknown(), 13U);
  // A wrong sum, end or length is no frame.
  EXPECT_EQ(send("7E 99 01 05 1E 0A"), "");
  EXPECT_EQ(unknown(), 19U);
  EXPECT_EQ(send("7E 99 01 05 1D 0B"), "");
  EXPECT_EQ(unknown(), 25U);
  EXPECT_EQ(send("7E 99 FF 00"), "");  // its end would come
  EXPECT_EQ(send(framed("99", "05")), "");
  line_.device->receive({}, DeviceTime{} + std::chrono::seconds(2), *std::make_unique<FrameBuffer>());
  EXPECT_EQ(unknown(), 35U);
}

TEST_F(FrameVariableRequests, APollRespectsTheSettingsOfItsMessage) {
  static_cast<void>(bytes_of(line_, {}));
  EXPECT_EQ(send("C0"), "A1 00");
  EXPECT_EQ(send(framed("B5", "01")), "AC 01 00 05 00 06");
  EXPECT_EQ(send("C0"), "");
  EXPECT_EQ(send(framed("B5", "00")), "AC 01 00 05 00 06");
  EXPECT_EQ(send("C0"), "A1 01");
  // A poll before the first sample is lost if the message is switched off until then.
  line_.device->power_on({});
  EXPECT_EQ(send("C0" + framed("B5", "01")), "AC 01 00 05 00 06");
  EXPECT_EQ(bytes_of(line_, {}).size(), 0U);
}

TEST_F(FrameVariableRequests, ExamplesAreUnderstood) {
  const FrameRequests requests(*frames_of_text(without_test(varying()), "test.toml"));
  const std::vector<std::vector<std::byte>> examples = requests.examples();
  ASSERT_EQ(examples.size(), 4U);
  for (const std::vector<std::byte>& example : examples) send(hex_text(example));
  EXPECT_EQ(unknown(), examples[0].size());  // the first one has the form of what is unknown
}

TEST(FrameVariableRequestRefusals, Faults) {
  EXPECT_TRUE(contains(faults_of(varying()), "unknown: test_request: 7E B5 01 07 3B 0A is a known request"))
      << faults_of(varying());
  const auto request = [](const std::string& keys) { return without_test(varying()) + "[[request]]\n" + keys; };
  const std::pair<std::string, const char*> cases[] = {
      {request("layout = [\"7D\", \"_:*\"]"), "give a length, before them"},
      {request("layout = [\"@a\", \"7D\", \"_:*\", \"length:u8:@a..@\"]"), "give a length, before them"},
      {request("layout = [\"@a\", \"7D\", \"length:u8:@a..@\", \"_:*\", \"_:*\"]"), "only one part of a request"},
      {request("layout = [\"@a\", \"7D\", \"length:u8/2:@a..@\", \"_:*\", \"00\"]"), "counts bytes, not pieces"},
      {request("layout = [\"@a\", \"7D\", \"length:u8:@a..@\", \"_:*\", \"00\", \"check:sum16/16:@a..\"]"),
       "a check of any number of bytes is of bytes, not of words"},
      {request("layout = [\"@a\", \"7D\", \"length:u8:@a..@\", \"{items}\"]"), "{items} needs items"},
      {request("bytes = \"7D\"\nanswer = [\"7D\", \"{items}\"]"), "only a request has {items}"},
      {request("layout = [\"7D\"]\nitems = [[\"01\"]]"), "give the element {items}"},
      {request("layout = [\"@a\", \"7D\", \"length:u8:@a..@\", \"{items}\"]\nitems = [[\"01\", \"_:*\"]]"),
       "an item has a fixed number of bytes"},
      {request("layout = [\"@a\", \"7D\", \"length:u8:@a..@\", \"{items}\"]\nitems = [[\"@x\"], [\"01\"]]"),
       "items: an item has at least one byte"},
      {request("layout = [\"@a\", \"7D\", \"length:u8:@a..@\", \"{items}\"]\nitems = [[\"01\", \"{P3}:u8\"]]"),
       "items: \"{P3}:u8\": there is no setting \"P3\""},
      {request("layout = [\"@a\", \"7D\", \"length:u8:@a..@\", \"{items}\"]\nitems = [[\"01\", \"{P1}:u16\"]]"),
       "set: missing: the request has a value"},
      {request("layout = [\"@a\", \"7D\", \"length:u8:@a..@\", \"{items}\"]\nitems = []"), "lists of elements"},
      {request("bytes = \"7D\"\nitems = [[\"01\"]]"), "only a layout has the element {items}"},
      {request("layout = [\"@a\", \"7D\", \"length:u8:@a..@\", \"_:*\"]\nanswer = \"{2}\""),
       "give bytes of the request from 0 to 1"},
      {request("layout = [\"@h\", \"7E 0C\", \"length:u8:@h..@\", \"_:*\"]"), "matches the same bytes"},
      {one_message("AA\n_:*"), "only a request has any number of bytes"},
  };
  for (const auto& [text, wanted] : cases) EXPECT_TRUE(contains(faults_of(text), wanted)) << text << faults_of(text);
  const auto unknown = [](const std::string& keys) { return one_message("AA") + "[unknown]\n" + keys; };
  EXPECT_EQ(faults_of(unknown("layout = [\"7E\", \"_:2\"]\nanswer = [\"15\", \"{0-2}\"]\ntest_request = \"7E 01 "
                              "02\"\ntest_answer = \"15 7E 01 02\"")),
            "");
  const std::pair<std::string, const char*> wrong[] = {
      {unknown("answer = [\"15\"]"), "unknown.layout: missing; give the form of the bytes"},
      {unknown("answer = \"15\""), "no request is a line"},
      {unknown("layout = [\"7E\", \"_:2\"]"), "unknown.answer: missing"},
      {unknown("layout = [\"_:2\"]\nanswer = \"15\""), "a decoder cannot find the frame"},
      {unknown("layout = [\"7E\", \"_:2\"]\nanswer = [\"{3}\"]"), "give bytes of the request from 0 to 2"},
      {unknown("layout = [\"7E\", \"_:2\"]\nanswer = [\"15\"]\ntest_request = \"7E 01 02\"\ntest_answer = \"16\""),
       "unknown: test_request: the unit answers 15, not 16"},
      {"setting.A = [1]\n" + unknown("layout = [\"7E\", \"{A}:u8\"]\nanswer = [\"15\"]"),
       "what is unknown sets nothing"},
  };
  for (const auto& [text, fault] : wrong) EXPECT_TRUE(contains(faults_of(text), fault)) << text << faults_of(text);
}

}  // namespace
}  // namespace imud
