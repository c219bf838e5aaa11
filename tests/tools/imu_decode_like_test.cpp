// With --like, imu-decode takes the protocol and its settings from an imu of a configuration. A path without a scheme
// is a file.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/support/text.hpp"
#include "tests/tools/run_program.hpp"
#include "tests/tools/sample_stream.hpp"
#include "tests/transports/capture_builder.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

class ImuDecodeLikeTest : public ::testing::Test {
 protected:
  // Two imus; the second sends by its own identifier.
  std::string config() const {
    const std::string rest = "rate_hz = 100\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n";
    capture::write_file(folder_ / "imu.toml",
                        fmt::format("clock = \"fast\"\n[truth]\nport = \"file:truth.csv\"\nformat = \"csv\"\n"
                                    "[[imu]]\nname = \"a\"\nprotocol = \"native\"\nport = \"file:{}\"\n{}"
                                    "[[imu]]\nname = \"b\"\nprotocol = \"native-can\"\nport = \"canfile:{}\"\n"
                                    "device.can_id = 0x321\n{}",
                                    folder_ / "a.bin", rest, folder_ / "b.log", rest));
    capture::write_file(folder_ / "truth.csv",
                        "time_ns,sigma_BN_1,sigma_BN_2,sigma_BN_3,omega_BN_B_x,omega_BN_B_y,omega_BN_B_z,"
                        "nonConservativeAccelpntB_B_x,nonConservativeAccelpntB_B_y,nonConservativeAccelpntB_B_z\n"
                        "0,0,0,0,0.5,0,0,0,0,-9.8\n1000000000,0,0,0,0.5,0,0,0,0,-9.8\n");
    const ProgramResult made = run_program("imud", {"replay", folder_ / "imu.toml", folder_ / "truth.csv", "-q"});
    EXPECT_EQ(made.exit_code, 0) << made.errors;
    return folder_ / "imu.toml";
  }
  const ScratchFolder folder_;
};

TEST_F(ImuDecodeLikeTest, DecodesWhatTheImuSends) {
  const std::string file = config(), a = folder_ / "a.bin", b = folder_ / "b.log";
  const ProgramResult first = run_program("imu-decode", {"--like", file, a});
  EXPECT_EQ(first.output, run_program("imu-decode", {"native", "file:" + a}).output) << first.errors;
  EXPECT_TRUE(contains(first.errors, "like a of " + file + ": native at 100 Hz\nsamples    101 in 1.000 s\n"))
      << first.errors;
  const ProgramResult second = run_program("imu-decode", {"--like", file, "--imu", "b", b});
  EXPECT_EQ(second.output, run_program("imu-decode", {"native-can", "canfile:" + b, "--set", "can_id=0x321"}).output);
  EXPECT_TRUE(contains(second.errors, "samples    101 in")) << second.errors;
  const ProgramResult other = run_program("imu-decode", {"--like", file, "--imu", "b", b, "--set", "can_id=0x322"});
  EXPECT_EQ(other.exit_code, 1) << other.errors;
}

TEST_F(ImuDecodeLikeTest, NamesWhatIsWrong) {
  const std::string file = config(), a = folder_ / "a.bin";
  const auto errors = [](const std::vector<std::string>& arguments) {
    const ProgramResult result = run_program("imu-decode", arguments);
    EXPECT_EQ(result.exit_code, 2) << result.errors;
    return result.errors;
  };
  EXPECT_TRUE(
      contains(errors({"--like", file, "--imu", "c", a}), "has no imu c; there are a (native), b (native-can)"));
  EXPECT_TRUE(contains(errors({"--like", file, "native", a}), "--like excludes PROTOCOL"));
  EXPECT_TRUE(contains(errors({"--like", file}), "PORT is required"));
  EXPECT_TRUE(contains(errors({"--like", folder_ / "none.toml", a}), "none.toml"));
  EXPECT_TRUE(contains(errors({"--like", file, a, "--json", file}), file + ": is "));
}

// The content of a file tells its format; a CAN protocol has a log.
TEST_F(ImuDecodeLikeTest, AFileNeedsNoScheme) {
  config();
  const std::string a = folder_ / "a.bin", b = folder_ / "b.log", renamed = folder_ / "b.txt";
  capture::write_file(renamed, read_file(b));
  EXPECT_TRUE(contains(run_program("imu-decode", {"native", a, "--quiet"}).errors, "samples    101 in"));
  for (const std::string& log : {b, renamed})
    EXPECT_TRUE(contains(run_program("imu-decode", {"native-can", log, "--set", "can_id=0x321", "--quiet"}).errors,
                         "samples    101 in"))
        << log;
  EXPECT_TRUE(contains(run_program("imu-decode", {"native", "none.bin"}).errors, "no scheme before a colon"));
}

}  // namespace
}  // namespace imud
