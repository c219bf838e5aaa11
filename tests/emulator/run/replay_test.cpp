// imud replay: the regression files, determinism, captures that are cut short.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstring>

#include "tests/emulator/run/run_test.hpp"
#include "tests/support/compressed.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

const std::string regression = IMUD_TEST_DATA "/regression/jsbsim_c172_10s";
const std::string flight = IMUD_TEST_DATA "/captures/jsbsim_c172_10s.pcap";

class ReplayTest : public RunTest {};

TEST_F(ReplayTest, TheFlightByteForByte) {
  const ProgramResult result =
      run_program("imud", {"replay", regression + ".toml", flight, "--set", "imu.0.port=file:" + path("native"),
                           "--set", "imu.1.port=file:" + path("csv"), "--summary", path("summary.json")});
  ASSERT_EQ(result.exit_code, 0) << result.errors;
  EXPECT_TRUE(read_file(path("native")) == read_file(regression + "_every_effect.native"));
  EXPECT_TRUE(read_file(path("csv")) == read_file(regression + "_ideal.csv"));
  const auto s = summary();
  EXPECT_EQ(s["truth"]["received"], 2002);
  EXPECT_EQ(s["truth"]["accepted"], 2001);
  EXPECT_EQ(s["truth"]["no_state"], 1);
  EXPECT_TRUE(s["truth"]["refused"].empty());
  EXPECT_EQ(s["imus"][0]["name"], "every-effect");
  EXPECT_EQ(s["imus"][0]["samples"], 2001);
  EXPECT_EQ(s["imus"][0]["frames"], 2001);
  EXPECT_EQ(s["imus"][0]["dropped"], 0);
  EXPECT_EQ(s["imus"][1]["samples"], 601);
  EXPECT_TRUE(s["imus"][0]["lateness_us"].contains("p999"));
}

// As the capture itself; damage is a reason for exit code 3.
TEST_F(ReplayTest, ACompressedFlightByteForByte) {
  const std::string bytes = read_file(flight);
  for (const auto& [name, file] :
       {std::pair<std::string, std::string>{"flight.pcap.gz", gzip(bytes)}, {"flight.zst", zstd(bytes)}}) {
    const auto replay = [&](const std::string& capture) {
      return run_program(
          "imud", {"replay", regression + ".toml", capture, "--set", "imu.0.port=file:" + path("native"), "--set",
                   "imu.1.port=file:" + path("csv"), "--summary", path("summary.json")});
    };
    const ProgramResult whole = replay(write(name, file));
    ASSERT_EQ(whole.exit_code, 0) << whole.errors;
    EXPECT_TRUE(read_file(path("native")) == read_file(regression + "_every_effect.native"));
    EXPECT_TRUE(read_file(path("csv")) == read_file(regression + "_ideal.csv"));
    const ProgramResult half = replay(write("half_" + name, file.substr(0, file.size() / 2)));
    EXPECT_EQ(half.exit_code, 3);
    EXPECT_TRUE(contains(half.errors, "cut short after record ")) << half.errors;
    EXPECT_GT(summary()["truth"]["accepted"], 500);
    std::string damaged = file;
    damaged.back() = static_cast<char>(~damaged.back());
    const ProgramResult checksum = replay(write("damaged_" + name, damaged));
    EXPECT_EQ(checksum.exit_code, 3);
    EXPECT_TRUE(contains(checksum.errors, "unreadable after record ")) << checksum.errors;
  }
}

TEST_F(ReplayTest, AThousandHertzWithoutAGap) {
  const std::string c = config("fast", "udp:127.0.0.1:5140", "jsbsim", 1000, "native", "file:" + path("out"));
  ASSERT_EQ(run_program("imud", {"replay", c, flight}).exit_code, 0);
  const ProgramResult decoded = run_program("imu-decode", {"native", "file:" + path("out")});
  ASSERT_EQ(decoded.exit_code, 0);
  const auto all = rows(decoded.output);
  ASSERT_EQ(all.size(), 10001U);
  for (std::size_t k = 0; k < all.size(); ++k) {
    EXPECT_EQ(all[k][0], std::to_string(10'000'000'000 + k * 1'000'000));
    EXPECT_EQ(all[k][1], std::to_string(k));
  }
}

TEST_F(ReplayTest, ThePaceChangesNoByte) {
  const std::string c = config("realtime", "udp:127.0.0.1:5140", "jsbsim", 400, "native", "file:" + path("paced"));
  ASSERT_EQ(run_program("imud", {"replay", c, flight, "--for", "1.5", "--set", "realtime.skip_after_ms=3600000",
                                 "--summary", path("summary.json")})
                .exit_code,
            3);
  EXPECT_EQ(summary()["imus"][0]["samples"], 601);
  EXPECT_GE(summary()["duration_s"], 1.5);
  ASSERT_EQ(
      run_program("imud", {"replay", c, flight, "--fast", "--for", "1.5", "--set", "imu.0.port=file:" + path("fast")})
          .exit_code,
      3);
  EXPECT_EQ(read_file(path("paced")).size(), 601U * 124U);
  EXPECT_TRUE(read_file(path("paced")) == read_file(path("fast")));
}

TEST_F(ReplayTest, ALateListenerNamesTheColumns) {
  // The capture without its first datagram, the label row, as a text file.
  const std::string c = config("fast", "udp:127.0.0.1:5140", "jsbsim", 100, "csv", "file:" + path("out"));
  const std::string labels =
      "Time,lat-geod-rad,long-gc-rad,geod-alt-ft,ecef-x-ft,ecef-y-ft,ecef-z-ft,ecef-x-fps,ecef-y-fps,ecef-z-fps,"
      "eci-x-ft,eci-y-ft,eci-z-ft,eci-x-fps,eci-y-fps,eci-z-fps,epa-rad,phi-rad,theta-rad,psi-rad,p-rad_sec,"
      "q-rad_sec,r-rad_sec,pi-rad_sec,qi-rad_sec,ri-rad_sec,a-pilot-x-ft_sec2,a-pilot-y-ft_sec2,"
      "a-pilot-z-ft_sec2,uidot-ft_sec2,vidot-ft_sec2,widot-ft_sec2,gravity-ft_sec2";
  const std::string pcap = read_file(flight);
  std::string rows_text;
  std::uint32_t length = 0;
  for (std::size_t at = 24; at < pcap.size(); at += 16 + length) {
    std::memcpy(&length, pcap.data() + at + 8, 4);
    if (at > 24) rows_text += pcap.substr(at + 16 + 42, length - 42);  // after Ethernet, IP and UDP headers
  }
  write("rows.csv", rows_text);
  ASSERT_EQ(run_program("imud", {"replay", c, flight}).exit_code, 0);
  const std::string expected = read_file(path("out"));

  const ProgramResult nameless =
      run_program("imud", {"replay", c, path("rows.csv"), "--summary", path("summary.json")});
  EXPECT_EQ(nameless.exit_code, 1);  // no truth was accepted
  EXPECT_EQ(summary()["truth"]["refused"]["columns"], 2001);
  EXPECT_NE(nameless.errors.find("truth refused: columns"), std::string::npos);

  std::string list = "[\"";
  for (const char letter : labels) list += letter == ',' ? std::string("\",\"") : std::string(1, letter);
  ASSERT_EQ(run_program("imud", {"replay", c, path("rows.csv"), "--set", "truth.columns=" + list + "\"]"}).exit_code,
            0);
  EXPECT_TRUE(read_file(path("out")) == expected);
}

TEST_F(ReplayTest, AMeasuredRunIsTheSameTwiceAndAnotherSeedDiffers) {
  const auto with = [&](const std::string& seed, const std::string& out) {
    EXPECT_EQ(run_program("imud", {"replay", regression + ".toml", flight, "--set", "seed=" + seed, "--set",
                                   "imu.0.port=file:" + path(out), "--set", "imu.1.port=file:/dev/null"})
                  .exit_code,
              0);
    return read_file(path(out));
  };
  const std::string once = with("5", "a");
  EXPECT_TRUE(once == with("5", "b"));
  EXPECT_FALSE(once == with("6", "c"));
}

TEST_F(ReplayTest, ACaptureCutShortIsReadToTheLastWholeRecord) {
  const std::string c = config("fast", "udp:127.0.0.1:5140", "jsbsim", 200, "csv", "file:" + path("out"));
  const std::string whole = read_file(flight);
  write("cut.pcap", whole.substr(0, whole.size() - 300));
  const ProgramResult result =
      run_program("imud", {"replay", c, path("cut.pcap"), "--summary", path("summary.json")});
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_EQ(summary()["truth"]["accepted"], 2000);
  EXPECT_EQ(summary()["truth"]["truncated"], 1);
  EXPECT_EQ(summary()["imus"][0]["samples"], 2000);
  EXPECT_NE(result.errors.find("cut short"), std::string::npos) << result.errors;
}

TEST_F(ReplayTest, ACsvCutShortIsReadToTheLastWholeRow) {
  ASSERT_EQ(run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--rate", "100", "--for", "2"}).exit_code,
            0);
  const std::string whole = read_file(path("truth.csv"));
  ASSERT_EQ(lines_of(whole).size(), 202U);
  const std::string c = config("fast", "file:" + path("cut.csv"), "csv", 100, "csv", "file:" + path("out"));
  // A last line that has all of its columns is whole, with or without a line feed.
  write("cut.csv", whole.substr(0, whole.size() - 1));
  const ProgramResult without = run_program("imud", {"run", c, "--summary", path("summary.json")});
  EXPECT_EQ(without.exit_code, 0) << without.errors;
  EXPECT_EQ(summary()["truth"]["accepted"], 201);
  EXPECT_EQ(summary()["truth"]["truncated"], 0);
  EXPECT_NE(without.errors.find("the last line of the file has no line feed"), std::string::npos) << without.errors;
  for (const std::size_t missing : {std::size_t{40}, std::size_t{60}}) {
    write("cut.csv", whole.substr(0, whole.size() - missing));
    const ProgramResult result = run_program("imud", {"run", c, "--summary", path("summary.json")});
    EXPECT_EQ(result.exit_code, 3);
    EXPECT_EQ(summary()["truth"]["accepted"], 200) << missing;
    EXPECT_EQ(summary()["truth"]["truncated"], 1);
    EXPECT_TRUE(summary()["truth"]["refused"].empty());
    EXPECT_NE(result.errors.find("cut short"), std::string::npos) << result.errors;
  }
}

TEST_F(ReplayTest, AFaultIsReportedWithExitCodeTwo) {
  const std::string c = config("fast", "udp:127.0.0.1:5140", "jsbsim", 100, "csv", "file:" + path("out"));
  EXPECT_EQ(run_program("imud", {"replay", c, path("nothing.pcap")}).exit_code, 2);
  EXPECT_EQ(run_program("imud", {"replay", c, write("text.pcap", "no capture")}).exit_code, 2);
  EXPECT_EQ(run_program("imud", {"replay", c, c}).exit_code, 1);  // a file of text without any truth
  EXPECT_EQ(run_program("imud", {"replay", c}).exit_code, 2);
  EXPECT_EQ(run_program("imud", {"run", path("nothing.toml")}).exit_code, 2);
  EXPECT_EQ(run_program("imud", {"run", c}).exit_code, 2);  // fast without a capture
  EXPECT_EQ(run_program("imud", {"fly", c}).exit_code, 2);
  for (const std::string bad : {"-1", "0", "nan", "inf", "1e300", "x"})
    EXPECT_EQ(run_program("imud", {"replay", c, flight, "--for", bad}).exit_code, 2) << bad;
  EXPECT_EQ(run_program("imud", {"replay", c, flight + "?port=9"}).exit_code, 1);  // nothing for that port
  ASSERT_EQ(::mkfifo(path("fifo").c_str(), 0600), 0);
  EXPECT_EQ(run_program("imud", {"replay", c, "pcap:" + path("fifo")}).exit_code, 2);
  EXPECT_EQ(run_program("imud", {}).exit_code, 2);
  EXPECT_EQ(run_program("imud", {"--help"}).exit_code, 0);
  EXPECT_EQ(run_program("imud", {"run", "--help"}).exit_code, 0);
  const ProgramResult version = run_program("imud", {"--version"});
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_EQ(version.output, "imud " IMUD_VERSION "\n");
}

TEST_F(ReplayTest, CheckReportsLoadOrFaults) {
  const std::string c =
      config("realtime", "udp:127.0.0.1:5140", "jsbsim", 200, "native", "serial:/dev/ttyUSB0?baud=921600");
  const ProgramResult good = run_program("imud", {"check", c});
  EXPECT_EQ(good.exit_code, 0);
  EXPECT_NE(good.output.find("124 bytes"), std::string::npos) << good.output;
  EXPECT_NE(good.output.find("26.9 %"), std::string::npos) << good.output;  // 124 * 10 * 200 / 921600
  const ProgramResult bad = run_program("imud", {"check", c, "--set", "imu.0.rate_hz=2000"});
  EXPECT_EQ(bad.exit_code, 2);
  EXPECT_NE(bad.errors.find("269.1 %"), std::string::npos) << bad.errors;

  const auto warns = [&](const std::string& frame, const std::string& start) {
    const ProgramResult checked =
        run_program("imud", {"check", c, "--set", "earth.frame=" + frame, "--set", "earth.start=" + start});
    EXPECT_EQ(checked.exit_code, 0) << checked.errors;
    return checked.output.find("earth.start: IGRF-14 ends in 2030;") != std::string::npos;
  };
  EXPECT_FALSE(warns("inertial", "2029-12-31T23:59:59Z"));
  EXPECT_TRUE(warns("inertial", "2030-01-01T00:00:01Z"));
  EXPECT_FALSE(warns("none", "2030-01-01T00:00:01Z"));
}

TEST_F(ReplayTest, DataOnStandardOutputIsDataAlone) {
  const std::string c = config("fast", "udp:127.0.0.1:5140", "jsbsim", 20, "csv", "file:-");
  const ProgramResult result = run_program("imud", {"replay", c, flight});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(lines_of(result.output).size(), 202U);
  EXPECT_EQ(rows(result.output).back().size(), 16U);
  EXPECT_NE(result.errors.find("received"), std::string::npos);
}

TEST_F(ReplayTest, SigtermIsHandledWhileInputIsSkipped) {
  const std::string c = config("fast", "file:/dev/zero", "csv", 20, "csv", "file:" + path("out"));
  Program imud("imud");
  imud.start({"run", c});
  ASSERT_TRUE(eventually([&] { return std::filesystem::exists(path("out")); }));
  EXPECT_EQ(imud.stop(), 3);
}

TEST_F(ReplayTest, ListShowsEveryEntry) {
  const ProgramResult result = run_program("imud", {"list"});
  EXPECT_EQ(result.exit_code, 0);
  for (const std::string word :
       {"native", "native-can", "csv", "jsbsim", "udp", "pcap", "file", "pty", "serial", "can"})
    EXPECT_NE(result.output.find("\n  " + word + " "), std::string::npos) << word;
  const ProgramResult settings = run_program("imud", {"list", "mip"});
  EXPECT_NE(settings.output.find("Hz; a divisor of 1000 (100; 1 to 1000)\n"), std::string::npos) << settings.output;
}

// A fast replay does not take the recorded time, whatever clock is configured.
TEST_F(ReplayTest, FastIsAnotherClock) {
  const std::string c = write("config.toml",
                              "[truth]\nport = \"udp:127.0.0.1:5140\"\nformat = \"jsbsim\"\n[[imu]]\n"
                              "protocol = \"mip\"\npace = \"line\"\nport = \"pty:" +
                                  path("imu") + "\"\n");
  EXPECT_EQ(run_program("imud", {"check", c}).exit_code, 0);
  const ProgramResult refused = run_program("imud", {"replay", c, flight, "--fast"});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_NE(refused.errors.find("pace"), std::string::npos) << refused.errors;
  EXPECT_EQ(run_program("imud", {"replay", c, flight, "--fast", "--for", "1", "--set", "imu.0.pace=none"}).exit_code,
            3);
}

}  // namespace
}  // namespace imud
