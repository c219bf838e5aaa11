// Settings that may have any whole number between two bounds.
#include "tests/protocols/frames/frame_unit.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

constexpr std::string_view ranged = R"(
frame_version = 1
name = "test"
byte_order = "big"
[setting]
HZ = {min = 0, max = 100, delivered = 10}
MASK = {min = 0, max = 0xFFFFFFFF}
TRIM = {min = -50, max = 50, delivered = 0, kept = true}
[[message]]
name = "a"
rate_hz = "HZ"
layout = ["A1", "alive_counter:u8"]
[[message]]
name = "b"
when = {MASK = [7, 0x80000000]}
layout = ["B1", "alive_counter:u8"]
[[request]]
line = "={setting},{value}"
set = true
answer = "{setting}:{value}\n"
otherwise = "BAD {value}\n"
[[request]]
line = "?{setting}"
answer = "{value} of {HZ}\n"
[[request]]
layout = ["F0", "{HZ}:u16", "{MASK}:u32"]
set = true
answer = ["F1", "{MASK}:u32", "{HZ}:u8"]
otherwise = "EE"
[[request]]
layout = ["F2", "{HZ}:u8"]
set = true
)";

// Returns the first bytes of the frames of so many samples at 100 Hz.
std::string frames_of(Line& line, Sample& sample, int count) {
  std::string text;
  for (int i = 0; i < count; ++i) {
    const auto frames = line.encode(sample);
    for (const Frame& frame : frames) text += frame.bytes[0] == std::byte{0xA1} ? 'a' : 'b';
    if (frames.empty()) text += '.';
    ++sample.counter;
    sample.time = sample.time + 10ms;
  }
  return text;
}

TEST(FrameRanges, TakeEveryWholeNumberBetweenTheirBounds) {
  Line line = frame_line(ranged);
  for (const int hz : {0, 1, 7, 99, 100}) {
    const std::string text = std::to_string(hz);
    EXPECT_EQ(answer_to(line, "=HZ," + text + "\n?HZ\n"), "HZ:" + text + "\n" + text + " of " + text + "\n");
  }
  for (const char* text : {"101", "-1", "7.5", "1e9", "99999999999999999999", "nan", "", "x"})
    EXPECT_EQ(answer_to(line, std::string("=HZ,") + text + "\n"), std::string("BAD ") + text + "\n");
  EXPECT_EQ(answer_to(line, "?HZ\n"), "100 of 100\n");
  EXPECT_EQ(answer_to(line, "=TRIM,-50\n=TRIM,-51\n?TRIM\n"), "TRIM:-50\nBAD -51\n-50 of 100\n");
  line.device->power_on({});
  EXPECT_EQ(answer_to(line, "?TRIM\n?MASK\n"), "-50 of 10\n0 of 10\n");
}

TEST(FrameRanges, AreTheirOwnCodes) {
  Line line = frame_line(ranged);
  EXPECT_EQ(hex_answer(line, "F0 00 64 FF FF FF FF"), "F1 FF FF FF FF 64");
  EXPECT_EQ(hex_answer(line, "F0 00 65 00 00 00 00"), "EE");
  EXPECT_EQ(answer_to(line, "?MASK\n"), "4294967295 of 100\n");
  EXPECT_EQ(hex_answer(line, "F2 65"), "");  // unknown, as nothing is answered otherwise
  EXPECT_EQ(line.device->counts()[1], 1U);   // the letter may begin a line
  EXPECT_EQ(hex_answer(line, "F2 03"), "");
  EXPECT_EQ(answer_to(line, "?MASK\n"), "4294967295 of 3\n");
}

TEST(FrameRanges, SwitchMessagesAndSetTheirRates) {
  Line line = frame_line(ranged);
  Sample sample;
  EXPECT_EQ(frames_of(line, sample, 10), "a.........");
  hex_answer(line, "F0 00 32 00 00 00 07");
  EXPECT_EQ(frames_of(line, sample, 4), "abbabb");
  hex_answer(line, "F0 00 00 80 00 00 00");
  EXPECT_EQ(frames_of(line, sample, 3), "bbb");
  hex_answer(line, "F0 00 00 80 00 00 01");
  EXPECT_EQ(frames_of(line, sample, 3), "...");
}

TEST(FrameRanges, AreConfiguredAndPrinted) {
  Settings settings = frame_settings(frames_of_text(ranged, "test.toml"));
  settings.set("settings", std::vector<std::string>{"HZ=77", "MASK=7"});
  Line line(protocol_named("frame"), settings);
  EXPECT_EQ(answer_to(line, "?MASK\n"), "7 of 77\n");
  settings.set("settings", std::vector<std::string>{"HZ=101"});
  try {
    static_cast<void>(protocol_named("frame").make(settings));
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_TRUE(contains(error.what(), "101 is no value of HZ; give a whole number from 0 to 100")) << error.what();
  }
  const std::vector<std::string> table = protocol_named("frame").layout(settings);
  const auto has = [&](std::string_view wanted) {
    return std::ranges::any_of(table, [&](const std::string& text) { return contains(text, wanted); });
  };
  EXPECT_TRUE(has("TRIM  0          kept               -50 to 50"));
  EXPECT_TRUE(has("MASK  0          lost unless saved  0 to 4294967295"));
  // A rate that the imu does not have.
  EXPECT_NO_THROW(protocol_named("frame").check(settings, 100));
  EXPECT_THROW(protocol_named("frame").check(settings, 99), std::invalid_argument);
}

// The rate inf is each sample. With it a host may choose a rate above the imu's, at which each sample is sent, too.
TEST(FrameRanges, ARateOfEachSample) {
  std::string text =
      "frame_version = 1\nname = \"t\"\nline.baud = 9600\nsetting.HZ = [inf, 100, 10]\n[[message]]\n"
      "rate_hz = \"HZ\"\nlayout = [\"A1\"]\n[[request]]\nline = \"{HZ}\"\nset = true\nanswer = \"{HZ}\"\n";
  const Settings settings = frame_settings(frames_of_text(text, "test.toml"));
  const Protocol& protocol = protocol_named("frame");
  EXPECT_NO_THROW(protocol.check(settings, 50));
  Line line(protocol, settings);
  Sample sample;
  const auto sent = [&] {
    std::size_t frames = 0;
    for (int k = 0; k < 10; ++k, ++sample.counter, sample.time.ns += 20'000'000) frames += line.encode(sample).size();
    return frames;
  };
  EXPECT_EQ(sent(), 10U);
  EXPECT_EQ(answer_to(line, "10\n"), "10");
  EXPECT_EQ(sent(), 2U);
  EXPECT_EQ(answer_to(line, "100\n"), "100");
  EXPECT_EQ(sent(), 10U);
  EXPECT_EQ(answer_to(line, "10\n"), "10");
  EXPECT_EQ(answer_to(line, "inf\n"), "inf");
  EXPECT_EQ(sent(), 10U);
  text.replace(text.find("inf, "), 5, "");
  try {
    protocol.check(frame_settings(frames_of_text(text, "test.toml")), 50);
    ADD_FAILURE() << "is not refused";
  } catch (const std::invalid_argument& error) {
    EXPECT_TRUE(
        std::string_view(error.what())
            .ends_with("rate_hz is a setting that a host may set to 100, but with rate_hz = 50 of the imu there "
                       "are no more samples; with the value inf, each sample, the setting may have higher rates"))
        << error.what();
  }
}

TEST(FrameRanges, BitRates) {
  std::string text =
      "frame_version = 1\nname = \"t\"\nline.baud = \"BAUD\"\nsetting.BAUD = {min = 9600, max = 20000000}\n"
      "[[message]]\nlayout = [\"A1\"]\n[[request]]\nline = \"baud {BAUD}\"\nset = true\n";
  Line line = frame_line(text);
  EXPECT_EQ(line.device->uart().baud, 9600U);
  answer_to(line, "baud 250001\n");
  EXPECT_EQ(line.device->uart().baud, 250001U);
  text.replace(text.find("20000000"), 8, "20000001");
  EXPECT_TRUE(contains(faults_of(text), "the value 20000001 of BAUD is no bit rate")) << faults_of(text);
}

TEST(FrameRanges, WrongBoundsAreRefused) {
  const auto ranges = [](const std::string& setting, const std::string& more) {
    return "frame_version = 1\nname = \"t\"\nsetting.R = " + setting + "\n[[message]]\nlayout = [\"A1\"]\n" + more;
  };
  const std::pair<std::string, const char*> cases[] = {
      {ranges("{min = 1}", ""), "setting.R.max: missing; give the other bound"},
      {ranges("{max = 1}", ""), "setting.R.min: missing; give the other bound"},
      {ranges("{min = 2, max = 1}", ""), "setting.R.max: give a whole number from 2 to 9007199254740992"},
      {ranges("{min = 0.5, max = 1}", ""), "setting.R.min: give a whole number from -9007199254740992"},
      {ranges("{min = 1, max = 2, delivered = 3}", ""), "setting.R.delivered: give a whole number from 1 to 2"},
      {ranges("{min = 1, max = 2, values = [1]}", ""), "setting.R.values: give either this, or min and max"},
      {ranges("{min = 1, max = 2, codes = [1]}", ""), "setting.R.codes: give either this, or min and max"},
      {ranges("{min = 1, max = 2, step = 3}", ""), "setting.R.step: "},
      {ranges("{min = 1, max = 20000}", "rate_hz = \"R\""), "the value 20000 of R is no rate"},
      {ranges("{min = -1, max = 20}", "rate_hz = \"R\""), "the value -1 of R is no rate"},
      {ranges("{min = 1, max = 256}", "[[request]]\nlayout = [\"AA\", \"{R}:u8\"]\nset = true"),
       "the bits do not hold the code of the value 256"},
      {ranges("{min = -1, max = 2}", "[[request]]\nlayout = [\"AA\", \"{R}:u8\"]\nset = true"),
       "R has negative values, which have no code"},
      {ranges("{min = 1, max = 2}", "[[request]]\nline = \"={R}7\"\nset = true"),
       "{R} ends at '7', which is in a value from 1 to 2"},
      {ranges("{min = 1, max = 2}", "when = {R = 3}"), "3 is no value of R; give a whole number from 1 to 2"},
      {ranges("{min = 1, max = 2}", "[[request]]\nline = \"={R}\"\nset = true\n[[request]]\nline = \"={any}\""),
       "matches lines that begin with \"=\""},
      {ranges("{min = 1, max = 9}", "[[request]]\nline = \"={R}\"\nset = true\n[[request]]\nline = \"=5\""),
       "matches \"=5\", which the request \"={R}\" in line 6 matches, too"},
  };
  for (const auto& [text, wanted] : cases) {
    const std::string faults = faults_of(text);
    EXPECT_TRUE(contains(faults, wanted)) << text << "\n" << faults;
    EXPECT_TRUE(contains(faults, "test.toml:")) << faults;
  }
}

}  // namespace
}  // namespace imud
