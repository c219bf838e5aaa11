// Whole runs that derive rate and specific force from poses: the same motion given and derived, the keys, the point
// R.
#include <gtest/gtest.h>

#include <cmath>

#include "core/timeline.hpp"
#include "emulator/config/load_config.hpp"
#include "emulator/plan/config.hpp"
#include "tests/emulator/run/run_test.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class DerivedTruth : public RunTest {
 protected:
  void SetUp() override {
    const ProgramResult made =
        run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--for", "2", "--rate", "100"});
    ASSERT_EQ(made.exit_code, 0) << made.errors;
  }
  std::string run(const std::vector<std::string>& settings) {
    const std::string toml =
        config("fast", "file:" + path("truth.csv"), "csv", 200, "csv", "file:" + path("out.csv"));
    std::vector<std::string> arguments = {"run", toml, "--summary", path("summary.json")};
    for (const std::string& setting : settings) arguments.insert(arguments.end(), {"--set", setting});
    const ProgramResult result = run_program("imud", arguments);
    EXPECT_EQ(result.exit_code, 0) << result.errors;
    errors_ = result.errors;
    return read_file(path("out.csv"));
  }
  std::string faults(const std::vector<std::string>& settings, const std::string& clock = "fast") {
    const std::string port = clock == "lockstep" ? "udp:127.0.0.1:9810" : "file:" + path("truth.csv");
    try {
      load_config(config(clock, port, clock == "lockstep" ? "native" : "csv", 200, "csv", "file:" + path("out.csv")),
                  settings);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return {};
  }
  std::string errors_;
};

TEST_F(DerivedTruth, IsTheGivenMotion) {
  const auto given = rows(run({}));
  const auto derived =
      rows(run({"truth.rate=derived", "truth.specific_force=derived", "truth.gravity_m_per_s2=9.80665"}));
  EXPECT_TRUE(summary()["complete"].get<bool>());
  EXPECT_EQ(summary()["truth"]["accepted"], 201);
  ASSERT_EQ(given.size(), derived.size());
  for (std::size_t i = 0; i < given.size(); ++i) {
    ASSERT_EQ(given[i][0], derived[i][0]);
    for (std::size_t field = 2; field < 14; ++field)  // rate, force, increments
      ASSERT_NEAR(std::stod(given[i][field]), std::stod(derived[i][field]), 1e-7) << i << ' ' << field;
    ASSERT_EQ(given[i][15], "0");
    ASSERT_EQ(derived[i][15], "3072");
  }
}

TEST_F(DerivedTruth, ChangesNoByteWhereNothingIsDerived) {
  const std::string given = run({});
  EXPECT_EQ(run({"truth.rate=given", "truth.specific_force=given", "truth.fit_delay_ms=80"}), given);
}

TEST_F(DerivedTruth, NoneIsNoForce) {
  for (const auto& row : rows(run({"truth.specific_force=none"})))
    for (const std::size_t field : {5U, 6U, 7U, 11U, 12U, 13U}) ASSERT_EQ(std::stod(row[field]), 0.0);
  EXPECT_FALSE(contains(errors_, "accelerometers measure 0"));
}

// A place on the vehicle is where it is, whichever point the simulator reports.
TEST_F(DerivedTruth, LeverArmsAreFromThePointOfTheTruth) {
  const std::string at_r = run({});
  const std::string elsewhere = run({"truth.r_RB_B_m=[1, -2, 0.5]"});
  EXPECT_NE(elsewhere, at_r);
  EXPECT_EQ(run({"truth.r_RB_B_m=[1, -2, 0.5]", "imu.0.mounting.position_m=[1, -2, 0.5]"}), at_r);
  EXPECT_EQ(run({"imu.0.mounting.position_m=[-1, 2, -0.5]"}), elsewhere);
}

TEST_F(DerivedTruth, FaultsSayWhatWouldBeRight) {
  EXPECT_EQ(faults({"truth.rate=derived"}), "");
  EXPECT_TRUE(contains(faults({"truth.rate=derived"}, "lockstep"), "in lockstep the simulator waits for an answer"));
  EXPECT_TRUE(contains(faults({"truth.specific_force=derived"}, "lockstep"), "truth.specific_force"));
  EXPECT_EQ(faults({"truth.specific_force=none"}, "lockstep"), "");
  // A run would refuse every truth.
  const std::string no_rate = "truth has no rate by these settings, and in lockstep none can be derived";
  EXPECT_TRUE(contains(faults({"truth.format=tum"}, "lockstep"), "truth.format: tum " + no_rate));
  EXPECT_TRUE(contains(faults({"truth.format=euroc"}, "lockstep"), no_rate));
  EXPECT_TRUE(contains(faults({"truth.format=flightgear", "truth.protocol=insgns-truth"}, "lockstep"), no_rate));
  EXPECT_EQ(faults({"truth.format=flightgear"}, "lockstep"), "") << "insgns-imu has a rate";
  EXPECT_EQ(faults({"truth.format=json"}, "lockstep"), "") << "each object may have one";
  EXPECT_EQ(faults({"truth.format=dis"}, "lockstep"), "") << "some PDUs have one";
  EXPECT_EQ(faults({"truth.format=tum"}, "fast"), "");
  EXPECT_TRUE(contains(faults({"truth.gravity=j2", "truth.gravity_m_per_s2=9.81"}), "not both"));
  EXPECT_TRUE(contains(faults({"truth.gravity=moon"}), "wgs84"));
  EXPECT_TRUE(contains(faults({"truth.fit_delay_ms=0"}), "from 1 to 500"));
  EXPECT_EQ(faults({"truth.rate=derived", "truth.fit_delay_ms=auto"}), "");
  EXPECT_TRUE(contains(faults({"truth.fit_delay_ms=short"}), "give milliseconds from 1 to 500, or \"auto\""));
  EXPECT_TRUE(contains(faults({"truth.fit_delay_ms=auto"}, "lockstep"), "\"auto\" needs a capture"));
}

// A vehicle at rest, by poses with noise of some 0.2 mm and 0.5 mrad, one of which is 5 cm off, and some are missing.
TEST_F(DerivedTruth, NoisyPosesAreUsable) {
  std::string poses;
  std::uint32_t lcg = 1;
  const auto noise = [&lcg](double rms) {
    double sum = -6.0;
    for (int i = 0; i < 12; ++i) {
      lcg = 1'664'525 * lcg + 1'013'904'223;
      sum += static_cast<double>(lcg >> 8) * 0x1p-24;
    }
    return rms * sum;
  };
  for (int i = 0; i <= 1000; ++i) {
    const double x = noise(2e-4) + (i == 500 ? 0.05 : 0.0);
    const double y = noise(2e-4), z = noise(2e-4), a = noise(2.5e-4), b = noise(2.5e-4), c = noise(2.5e-4);
    if (i <= 700 || i > 730) poses += fmt::format("{:.2f} {} {} {} {} {} {} 1\n", 0.01 * i, x, y, z, a, b, c);
  }
  write("poses.tum", poses);
  const std::string toml = config("fast", "udp:127.0.0.1:9810", "tum", 100, "csv", "file:" + path("out.csv"));
  const auto replay = [&](const std::vector<std::string>& settings) {
    std::vector<std::string> arguments = {"replay", toml, path("poses.tum"), "--summary", path("summary.json")};
    for (const std::string& setting : settings) arguments.insert(arguments.end(), {"--set", setting});
    const ProgramResult result = run_program("imud", arguments);
    EXPECT_EQ(result.exit_code, 3) << "a truth was refused, and there is a gap";
    errors_ = result.errors;
    double rate = 0, force = 0;
    int marked = 0;
    for (const auto& row : rows(read_file(path("out.csv")))) {
      const unsigned long status = std::stoul(row[15]);
      marked += (status & status::truth_gap) != 0 ? 1 : 0;
      for (const std::size_t field : {2U, 3U, 4U}) rate += std::pow(std::stod(row[field]), 2) / 3003;
      for (const std::size_t field : {5U, 6U}) force += std::pow(std::stod(row[field]), 2) / 2002;
    }
    EXPECT_EQ(marked, 30);
    return std::pair(std::sqrt(rate), std::sqrt(force));
  };
  const auto chosen = replay({});
  EXPECT_LT(chosen.first, 2e-3);
  EXPECT_LT(chosen.second, 0.1);
  const nlohmann::json truth = summary()["truth"];
  EXPECT_EQ(truth["refused"]["outlier"], 1);
  EXPECT_NEAR(truth["fit"]["place_noise_m"].get<double>(), 2e-4, 3e-5);
  EXPECT_NEAR(truth["fit"]["attitude_noise_rad"].get<double>(), 5e-4, 8e-5);
  EXPECT_GT(truth["fit"]["rate_delay_mean_ms"].get<double>(), 300);
  EXPECT_TRUE(contains(errors_, "the pose at 5000000000 ns is 0.049") ||
              contains(errors_, "the pose at 5000000000 ns is 0.050"))
      << errors_;
  EXPECT_FALSE(contains(errors_, "give a longer one"));
  const auto fixed = replay({"truth.fit_delay_ms=30"});
  EXPECT_GT(fixed.first, 0.03);
  EXPECT_GT(fixed.second, 3.0);
  EXPECT_TRUE(contains(errors_, "with truth.fit_delay_ms = 30; give a longer one, or \"auto\"")) << errors_;
}

// Three poses in the middle and the last two of the capture: each is counted, also those that only the end shows.
TEST_F(DerivedTruth, EachOfARunOfOutliersIsCounted) {
  std::string poses;
  for (int i = 0; i <= 300; ++i)
    poses += fmt::format("{:.2f} {} 0 0 0 0 0 1\n", 0.01 * i, (i >= 100 && i < 103) || i > 298 ? 0.3 : 0.0);
  write("poses.tum", poses);
  const ProgramResult result =
      run_program("imud", {"replay", config("fast", "udp:127.0.0.1:9810", "tum", 100, "csv", "file:" + path("o.csv")),
                           path("poses.tum"), "--summary", path("summary.json")});
  EXPECT_EQ(result.exit_code, 3) << "truths were refused";
  EXPECT_EQ(summary()["truth"]["refused"]["outlier"], 5) << result.errors;
  EXPECT_EQ(summary()["truth"]["accepted"], 296);
}

TEST_F(DerivedTruth, CheckNamesDelayAndBandwidth) {
  const std::string toml = config("fast", "file:" + path("truth.csv"), "csv", 200, "csv", "file:" + path("out.csv"));
  EXPECT_FALSE(contains(run_program("imud", {"check", toml}).output, "derived with"));
  const ProgramResult checked = run_program("imud", {"check", toml, "--set", "truth.rate=derived"});
  EXPECT_TRUE(
      contains(checked.output,
               "rate derived, specific force given, or 0; derived with 30 to 480 ms on either side, chosen by "
               "the noise of the poses, to 33.3 Hz at most"))
      << checked.output;
  const ProgramResult fixed =
      run_program("imud", {"check", toml, "--set", "truth.rate=derived", "--set", "truth.fit_delay_ms=40"});
  EXPECT_TRUE(contains(fixed.output, "derived with 40 ms of delay, to 25 Hz")) << fixed.output;
}

}  // namespace
}  // namespace imud
