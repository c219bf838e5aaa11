// A run of imud with a description, decoded by imu-decode with the same file.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>

#include "core/units.hpp"
#include "tests/support/text.hpp"
#include "tests/tools/run_program.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

constexpr std::string_view description = R"(
frame_version = 1
name = "mine"
[[message]]
name = "data"
layout = ["55 AA", "@a", "time_us:u32", "sample_counter:u8",
  "rate_x_deg_per_s:i24*1e-4", "rate_y_deg_per_s:i24*1e-4", "rate_z_deg_per_s:i24*1e-4",
  "specific_force_x_mg:i16", "specific_force_y_mg:i16", "specific_force_z_mg:i16", "check:crc16/xmodem:@a.. be"]
)";

// A turn about z at 0.3 rad/s, for 2 s.
std::string truth() {
  std::ostringstream text;
  text.precision(17);
  text << "time_ns,sigma_BN_1,sigma_BN_2,sigma_BN_3,omega_BN_B_x,omega_BN_B_y,omega_BN_B_z,"
          "nonConservativeAccelpntB_B_x,nonConservativeAccelpntB_B_y,nonConservativeAccelpntB_B_z\n";
  for (int k = 0; k <= 200; ++k)
    text << k * 10'000'000 << ",0,0," << std::tan(0.3 * 0.01 * k / 4) << ",0,0,0.3,0,1,-9.80665\n";
  return text.str();
}

void write(const std::string& path, std::string_view text) { std::ofstream(path, std::ios::binary) << text; }

TEST(ImuDecodeFrame, DecodesARunByItsDescription) {
  const ScratchFolder folder;
  write(folder / "mine.toml", description);
  write(folder / "truth.csv", truth());
  std::ostringstream config;
  config << "clock = \"fast\"\n[truth]\nport = \"file:" << (folder / "truth.csv") << "\"\nformat = \"csv\"\n"
         << "accumulated_dv = \"none\"\n"
         << "[[imu]]\nname = \"imu1\"\nprotocol = \"frame\"\nrate_hz = 100\nmodel = \"ideal\"\n"
         << "port = \"file:" << (folder / "out.bin") << "\"\ndevice.frame_file = \"" << (folder / "mine.toml")
         << "\"\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n"
         // Settings that are lost are those of the host: the description stays.
         << "[[fault]]\nimu = \"imu1\"\ntarget = \"power\"\nkind = \"settings_lost\"\nat_s = 0.5\n";
  write(folder / "imud.toml", config.str());
  const auto checked = run_program("imud", {"check", folder / "imud.toml"});
  EXPECT_EQ(checked.exit_code, 0) << checked.errors;
  EXPECT_TRUE(contains(checked.output, "mine, message \"data\": 24 bytes, with every sample")) << checked.output;
  EXPECT_TRUE(contains(checked.output, "     7  i24 le    1e-04  deg_per_s  rate_x\n")) << checked.output;
  const auto run = run_program("imud", {"run", folder / "imud.toml"});
  EXPECT_EQ(run.exit_code, 0) << run.errors;
  const auto decoded = run_program("imu-decode", {"frame", "file:" + (folder / "out.bin"), "--frame-file",
                                                  folder / "mine.toml", "--require", "gaps=0"});
  EXPECT_EQ(decoded.exit_code, 0) << decoded.errors;
  EXPECT_TRUE(contains(decoded.errors, "rate       100.000 Hz (device clock)\n")) << decoded.errors;
  EXPECT_TRUE(contains(decoded.errors, "checksum   0 failures, 0 malformed, 0 incomplete, 0 bytes skipped\n"))
      << decoded.errors;
  std::istringstream rows(decoded.output);
  std::string row;
  std::getline(rows, row);
  std::size_t count = 0;
  while (std::getline(rows, row)) {
    std::vector<double> numbers;
    std::istringstream fields(row);
    for (std::string field; std::getline(fields, field, ',');)
      numbers.push_back(field.empty() ? 0 : std::stod(field));
    ASSERT_GE(numbers.size(), 8U) << row;
    EXPECT_EQ(numbers[0], 1e7 * static_cast<double>(count)) << row;
    EXPECT_EQ(numbers[1], static_cast<double>(count)) << row;
    EXPECT_EQ(numbers[2], 0) << row;
    EXPECT_NEAR(numbers[4], 0.3, 1e-4 * units::degree) << row;
    EXPECT_NEAR(numbers[6], 1, 1e-3 * units::standard_gravity) << row;
    EXPECT_NEAR(numbers[7], -9.80665, 1e-3 * units::standard_gravity) << row;
    ++count;
  }
  EXPECT_EQ(count, 201U);
}

// The file gives the bit rate of the line, unless the configuration does.
TEST(ImuDecodeFrame, ALineCarriesWhatIsDescribed) {
  const ScratchFolder folder;
  write(folder / "imud.toml",
        "[truth]\nport = \"udp:127.0.0.1:0\"\n[[imu]]\nprotocol = \"frame\"\nrate_hz = 100\nport = \"pty:imu\"\n"
        "device.frame_file = \"hipnuc\"\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n");
  const auto check = [&](const std::string& setting) {
    return run_program("imud", {"check", folder / "imud.toml", "--set", setting});
  };
  EXPECT_TRUE(contains(check("seed=1").output, "71.2 % of the line's 115200 bit/s"));
  EXPECT_TRUE(contains(check("imu.0.device.baud=230400").output, "35.6 % of the line's 230400 bit/s"));
  EXPECT_TRUE(contains(check("imu.0.rate_hz=200").errors, "142.4 % of the line's 115200 bit/s"));
  EXPECT_TRUE(contains(check("imu.0.device.frame_file=hipnuk").errors, "did you mean \"hipnuc\"?"));
  write(folder / "slow.toml",
        "frame_version = 1\nname = \"x\"\n[[message]]\nrate_hz = 150\nlayout = [\"AA\", \"rate_x_deg_per_s:f32\"]\n");
  EXPECT_TRUE(contains(check("imu.0.device.frame_file=" + (folder / "slow.toml")).errors,
                       "slow.toml: line 3: message \"1\": rate_hz is 150, but with rate_hz = 100"));
}

TEST(ImuDecodeFrame, DecodesAShippedDescriptionByItsName) {
  const ScratchFolder folder;
  write(folder / "truth.csv", truth());
  write(folder / "imud.toml", "clock = \"fast\"\n[truth]\nport = \"file:" + (folder / "truth.csv") +
                                  "\"\nformat = \"csv\"\naccumulated_dv = \"none\"\n[[imu]]\nname = \"imu1\"\n"
                                  "protocol = \"hg4930\"\nrate_hz = 100\nport = \"file:" +
                                  (folder / "out.bin") + "\"\n");
  const auto checked = run_program("imud", {"check", folder / "imud.toml"});
  EXPECT_TRUE(contains(checked.output, "imu1     hg4930 at 100 Hz to ")) << checked.output << checked.errors;
  EXPECT_TRUE(contains(checked.output, "errors of the model hg4930-ca51: Honeywell HG4930 CA51")) << checked.output;
  EXPECT_EQ(run_program("imud", {"run", folder / "imud.toml"}).exit_code, 0);
  const auto decoded =
      run_program("imu-decode", {"hg4930", "file:" + (folder / "out.bin"), "--quiet", "--require", "checksum=0"});
  EXPECT_EQ(decoded.exit_code, 0) << decoded.errors;
  EXPECT_EQ(decoded.errors, run_program("imu-decode", {"frame", "file:" + (folder / "out.bin"), "--quiet",
                                                       "--frame-file", "hg4930", "--require", "checksum=0"})
                                .errors);
  const auto both =
      run_program("imu-decode", {"hg4930", "file:" + (folder / "out.bin"), "--frame-file", folder / "mine.toml"});
  EXPECT_EQ(both.exit_code, 2);
  EXPECT_TRUE(contains(both.errors, "frame_file: protocol \"hg4930\" has its description; omit the key"))
      << both.errors;
  EXPECT_TRUE(contains(run_program("imu-decode", {"hg4390", "file:" + (folder / "out.bin")}).errors,
                       "did you mean 'hg4930'?"));
  EXPECT_TRUE(contains(run_program("imu-decode", {"--help"}).output, "  hg4930           Honeywell HG4930\n"));
}

TEST(ImuDecodeFrame, ReportsEveryFaultOfADescription) {
  const ScratchFolder folder;
  write(folder / "mine.toml",
        "frame_version = 1\nname = \"x\"\n[[message]]\nlayout = [\"AA\", \"rate:f32\",\n\"b\"]\n");
  const auto result =
      run_program("imu-decode", {"frame", "file:/dev/null", "--set", "frame_file=" + (folder / "mine.toml")});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_TRUE(contains(result.errors, "mine.toml:4: message \"1\": \"rate:f32\": ")) << result.errors;
  EXPECT_TRUE(contains(result.errors, "mine.toml:5: message \"1\": \"b\": ")) << result.errors;
}

}  // namespace
}  // namespace imud
