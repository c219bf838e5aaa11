// A record that an older build has made repeats byte for byte. Files: tests/emulator/record/stored.
//
// Made by imud and imu-truth at commit c956d1a:
//   imud run run.toml --record realtime.pcapng --wait-for-reader
//   imu-truth spiral --to udp:127.0.0.1:9810 --rate 50 --for 0.5
// run.toml is in the record: `imud check realtime.pcapng --toml` prints it. A VectorNav `vn` sends to a pty, whose
// host asked for register 1 at 0.2 s and wrote register 6 at 0.3 s; a native imu `nat` with a fault of gyro.x writes
// to a file. At 0.25 s, 0.35 s and 0.4 s:
//   imud ctl set 'imu.nat.gyro.bias_rad_per_s=[0.1,0,0]'
//   imud ctl mark text=here
//   imud ctl power imu=nat state=cycle
// vn.bin is the bytes that the reader of the pty got, nat.bin the file of the native imu.
#include "tests/emulator/run/run_test.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

using StoredRecord = RunTest;

TEST_F(StoredRecord, RepeatsByteForByte) {
  const std::string stored = IMUD_TEST_DATA "/emulator/record/stored/", record = stored + "realtime.pcapng";
  const ProgramResult result =
      run_program("imud", {"replay", record, record, "--fast", "--set", "imu.vn.port=file:" + path("vn"), "--set",
                           "imu.nat.port=file:" + path("nat"), "--set", "control.socket=none"});
  EXPECT_EQ(result.exit_code, 0) << result.errors;
  EXPECT_TRUE(contains(result.output, "349 samples, 20 frames sent, 0 dropped")) << result.output;
  for (const std::string imu : {"vn", "nat"}) {
    const std::string expected = read_file(stored + imu + ".bin");
    ASSERT_GT(expected.size(), 1000U);
    EXPECT_TRUE(read_file(path(imu)) == expected) << imu;
  }
}

// Made at commit d91d14ec, before the inclinometers of a STIM300 had errors of their own: `imud replay` of 0.1 s of
// `imu-truth spiral`. They repeat what the accelerometers measure, unless the configuration gives them errors.
TEST_F(StoredRecord, KeepsTheInclinometersOfItsTime) {
  const std::string stored = IMUD_TEST_DATA "/emulator/record/stored/", record = stored + "stim300.pcapng";
  const auto repeat = [&](const std::vector<std::string>& more) {
    std::vector<std::string> words = {"replay", record,  record,
                                      "--fast", "--set", "imu.stim.port=file:" + path("out")};
    words.insert(words.end(), more.begin(), more.end());
    const ProgramResult result = run_program("imud", words);
    EXPECT_EQ(result.exit_code, 0) << result.errors;
    return read_file(path("out"));
  };
  const std::string expected = read_file(stored + "stim300.bin");
  ASSERT_GT(expected.size(), 700U);
  EXPECT_TRUE(repeat({}) == expected);
  EXPECT_FALSE(repeat({"--set", "imu.stim.inclinometer.bias_mg=1"}) == expected);
}

}  // namespace
}  // namespace imud
