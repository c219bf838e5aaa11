// Faults of descriptions: each is reported with its line, its place, and what would be right.
#include "tests/protocols/frames/frame_unit.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

TEST(FrameRefusals, ElementsThatCannotBe) {
  const std::pair<const char*, const char*> cases[] = {
      {"AA\nrate_x_dps:f32", "there is no quantity \"rate_x_dps\"; the units of rate_x are _rad_per_s _deg_per_s"},
      {"AA\nspecific_fore_x_g:f32", "did you mean \"specific_force_x_g\"?"},
      {"AA\nrate_x_deg_per_s:f16", "there is no type \"f16\"; give u8, u16, u24"},
      {"AA\nrate_x_deg_per_s:", "there is no type \"\""},
      {"AA\nrate_x_deg_per_s:i16*0", "the LSB after * must not be 0"},
      {"AA\nrate_x_deg_per_s:i16*1/0", "must be a finite number"},
      {"AA\nrate_x_deg_per_s:i16*3^2", "must be one of two, such as 2^20"},
      {"AA\nrate_x_deg_per_s:i16*0.1x", "what follows the type must be *LSB, +OFFSET"},
      {"AA\nrate_x_deg_per_s:f32 carry", "only an integer that is rounded has a remainder to carry"},
      {"AA\nrate_x_deg_per_s:f32 floor",
       "only an integer that is rounded, and carries no remainder, is rounded down"},
      {"AA\nlength:u8:@a..@ floor", "only a field is rounded down"},
      {"AA\nrate_x_deg_per_s:i16 be le", "give one byte order"},
      {"AA\n_=1", "after _= come the bytes that are sent, in hexadecimal, as in _=12 34"},
      {"AA\n_:4 be", "bytes that are 0 have no byte order"},
      {"AA\npad:4 carry", "only a field has a remainder to carry"},
      {"AA\nsample_counter:u8*2", "a counter or a status is an integer, without LSB and offset"},
      {"AA\nsample_counter%300:u8", "the field does not hold numbers up to the modulus"},
      {"AA\nsample_counter%2.5:u8", "the modulus of a counter must be a whole number"},
      {"AA\nyaw_deg%-1:u16", "the modulus after % must be a positive number"},
      {"AA\ntime_ms:u16*0.0000001", "a clock needs an LSB of whole nanoseconds"},
      {"AA\ntime_ms%70000:u16", "the modulus must be a whole number of LSBs that the field holds"},
      {"AA\nnot_valid:u8", "one bit of the status is given as bits:u8:0=NAME"},
      {"AA\nbits:u8:8=1", "give bits from 0 to 7, the lower one first"},
      {"AA\nbits:u8:3-1=1", "give bits from 0 to 7, the lower one first"},
      {"AA\nbits:u8:0=1,0=1", "a bit is given twice"},
      {"AA\nbits:u8:0=2", "the constant is too large for the bits"},
      {"AA\nbits:u8:0=gyro_saturatd", "did you mean \"gyro_saturated\"?"},
      {"AA\nbits:u8:0-1=not_valid", "give one bit"},
      {"AA\nbits:u8:0-7=temperature_c", "give one bit"},
      {"AA\nbits:u8:0=temperature_c<warm", "the limit of a bit must be a number"},
      {"AA\nbits:u8:0=not_valid<1", "only a quantity that is a number has a limit"},
      {"AA\nbits:u8:0=yaw_deg%360", "a bit has no modulus"},
      {"AA\nbits:u8:0=!sample_counter", "only a bit of the status or of a quantity has an inverse"},
      {"AA\nbits:i8:0=1", "the type must be unsigned"},
      {"@a\nAA\nlength:u8:@b..@", "there is no label \"@b\""},
      {"@payload\nAA\nlength:u8:@paylod..@", "did you mean \"@payload\"?"},
      {"@a\nAA\nlength:u8:@a..", "a length ends at a label, or at @, the end of the frame"},
      {"@a\nAA\nlength:u8:@a..@-9", "the type does not hold the length"},
      {"@a\nAA BB\nlength:u8/2:@a..@", "the range has 3 bytes"},
      {"@a\nAA\n_:300\nlength:u8:@a..@", "the type does not hold the length, 302"},
      {"@a\nAA\n@b\nlength:u8:@b..@a", "begins after its end"},
      {"AA\ncheck:sum8:@d..\n@d\nalive_counter:u8", "without an end it ends at the check; @d..@ ends with the frame"},
      {"@a\nAA\ncheck:crc16/xmodm:@a..", "did you mean \"crc16/xmodem\"?"},
      {"@a\nAA\ncheck:crc16/xmodem:@a..@", "the range contains the check itself"},
      {"@a\nAA\ncheck:crc16/xmodem:@a", "a range is @FROM..@TO"},
      {"@a\nAA\ncheck:sum16/16:@a..", "no whole number of words of 16 bits"},
      {"@a\nAA\ncheck:sum8:@a..:+0G", "after :+ come bytes in hexadecimal"},
      {"@a\ncheck:sum8:@b..@\n@b\ncheck:sum8:@a..", "two checks contain one another"},
      {"@a\n@a\nAA", "the label is given twice"},
      {"@\nAA", "a label is @ and a name"},
      {"\"\"", "a text is in quotes and not empty"},
      {"AA\nfoo", "an element is hexadecimal bytes"},
      {"A", "an element is hexadecimal bytes"},
      {"AA\n_:0", "from 1 to 4096"},
      {"AA\n_:4096", "the longest has 4096"},
      {"rate_x_deg_per_s:f32", "a decoder cannot find the frame"},
      {"bits:u8:0-3=5\nrate_x_deg_per_s:f32", "a decoder cannot find the frame"},
  };
  for (const auto& [elements, wanted] : cases) {
    const std::string faults = faults_of(one_message(elements));
    EXPECT_TRUE(contains(faults, wanted)) << elements << "\n" << faults;
    EXPECT_TRUE(contains(faults, "test.toml:")) << faults;
  }
}

TEST(FrameRefusals, KeysThatCannotBe) {
  const std::string good = one_message("AA\nrate_x_deg_per_s:f32");
  EXPECT_EQ(faults_of(good), "");
  const std::pair<std::string, const char*> cases[] = {
      {"name = \"x\"\n", "frame_version: missing; give 1"},
      {"x = [", "TOML"},
      {good + "ratehz = 5", "did you mean \"rate_hz\"?"},
      {good + "rate_hz = 5\ndivider = 2", "give either this, or divider and phase"},
      {"line = {parity = \"odd\"}\n" + good, "line.parity: give baud, too"},
      {"line = {stop_bits = 2}\n" + good, "line.stop_bits: give baud, too"},
      {"escape = \"slip\"\n" + good + "[[request]]\nbytes = \"01\"\nanswer = [\"02\"]",
       "requests that are escaped are not read; leave escape or the requests out"},
      {"rate_hz = 20\n" + one_message("AA\nrate_x_deg_per_s:f32", "rate_hz = 50"),
       "rate_hz: message \"m\" is sent at 50 Hz, and no more often than there are samples; give at least that"},
      {good + "divider = 2\nphase = 2", "must be less than divider"},
      {good + "divider = 2\nphase = [0, 2]", "must be less than divider"},
      {good + "divider = 2\nphase = [0, 0]", "1 to 1024 different numbers"},
      {good + "divider = 2\nphase = []", "1 to 1024 different numbers"},
      {good + "divider = 0", "give 1 for every sample"},
      {good + "byte_order = \"middle\"", "byte_order"},
      {one_message("AA\nrate_x_rad_per_s:i16*0.1+1 carry", "test_frame = \"AA 00 00\""),
       "differs at byte 1, in rate_x_rad_per_s (i16 le at 1)"},
      {good + "test_frame = \"AA 0\"", "must be bytes in hexadecimal"},
      {good + "test_frame = \"AA 00 00 00\"", "has 4 bytes, but the layout 5"},
      {good + "test_values = {rate_x_deg_per_s = 1}", "give the test_frame that has these values"},
      {good + "test_frame = [\"AA 00 00 00 00\", \"AA 00 00 80 40\"]\ntest_values = [{}, {rate_x_deg_per_s = 3}]",
       "test_values give 00 00 40 40"},
      {good + "test_frame = [\"AA 00 00 00 00\"]\ntest_values = [{}, {}]", "there are 2 tables for 1 frames"},
      {good + "test_frame = [1]", "give the frame as a text, or a list of frames"},
      {good + "test_frame = \"AA 00 00 00 00\"\ntest_values = {rate_y_deg_per_s = 1}",
       "the message does not carry it; its fields are rate_x_deg_per_s"},
      {good + "test_frame = \"AA 00 00 00 00\"\ntest_values = {rate_x_dps = 1}",
       "there is no quantity \"rate_x_dps\""},
      {good + "test_frame = \"AA 00 00 00 00\"\ntest_values = {rate_x_deg_per_s = \"1\"}", "give a finite number"},
      {good + "test_frame = \"AA 00 00 80 40\"\ntest_values = {rate_x_deg_per_s = 3}",
       "differs at byte 3, in rate_x_deg_per_s (f32 le at 1): it has 00 00 80 40, test_values give 00 00 40 40, "
       "which "
       "mean 4 and 3"},
      {good + "[line]\nbaud = -1", "baud"},
      {good + "[line]\nstop_bits = 0", "give 1 or 2"},
      {good + "[check.crc16]\nwidth = 15\npoly = 1", "give 8, 16, 24"},
      {good + "[check.sum8]\nwidth = 8\npoly = 1", "give another name"},
      {good + "[check.mine]\nwidth = 8\npoly = 0x100", "poly"},
      {"frame_version = 2\nname = \"x\"\nmessage = 1", "this imud reads version 1"},
      {"frame_version = 1\nname = \"x\"\n", "at least one [[message]]"},
      {"frame_version = 1\nname = \"x\"\n[[message]]\nlayout = [1]", "give a list of texts"},
      {"frame_version = 1\nname = \"x\"\n[[message]]\nlayout = []", "give a list of texts"},
  };
  for (const auto& [text, wanted] : cases) {
    const std::string faults = faults_of(text);
    EXPECT_TRUE(contains(faults, wanted)) << text << "\n" << faults;
  }
}

TEST(FrameRefusals, AllFaultsAreReportedTogether) {
  EXPECT_EQ(
      faults_of(one_message("AA\nrate_q_deg_per_s:f32\nfoo\nrate_x_deg_per_s:f33")),
      "test.toml:8: message \"m\": \"rate_q_deg_per_s:f32\": there is no quantity \"rate_q_deg_per_s\"; did you "
      "mean \"rate_z_deg_per_s\"?\n"
      "test.toml:9: message \"m\": \"foo\": an element is hexadecimal bytes, a '\"text\"', a @label, or "
      "NAME:TYPE, such as rate_x_deg_per_s:i16*0.01\n"
      "test.toml:10: message \"m\": \"rate_x_deg_per_s:f33\": there is no type \"f33\"; give u8, u16, u24, u32, "
      "u64, i8, i16, i24, i32, i64, f32 or f64");
}

// A captured frame has bytes that the layout leaves open: they may have any value, and the check is of them.
TEST(FrameRefusals, ATestFrameMayHaveAnythingInUnusedBytes) {
  const auto faults = [](const std::string& frame) {
    return faults_of(one_message("@a\nAA\n_:2\nalive_counter:u8\ncheck:sum8:@a..",
                                 "test_frame = \"" + frame + "\"\ntest_values = {alive_counter = 3}\n"));
  };
  EXPECT_EQ(faults("AA 12 34 03 F3"), "");
  EXPECT_EQ(faults("AA 00 00 03 AD"), "");
  EXPECT_TRUE(contains(faults("AA 12 34 03 F4"), "differs at byte 4, in check sum8")) << faults("AA 12 34 03 F4");
  EXPECT_TRUE(contains(faults("AA 12 34 04 F4"), "differs at byte 3")) << faults("AA 12 34 04 F4");
}

// The check differs wherever anything else does: the other element is named. Of a wrong check those that fit are.
TEST(FrameRefusals, ATestFrameThatDiffersSaysWhere) {
  const auto faults = [](const std::string& check, const std::string& values, const std::string& more = "") {
    return faults_of(one_message(
        "55 AA\ncheck:" + check + "\n@data\nrate_x_deg_per_s:i16*0.01\n" + "rate_y_deg_per_s:i16*0.01" + more,
        "test_frame = \"55 AA 33 FB E8 03 30 F8\"\ntest_values = {" + values + "}\n"));
  };
  const std::string right = "crc16/xmodem:@data..@ be", good = "rate_x_deg_per_s = 10, rate_y_deg_per_s = -20";
  const std::pair<std::string, const char*> cases[] = {
      {faults(right, "rate_x_deg_per_s = 10, rate_y_deg_per_s = 20"),
       "in rate_y_deg_per_s (i16 le at 6): it has 30 F8, test_values give D0 07, which mean -20 and 20"},
      {faults(right, "rate_x_deg_per_s = -10, rate_y_deg_per_s = 20"),
       "differs at byte 4, in rate_x_deg_per_s (i16 le at 4): it has E8 03, test_values give 18 FC, which mean 10 "
       "and -10; so do rate_y"},
      {faults("crc16/xmodem:@data..@", good),
       "differs at byte 2, in check crc16/xmodem of 4-7 (u16 le at 2): it has 33 FB, test_values give FB 33; over "
       "this range crc16/xmodem be would be right"},
      {faults("crc16/kermit:@data..@", good), "; over this range crc16/xmodem be would be right"},
      {faults("crc16/xmodem:@data..@data+1 be", good), "there is no label"},
      {faults("sum16:@data..@:+01 be", good),
       "; no check that is known gives it over this range: try another range, or describe a CRC as [check.NAME]"},
      {faults(right, good, "\nrate_z_deg_per_s:i16*0.01"),
       "has 8 bytes, but the layout 10; they agree up to byte 8, in rate_z_deg_per_s (i16 le at 8)"},
      {faults_of(one_message("55 AA\nlength:u8:@data..@\n@data\nrate_x_deg_per_s:f32\nrate_y_deg_per_s:f32",
                             "test_frame = \"55 AA 06 00 00 00 00 05 00\"\ntest_values = {rate_y_deg_per_s = 1}\n")),
       "has 9 bytes, but the layout 11; they agree up to byte 7, in rate_y_deg_per_s (f32 le at 7)"},
  };
  EXPECT_EQ(faults(right, good), "");
  for (const auto& [got, wanted] : cases) EXPECT_TRUE(contains(got, wanted)) << got << "\n" << wanted;
}

}  // namespace
}  // namespace imud
