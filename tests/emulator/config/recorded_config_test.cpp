// The configuration in a record: what it is, and which others are refused.
#include "emulator/config/recorded_config.hpp"

#include "emulator/plan/config.hpp"
#include "tests/emulator/run/run_test.hpp"

namespace imud {
namespace {

class RecordedConfig : public RunTest {
 protected:
  void SetUp() override {
    ASSERT_EQ(
        run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--rate", "100", "--for", "2"}).exit_code, 0);
    config_ = config("fast", "file:" + path("truth.csv"), "csv", 200, "native", "file:" + path("out"));
    const auto made =
        run_program("imud", {"replay", config_, path("truth.csv"), "--set", "seed=5", "--record", record()});
    ASSERT_EQ(made.exit_code, 0) << made.errors;
  }
  std::string record() const { return path("run.pcapng"); }
  ProgramResult repeat(const std::string& config, std::vector<std::string> more = {}) const {
    more.insert(more.begin(), {"replay", config, record(), "--fast"});
    return run_program("imud", more);
  }
  std::string config_;
};

TEST_F(RecordedConfig, IsThatOfItsRun) {
  const auto of_file = run_program("imud", {"check", config_, "--toml", "--set", "seed=5"});
  EXPECT_EQ(run_program("imud", {"check", record(), "--toml"}).output, of_file.output);
  EXPECT_EQ(recorded_config(record()), of_file.output);
  EXPECT_EQ(recorded_config(config_), std::nullopt);
  const std::string sent = read_file(path("out"));
  EXPECT_EQ(repeat(record(), {"--set", "imu.0.port=file:" + path("again")}).exit_code, 0);
  EXPECT_TRUE(read_file(path("again")) == sent);
}

TEST_F(RecordedConfig, AnotherIsRefusedByKey) {
  const auto refused = repeat(config_);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_NE(refused.errors.find("run.pcapng: seed: 1, but 5 in the recorded run; give the same, or another by --set"),
            std::string::npos)
      << refused.errors;
  EXPECT_NE(refused.errors.find("1 fault"), std::string::npos) << refused.errors;
  const std::string text = "seed = 5\nrealtime.priority = 0\n" + read_file(config_).substr(9);
  EXPECT_EQ(repeat(write("ports.toml", text + "pace = \"none\"\n")).exit_code, 0);
  const auto errors =
      repeat(write("errors.toml", text + "gyro.bias_rad_per_s = [0, 1, 0]\nname = \"imu1\"\n")).errors;
  EXPECT_NE(errors.find("imu.imu1.gyro.bias_rad_per_s: [ 0.0, 1.0, 0.0 ], but [ 0.0, 0.0, 0.0 ] in"),
            std::string::npos)
      << errors;
}

TEST_F(RecordedConfig, OverridesAreOnPurpose) {
  const std::string sent = read_file(path("out"));
  const auto other = repeat(config_, {"--set", "seed=6", "--set", "imu.0.gyro.bias_rad_per_s=[0,1,0]"});
  EXPECT_EQ(other.exit_code, 0) << other.errors;
  EXPECT_EQ(read_file(path("out")).size(), sent.size());
  EXPECT_FALSE(read_file(path("out")) == sent);
}

// The times of the file's head are those of the run.
TEST_F(RecordedConfig, ARepetitionEndsByFor) {
  const auto whole = repeat(record(), {"--for", "1000"});
  EXPECT_EQ(whole.exit_code, 0) << whole.errors;
}

TEST_F(RecordedConfig, OfAnOlderRecordIsAskedFor) {
  std::string bytes = read_file(record());
  // The blocks of the configuration become ones that every reader skips.
  for (std::size_t at = 0; at + 12 < bytes.size();) {
    std::uint32_t type = 0, length = 0, interface = 0;
    std::memcpy(&type, &bytes[at], 4);
    std::memcpy(&length, &bytes[at + 4], 4);
    std::memcpy(&interface, &bytes[at + 8], 4);
    if (type == 6 && interface == 1) bytes[at] = 0x7F;
    at += length;
  }
  std::filesystem::remove(record());
  write("run.pcapng", bytes);
  const auto alone = run_program("imud", {"check", record()});
  EXPECT_EQ(alone.exit_code, 2);
  EXPECT_NE(alone.errors.find("configuration: is not in this record; give that of its run"), std::string::npos)
      << alone.errors;
  EXPECT_EQ(repeat(config_).exit_code, 0) << "there is nothing to compare with";
}

}  // namespace
}  // namespace imud
