// Faults of settings, requests and conversations: each is reported with its line, its place, and what would be right.
#include "tests/protocols/frames/frame_unit.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

std::string described(std::string_view more) {
  return "frame_version = 1\nname = \"test\"\n[setting]\nDR = [100, 50]\nFORM = [\"DELTA\", \"RATE\"]\n"
         "[[message]]\nname = \"data\"\nlayout = [\"AA\", \"alive_counter:u8\"]\n" +
         std::string(more);
}

std::string request(std::string_view keys) { return described("[[request]]\n" + std::string(keys)); }

TEST(FrameRequestRefusals, KeysThatCannotBe) {
  ASSERT_EQ(faults_of(request("line = \"x\"\nanswer = \"y\"\n")), "");
  const std::pair<std::string, const char*> cases[] = {
      {described("when = {ROTFMT = \"RATE\"}"), "when.ROTFMT: there is no setting \"ROTFMT\"; there are DR, FORM"},
      {described("when = {FORMS = \"RATE\"}"), "there is no setting \"FORMS\"; did you mean \"FORM\"?"},
      {described("when = {FORM = \"RATES\"}"), "RATES is no value of FORM; there are DELTA, RATE"},
      {request("line = \"=DR,{DR}\"\n"), "set: missing: the request has a value of a setting"},
      {described("when = 1"), "give settings with their values, as {NAME = VALUE}"},
      {described("rate_hz = \"FORM\""), "the value DELTA of FORM is no rate; give Hz from 0.001 to 10000"},
      {described("rate_hz = \"HZ\""), "there is no setting \"HZ\""},
      {described("rate_hz = \"DR\"\ndivider = 2"), "give either this, or divider and phase"},
      {described("[line]\nbaud = \"FORM\""), "the value DELTA of FORM is no bit rate"},
      {described("[setting.BAD]\nvalues = []"), "give 1 to 64 allowed values"},
      {described("[setting.BAD]\nvalues = [1, \"a\"]"), "give values that are all texts, or all numbers"},
      {described("[setting.BAD]\nvalues = [1, 1]"), "the value 1 is given twice"},
      {described("[setting.BAD]\nvalues = [1]\ndelivered = 2"), "must be one of the values"},
      {described("[setting.BAD]\nvalues = [1]\ncodes = [1, 2]"), "one for each value"},
      {described("[setting.BAD]\nvalues = [1, 2]\ncodes = [1, 1]"), "the code 1 is given twice"},
      {described("[setting.BAD]\nvalues = [\"a b\"]"), "a value has printable characters without blanks"},
      {described("[setting.value]\nvalues = [1]"), "{value} means something else"},
      {described("[setting.2]\nvalues = [1]"), "does not begin with a digit"},
      {described("[setting.BAD]\nkep = true\nvalues = [1]"), "did you mean \"kept\"?"},
      {request("answer = \"x\""), "give one of line, bytes and layout"},
      {request("line = \"x\"\nbytes = \"AA\""), "give one of line, bytes and layout"},
      {request("line = \"x\"\nstreams = true"), "did you mean \"stream\"?"},
      {request("line = \"x\\n\""), "its end, CR or LF, is left out"},
      {request("line = \"{DRR}\""), "there is no setting \"DRR\"; did you mean \"DR\"?"},
      {request("line = \"{value}\""), "{value} must follow {setting}"},
      {request("line = \"{DR}{FORM}\""), "two captures need a character between them"},
      {request("line = \"{DR}0\""), "{DR} ends at '0', which is in the value 100"},
      {request("line = \"{DR\""), "a capture is {setting}"},
      {request("line = \"x\"\nset = true"), "the request captures no value; give the values"},
      {request("line = \"x\"\nset = {DR = 7}"), "set.DR: 7 is no value of DR; there are 100, 50"},
      {request("line = \"x\"\nset = {DT = 50}"), "set.DT: there is no setting \"DT\"; did you mean \"DR\"?"},
      {request("line = \"x\"\nset = {DR = [50]}"), "DR: give a value"},
      {request("line = \"x\"\nwhen = {DR = 7}"), "when.DR: 7 is no value of DR; there are 100, 50"},
      {request("line = \"x\"\nwhen = true"), "give settings with their values, as {NAME = VALUE}"},
      {request("line = \"x\"\nwhen = {DR = 50}\n[[request]]\nline = \"x\"\nwhen = {DR = [50, 100]}"),
       "matches \"x\", which the request \"x\" in line 9 matches, too"},
      {request("line = \"x\"\notherwise = \"y\""), "the request captures no value that could be wrong"},
      {request("line = \"x\"\nanswer = \"{setting}\""), "the request captures no {setting}"},
      {request("line = \"x\"\nanswer = \"{any}\""), "the request captures no {any}"},
      {request("line = \"x\"\nanswer = \"{DRR}\""), "did you mean \"DR\"?"},
      {request("line = \"x\"\nanswer = \"\""), "must not be empty"},
      {request("line = \"x\"\nanswer = \"" + std::string(1025, 'y') + "\""), "may have 1025 bytes, more than 1024"},
      {request("line = \"" + std::string(256, 'x') + "\""), "the line is longer than 255 characters"},
      {request("line = \"x\"\npoll = \"date\""), "there is no message \"date\"; did you mean \"data\"?"},
      {request("line = \"x\"\ndelay_ms = 60001"), "delay_ms"},
      {request("bytes = \"AA\"\nignore_case = true"), "only a line has letters"},
      {request("bytes = \"AA ?\""), "an element is hexadecimal bytes"},
      {request("bytes = \"??\""), "a decoder cannot find the frame"},
      {request("layout = [\"AA\", \"_:1023\"]"), "has 1024 bytes, more than 1023"},
      {request("layout = [\"AA\", \"rate_x_deg_per_s:f32\"]"), "a request has constants"},
      {request("layout = [\"AA\", \"bits:u8:0=alive_counter\"]"), "a request has constants"},
      {request("layout = [\"AA\", \"{DR}\"]"), "a setting is captured as {NAME}:TYPE"},
      {request("layout = [\"AA\", \"{DR}:i8\"]"), "the type must be unsigned"},
      {request("layout = [\"AA\", \"{FORM}:u8\"]"), "the value DELTA of FORM has no code"},
      {request("layout = [\"AA\", \"bits:u8:0-2={DR}\"]"), "the bits do not hold the code of the value 100"},
      {request("layout = [\"AA\", \"bits:u8:0-6={DR},6=1\"]"), "a bit is given twice"},
      {request("layout = [\"@a\", \"AA\", \"check:crc16/xmodm:@a..\"]"), "did you mean \"crc16/xmodem\"?"},
      {request("bytes = \"AA 01\"\nanswer = [\"AA\", \"{2}\"]"), "give bytes of the request from 0 to 1"},
      {request("bytes = \"AA 01\"\nanswer = \"AA ??\""), "an answer has no ??"},
      {request("bytes = \"AA 01\"\nanswer = [\"AA\", \"_:1024\"]"), "has 1025 bytes, more than 1024"},
      {request("line = \"x\"\nanswer = [\"AA\", \"{0}\"]"), "a line has no bytes by number"},
      {described("[unknown]\nanswer = \"x\""), "no request is a line"},
      {described("[unknown]"), "the answer to a line that no request matches"},
  };
  for (const auto& [text, wanted] : cases) {
    const std::string faults = faults_of(text);
    EXPECT_TRUE(contains(faults, wanted)) << text << "\n" << faults;
    EXPECT_TRUE(contains(faults, "test.toml:")) << faults;
  }
}

TEST(FrameRequestRefusals, TwoRequestsThatMatchTheSame) {
  const auto two = [](const std::string& first, const std::string& second) {
    return faults_of(described("[[request]]\n" + first + "\n[[request]]\n" + second + "\n"));
  };
  const std::pair<std::string, std::string> same[] = {
      {"line = \"x\"", "line = \"x\""},
      {"line = \"x\"\nignore_case = true", "line = \"X\""},
      {"line = \"={setting},{value}\"\nset = true", "line = \"=DR,50\""},
      {"line = \"=DR,50\"", "line = \"={setting},{value}\"\nset = true"},
      {"line = \"={setting},{value}\"\nset = true\notherwise = \"y\"", "line = \"=DR,7\""},
      {"line = \"={setting},{value}\"\nset = true\notherwise = \"y\"", "line = \"=DR,{any}\""},
      {"line = \"{any}\"", "line = \"x\""},
      {"bytes = \"AA 01\"", "bytes = \"AA ??\""},
      {"bytes = \"AA\"", "bytes = \"AA 01\""},
      {"layout = [\"AA\", \"{DR}:u8\"]\nset = true", "bytes = \"AA 32\""},
      {"line = \"go\"", "bytes = \"67 6F 0D\""},
  };
  for (const auto& [first, second] : same) {
    const std::string faults = two(first, second);
    EXPECT_TRUE(contains(faults, ": request ")) << first << "\n" << second << "\n" << faults;
    EXPECT_TRUE(contains(faults, "in line 9 matches, too")) << faults;
  }
  const std::pair<std::string, std::string> different[] = {
      {"line = \"={setting},{value}\"\nset = true\notherwise = \"y\"", "line = \"=CONFIG,1\""},
      {"line = \"={setting},{value}\"\nset = true", "line = \"=DR,7\""},
      {"line = \"x\"", "line = \"X\""},
      {"bytes = \"AA 01\"", "bytes = \"AA 02 ??\""},
      {"line = \"go\"", "bytes = \"67 70\""},
  };
  for (const auto& [first, second] : different) EXPECT_EQ(two(first, second), "") << first << "\n" << second;
}

TEST(FrameRequestRefusals, ConversationsThatDiffer) {
  const std::pair<std::string, const char*> cases[] = {
      {request("line = \"?{setting}\"\nanswer = \"{value}\\n\"\ntest_request = \"?DR\"\ntest_answer = \"100\\n\""),
       ""},
      {request("line = \"?{setting}\"\nanswer = \"{value}\\n\"\ntest_request = \"?DR\"\ntest_answer = \"50\\n\""),
       "test.toml:12: request \"?{setting}\": test_request: the unit answers \"100\\n\", not \"50\\n\": they differ "
       "at "
       "byte 0"},
      {request("line = \"?{setting}\"\ntest_request = \"?RATE\""), "\"?RATE\" is no request of this form"},
      {request("line = \"?{setting}\"\ntest_request = [\"?DR\", \"?FORM\"]\ntest_answer = [\"\"]"),
       "there are 1 answers to 2 requests"},
      {request("bytes = \"AA ??\"\nanswer = [\"55\", \"{1}\"]\ntest_request = \"AA 07\"\ntest_answer = \"55 07\""),
       ""},
      {request("bytes = \"AA ??\"\nanswer = [\"55\", \"{1}\"]\ntest_request = \"AA 07\"\ntest_answer = \"55 08\""),
       "the unit answers 55 07, not 55 08: they differ at byte 1"},
      {request("bytes = \"AA ??\"\nanswer = \"55\"\ntest_request = \"AA 07\""), "the unit answers 55, not nothing"},
      {request("bytes = \"AA ??\"\ntest_request = \"AA\""), "AA is no request of this form"},
      {request("bytes = \"AA ??\"\ntest_request = \"AA 0\""), "must be bytes in hexadecimal"},
  };
  for (const auto& [text, wanted] : cases) {
    const std::string faults = faults_of(text);
    EXPECT_TRUE(*wanted == '\0' ? faults.empty() : contains(faults, wanted)) << text << "\n" << faults;
  }
}

TEST(FrameRequestRefusals, AllFaultsAreReportedTogether) {
  const std::string faults =
      faults_of(described("when = {DT = 1}\n[[request]]\nline = \"{F}\"\n[[request]]\n"
                          "layout = [\"AA\", \"rate:u8\", \"{DR}:u4\"]\n"));
  EXPECT_TRUE(contains(faults, "test.toml:9: message \"data\": when.DT: ")) << faults;
  EXPECT_TRUE(contains(faults, "request \"{F}\": there is no setting \"F\"")) << faults;
  EXPECT_TRUE(contains(faults, ": \"rate:u8\": there is no quantity \"rate\"")) << faults;
  EXPECT_TRUE(contains(faults, ": \"{DR}:u4\": there is no type \"u4\"")) << faults;
}

}  // namespace
}  // namespace imud
