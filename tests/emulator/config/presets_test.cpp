// Presets: all of them, alone and under keys of the configuration, and the words that are none.
#include "emulator/config/presets.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "core/allan_terms.hpp"
#include "core/units.hpp"
#include "emulator/config/load_config.hpp"
#include "emulator/plan/config.hpp"
#include "tests/support/text.hpp"
#include "tests/tools/run_program.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

constexpr double deg = units::degree, g = units::standard_gravity;

class PresetsTest : public testing::Test {
 protected:
  Config config(const std::string& protocol, const std::vector<std::string>& assignments) const {
    std::ofstream(path_) << "[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nprotocol = \"" << protocol
                         << "\"\nport = \"pty:imu1\"\n";
    std::vector<std::string> all;
    for (const std::string& assignment : assignments) all.push_back("imu.0." + assignment);
    return load_config(path_, all);
  }
  ImuModel model(const std::string& protocol, const std::vector<std::string>& assignments) const {
    return config(protocol, assignments).imus.at(0).model;
  }

  ScratchFolder folder_;
  const std::string path_ = folder_ / "config.toml";
};

// N and the minima of the Allan deviations of gyros and accelerometers in SI, computed by hand from the figures of
// the data sheets.
TEST_F(PresetsTest, HaveTheFiguresOfTheirSources) {
  struct Figures {
    const char* name;
    double gyro_N, force_N, gyro_minimum, force_minimum;
  };
  const std::vector<Figures> all = {
      {"stim300", 4.3633e-05, 1.0000e-03, 2.4241e-06, 4.9033e-04},
      {"hg4930-ca51", 1.1636e-05, 5.0000e-04, 1.2120e-06, 2.4517e-04},
      {"hg4930-ba51", 1.4544e-05, 6.6667e-04, 1.6968e-06, 4.9033e-04},
      {"hg4930-aa51", 1.7453e-05, 1.0000e-03, 2.1817e-06, 7.3550e-04},
      {"hg1120-ca50", 1.1636e-04, 1.0833e-03, 4.8481e-05, 4.9033e-04},
      {"adis16505-1", 3.7815e-05, 1.5000e-04, 1.1151e-05, 2.6478e-05},
      {"adis16470", 9.8902e-05, 6.1667e-04, 3.8785e-05, 1.2749e-04},
      {"adis16495-1", 2.6180e-05, 1.3333e-04, 3.8785e-06, 3.1381e-05},
      {"vn-100", 6.1087e-05, 1.3717e-03, 4.8481e-05, 3.9227e-04},
      {"3dm-gx5-25", 8.7266e-05, 7.8333e-04, 3.8785e-05, 3.9227e-04},
      {"3dm-cv7", 4.9451e-05, 5.0000e-04, 7.2722e-06, 2.9420e-04},
      {"mti-630", 1.2217e-04, 5.8833e-04, 3.8785e-05, 9.8067e-05},
      {"mti-300", 1.7453e-04, 5.8833e-04, 4.8481e-05, 1.4710e-04},
      {"bmi088", 1.7278e-04, 1.2139e-03, 9.6963e-06, 0},
      {"icm-42688-p", 3.4556e-05, 4.8555e-04, 0, 0},
      {"ln-200s", 2.0362e-05, 3.4333e-04, 4.8481e-06, 0},
      {"sbg-ellipse", 5.2360e-05, 5.6000e-04, 3.3937e-05, 1.3729e-04},
      {"icm-20948", 1.8512e-04, 1.5949e-03, 0, 0},
      {"icm-20602", 4.9365e-05, 6.9343e-04, 0, 0},
      {"icm-45686", 4.6897e-05, 7.6278e-04, 0, 0},
      {"mpu-9250", 1.2341e-04, 2.0803e-03, 0, 0},
      {"bmi270", 8.6389e-05, 1.1095e-03, 0, 0},
      {"sch16t-k01", 4.3633e-06, 5.0000e-04, 1.6096e-06, 1.3280e-04},
      {"lsm6dsv", 4.8869e-05, 5.8840e-04, 0, 0},
      {"mti-3", 1.2217e-04, 1.1768e-03, 4.8481e-05, 2.9420e-04},
      {"adis16448", 1.9199e-04, 1.8333e-03, 7.0298e-05, 2.4517e-03},
      {"adis16488a", 7.5631e-05, 4.8333e-04, 2.4725e-05, 9.8066e-04},
      {"kvh-1775", 3.4907e-06, 1.1768e-03, 2.4241e-07, 4.9033e-04},
  };
  EXPECT_EQ(presets().size(), all.size());
  // A figure was rounded to a product's digits before it was converted: half a percent.
  const auto near = [](double value, double expected) { return std::abs(value - expected) <= 5e-3 * expected; };
  for (const Figures& expected : all) {
    const Preset* preset = find_preset(expected.name);
    ASSERT_NE(preset, nullptr) << expected.name;
    EXPECT_FALSE(preset->source().empty());
    const PresetErrors errors = preset_errors(*preset, 100);
    const AllanTerms gyro = allan_terms(errors.gyro, 100)[2], force = allan_terms(errors.accelerometer, 100)[2];
    EXPECT_TRUE(near(gyro.N, expected.gyro_N)) << expected.name << " " << gyro.N;
    EXPECT_TRUE(near(force.N, expected.force_N)) << expected.name << " " << force.N;
    EXPECT_TRUE(near(gyro.minimum(), expected.gyro_minimum)) << expected.name << " " << gyro.minimum();
    EXPECT_TRUE(near(force.minimum(), expected.force_minimum)) << expected.name << " " << force.minimum();
  }
}

// The converters of these sensors have a noise of some LSB at their internal rate; the mean of D samples has D times
// as many digits.
TEST_F(PresetsTest, TheMeanOfInternalSamplesHasMoreDigits) {
  const auto lsb = [&](const std::string& preset, const std::string& rate,
                       const std::vector<std::string>& more = {}) {
    std::vector<std::string> keys = {"rate_hz=" + rate, "model=\"" + preset + "\""};
    keys.insert(keys.end(), more.begin(), more.end());
    return model("native", keys).gyro.lsb / deg;
  };
  EXPECT_NEAR(lsb("adis16470", "2000"), 0.1, 1e-12);
  EXPECT_NEAR(lsb("adis16470", "100"), 0.005, 1e-12);
  EXPECT_NEAR(lsb("adis16470", "100", {"internal_rate_hz=2000"}), 0.1, 1e-12);
  EXPECT_NEAR(lsb("adis16495-1", "4250"), 0.00625, 1e-12);
  EXPECT_NEAR(lsb("adis16495-1", "425"), 0.000625, 1e-12);
  // Products that pass on one value in so many, and those without an internal rate.
  EXPECT_NEAR(lsb("bmi088", "100"), 0.06103515625, 1e-12);
  EXPECT_NEAR(lsb("icm-42688-p", "100"), 0.00762939453125, 1e-12);
}

// A mark is uniform, and every preset whose source is none of the manufacturer has it at each figure.
TEST_F(PresetsTest, MarkWhatIsUnconfirmed) {
  for (const Preset& preset : presets()) {
    const std::vector<Preset::Figure> figures = preset.figures();
    EXPECT_GE(figures.size(), 6U) << preset.name;
    const auto marked = std::ranges::count(figures, false, &Preset::Figure::is_confirmed);
    std::istringstream lines{std::string(preset.text)};
    std::ptrdiff_t with_words = 0;
    for (std::string line; std::getline(lines, line);) {
      const std::size_t comment = line.find("  # ");
      if (line.find(" = ") == line.npos || comment == line.npos) continue;
      const std::string words = line.substr(comment + 4);
      const bool is_marked = words.starts_with("unconfirmed: from memory") ||
                             words.starts_with("unconfirmed: secondary source") ||
                             words.starts_with("unconfirmed: assumed");
      if (words.find("memory") != words.npos || words.find("secondary") != words.npos ||
          words.find("unconfirmed") != words.npos || words.find("assumed") != words.npos) {
        EXPECT_TRUE(is_marked) << preset.name << ": " << line;
        ++with_words;
      }
    }
    EXPECT_EQ(marked, with_words) << preset.name;
  }
}

TEST_F(PresetsTest, TheirFiguresHaveAConfidence) {
  const auto figure = [](const char* preset, const char* key) {
    for (const Preset::Figure& one : find_preset(preset)->figures())
      if (one.key == key) return one;
    ADD_FAILURE() << preset << " has no " << key;
    return Preset::Figure{};
  };
  const Preset::Figure drift = figure("stim300", "gyro.bias_minimum_deg_per_hr");
  EXPECT_EQ(drift.value, "0.5");
  EXPECT_EQ(drift.confidence, "secondary source");
  EXPECT_EQ(drift.note, "0.3 in later revisions");
  EXPECT_EQ(figure("stim300", "gyro.unit_sigma.scale_factor_ppm").value, "500");
  EXPECT_EQ(figure("adis16505-1", "accelerometer.velocity_random_walk_m_per_s_per_rt_hr").confidence, "memory");
  EXPECT_EQ(figure("adis16505-1", "gyro.angle_random_walk_deg_per_rt_hr").confidence, "document");
  EXPECT_EQ(figure("adis16505-1", "accelerometer.lsb_m_per_s2").note, "78.4/32000");
  EXPECT_EQ(figure("mti-300", "gyro.noise_density_sidedness").confidence, "assumed");
  EXPECT_EQ(figure("3dm-gx5-25", "gyro.low_pass_hz").confidence, "secondary source");
  const std::string path = folder_ / "figures.toml";
  std::ofstream(path) << "[imu.gyro]\nmax_deg_per_s = 7  # of mine\n";
  EXPECT_EQ(figure(path.c_str(), "gyro.max_deg_per_s").confidence, "not marked");
  EXPECT_EQ(figure(path.c_str(), "gyro.max_deg_per_s").note, "of mine");

  const ProgramResult list = run_program("imud", {"list", "adis16505-1"});
  EXPECT_TRUE(contains(list.output, "  3 of 14 values are unconfirmed")) << list.output;
  EXPECT_TRUE(contains(list.output,
                       "  accelerometer.velocity_random_walk_m_per_s_per_rt_hr     0.009"
                       "                  memory"))
      << list.output;
}

TEST_F(PresetsTest, FitAnyProtocol) {
  const ImuModel native = model("native", {"rate_hz=200", "model=\"stim300\""});
  EXPECT_NEAR(native.gyro.max, 400 * deg, 1e-12);
  EXPECT_NEAR(native.accelerometer.max, 10 * g, 1e-12);
  EXPECT_NEAR(native.gyro.white_density.x(), 0.15 * deg / 60, 1e-18);
  // In the place of the product's white noise, not beside it.
  const ImuModel product = model("stim300", {"model=\"stim300\""});
  EXPECT_TRUE(product.gyro.walk_sqrt_cov.isZero(0.0));
  EXPECT_EQ(product.gyro.white_density, native.gyro.white_density);
  for (const Preset& preset : presets())
    EXPECT_NO_THROW(model("native", {"rate_hz=200", "model=\"" + std::string(preset.name) + "\""})) << preset.name;
}

TEST_F(PresetsTest, AKeyTakesThePlaceOfItsOwnValueOnly) {
  const ImuModel preset = model("native", {"rate_hz=200", "model=\"mti-300\""});
  const ImuModel changed = model("native", {"rate_hz=200", "model=\"mti-300\"", "gyro.max_deg_per_s=1000",
                                            "gyro.angle_random_walk_rad_per_rt_s=1e-4"});
  EXPECT_NEAR(changed.gyro.max, 1000 * deg, 1e-12);
  EXPECT_EQ(changed.gyro.white_density, Vector3::Constant(1e-4));
  EXPECT_EQ(changed.gyro.bias_instability, preset.gyro.bias_instability);
  EXPECT_EQ(changed.gyro.g_sensitivity, preset.gyro.g_sensitivity);
  EXPECT_NEAR(preset.gyro.g_sensitivity(0, 0), 0.003 * deg / g, 1e-15);
  EXPECT_EQ(changed.accelerometer.white_density, preset.accelerometer.white_density);
}

TEST_F(PresetsTest, IdealSwitchesEveryErrorOff) {
  const ImuModel ideal = model("stim300", {"model=\"ideal\""});
  const ImuModel white = model("stim300", {"model=\"white\""});
  EXPECT_EQ(ideal.gyro.max, white.gyro.max);
  EXPECT_TRUE(ideal.gyro.walk_sqrt_cov.isZero(0.0));
  EXPECT_TRUE(ideal.accelerometer.walk_sqrt_cov.isZero(0.0));
  EXPECT_EQ(ideal.barometer.noise, 0);
  EXPECT_FALSE(white.gyro.walk_sqrt_cov.isZero(0.0));
  EXPECT_FALSE(model("vectornav", {}).magnetometer.walk_sqrt_cov.isZero(0.0));
  EXPECT_TRUE(model("vectornav", {"model=\"ideal\""}).magnetometer.walk_sqrt_cov.isZero(0.0));
}

// Table 5-8 of the STIM300's data sheet: 0.08 m/s/sqrt(h), 17 Hz, 500 ppm; 24 bits of 2^-22 g.
TEST_F(PresetsTest, InclinometersAreOfProductsThatHaveThem) {
  const TriadErrors of_preset = model("stim300", {}).inclinometer.value();
  EXPECT_NEAR(of_preset.white_density.x(), 0.08 / 60, 1e-15);
  EXPECT_TRUE(of_preset.walk_sqrt_cov.isZero(0.0));
  EXPECT_GT(of_preset.bias_instability.x(), 0);
  EXPECT_NEAR(of_preset.max, 2 * g, 1e-12);
  EXPECT_EQ(of_preset.filter.cut_off_hz, Vector3::Constant(17));
  EXPECT_NEAR(of_preset.unit_sigma.scale_factor.x(), 500e-6, 1e-18);
  const TriadErrors white = model("stim300", {"model=\"white\""}).inclinometer.value();
  EXPECT_NEAR(white.walk_sqrt_cov(1, 1), 0.08 / 60 * std::sqrt(2000), 1e-12);
  EXPECT_TRUE(white.white_density.isZero(0.0));
  EXPECT_EQ(model("stim300", {"model=\"adis16470\""}).inclinometer.value().walk_sqrt_cov, white.walk_sqrt_cov);
  const TriadErrors ideal = model("stim300", {"model=\"ideal\""}).inclinometer.value();
  EXPECT_TRUE(ideal.walk_sqrt_cov.isZero(0.0) && ideal.white_density.isZero(0.0) && !ideal.unit_sigma.is_on());
  EXPECT_EQ(ideal.max, white.max);
  const TriadErrors own = model("stim300", {"inclinometer.max_g=1.7", "inclinometer.bias_mg=3"}).inclinometer.value();
  EXPECT_NEAR(own.max, 1.7 * g, 1e-12);
  EXPECT_NEAR(own.bias.y(), 3e-3 * g, 1e-15);
  EXPECT_EQ(own.white_density, of_preset.white_density);

  // Rows of text have them where the table gives them, with the errors of the model.
  EXPECT_FALSE(model("csv", {"rate_hz=2000", "model=\"stim300\""}).inclinometer);
  const TriadErrors of_rows =
      model("csv", {"rate_hz=2000", "model=\"stim300\"", "inclinometer.bias_mg=3"}).inclinometer.value();
  EXPECT_EQ(of_rows.white_density, of_preset.white_density);
  EXPECT_NEAR(of_rows.bias.y(), 3e-3 * g, 1e-15);
  const Config native = config("native", {"rate_hz=200", "model=\"stim300\""});
  EXPECT_FALSE(native.imus.at(0).model.inclinometer);
  EXPECT_FALSE(contains(native.resolved(), "inclinometer"));
  EXPECT_TRUE(contains(config("stim300", {}).resolved(), "[imu.inclinometer]"));
  try {
    config("native", {"rate_hz=200", "model=\"stim300\"", "inclinometer.bias_mg=3"});
    ADD_FAILURE() << "native has inclinometers";
  } catch (const ConfigError& error) {
    EXPECT_TRUE(contains(error.what(),
                         "imu.0.inclinometer: needs inclinometers, which native does not have; these do: "
                         "csv with [imu.inclinometer], stim300"))
        << error.what();
  }
}

TEST_F(PresetsTest, AUsersFileIsAPreset) {
  const std::string path = folder_ / "mine.toml";
  const std::string key = "model=\"" + path + "\"";
  const auto fault = [&] {
    try {
      model("native", {"rate_hz=200", key});
    } catch (const ConfigError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(fault().find("there is no \"" + path), std::string::npos) << fault();
  std::ofstream(path) << find_preset("mti-300")->text;
  const ImuModel file = model("native", {"rate_hz=200", key, "gyro.max_deg_per_s=99"});
  const ImuModel preset = model("native", {"rate_hz=200", "model=\"mti-300\""});
  EXPECT_EQ(file.gyro.white_density, preset.gyro.white_density);
  EXPECT_EQ(file.accelerometer.bias_instability, preset.accelerometer.bias_instability);
  EXPECT_NEAR(file.gyro.max, 99 * deg, 1e-12);
  EXPECT_EQ(find_preset(path)->summary(), find_preset("mti-300")->summary());

  // Without comments, and with faults, which have the file's name and line.
  const auto errors_in = [&](const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    const Preset* found = find_preset(folder_ / name);
    EXPECT_EQ(found->summary(), "");
    EXPECT_EQ(found->source(), "");
    try {
      preset_errors(*found, 200);
    } catch (const ConfigError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const std::string good = "[imu]\ngyro.max_deg_per_s=1\naccelerometer.max_g=1\n";
  EXPECT_EQ(errors_in("good.toml", good), "");
  EXPECT_NE(errors_in("key.toml", good + "gyro.axes=3\n").find("key.toml:4: imu.gyro.axes: "), std::string::npos);
  EXPECT_NE(errors_in("toml.toml", "[imu\n").find("toml.toml:1: TOML: "), std::string::npos);
  // A table that is not in [imu] is no part of the model.
  const auto beside = [&](const std::string& name, const std::string& text) { return errors_in(name, good + text); };
  EXPECT_NE(beside("gyro.toml", "[gyro]\nbias_deg_per_hr=9\n").find("4: gyro: unknown key; known here: imu"),
            std::string::npos);
  EXPECT_NE(beside("acc.toml", "[acelerometer]\nlsb_g=1\n").find("4: acelerometer: unknown key; known here: imu"),
            std::string::npos);
  EXPECT_NE(beside("two.toml", "[[imu2]]\nmodel=\"vn-100\"\n").find("4: imu2: unknown key; did you mean \"imu\"?"),
            std::string::npos);
  EXPECT_NE(errors_in("list.toml", "[[imu]]\ngyro.max_deg_per_s=1\n").find("1: imu: give a table, [imu]"),
            std::string::npos);
  EXPECT_NE(
      errors_in("key2.toml", "internal_rate_hz=9\n" + good).find("1: internal_rate_hz: unknown key; known here: imu"),
      std::string::npos);
  EXPECT_NE(errors_in("none.toml", "#").find("imu.gyro.max_rad_per_s: missing"), std::string::npos);
}

// The printed value of every key gives the same errors.
TEST_F(PresetsTest, ResolveToTheSameErrors) {
  int compared = 0;
  for (const Preset& preset : presets()) {
    const Config first = config("native", {"rate_hz=200", "model=\"" + std::string(preset.name) + "\""});
    const std::string resolved = folder_ / "resolved.toml";
    std::ofstream(resolved) << first.resolved();
    const ImuModel a = first.imus.at(0).model, b = load_config(resolved).imus.at(0).model;
    for (const auto& [one, other] : {std::pair(a.gyro, b.gyro), std::pair(a.accelerometer, b.accelerometer)}) {
      EXPECT_EQ(one.max, other.max) << preset.name;
      EXPECT_EQ(one.lsb, other.lsb) << preset.name;
      EXPECT_EQ(one.rounding, other.rounding) << preset.name;
      EXPECT_EQ(one.carry, other.carry) << preset.name;
      EXPECT_EQ(one.flicker_to_s, other.flicker_to_s) << preset.name;
      EXPECT_EQ(one.white_density, other.white_density) << preset.name;
      EXPECT_EQ(one.bias_instability, other.bias_instability) << preset.name;
      EXPECT_EQ(one.turn_on_bias, other.turn_on_bias) << preset.name;
      EXPECT_EQ(one.g_sensitivity, other.g_sensitivity) << preset.name;
      EXPECT_EQ(one.increment_lsb, other.increment_lsb) << preset.name;
      ++compared;
    }
  }
  EXPECT_EQ(compared, 56);
}

TEST_F(PresetsTest, AWrongNameIsAFaultWithTheNearest) {
  try {
    config("native", {"rate_hz=200", "gyro.max_rad_per_s=1", "accelerometer.max_m_per_s2=1", "model=\"stim30\""});
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("imu.0.model: there is no \"stim30\"; did you mean \"stim300\"?"),
              std::string::npos)
        << error.what();
  }
}

TEST_F(PresetsTest, ListAndExampleShowThem) {
  const ProgramResult list = run_program("imud", {"list"});
  EXPECT_NE(list.output.find("presets\n"), std::string::npos);
  for (const Preset& preset : presets()) {
    EXPECT_NE(list.output.find("  " + std::string(preset.name)), std::string::npos) << preset.name;
    const ProgramResult text = run_program("imud", {"example", std::string(preset.name), "--model"});
    EXPECT_EQ(text.exit_code, 0);
    EXPECT_EQ(text.output, preset.text);
  }
  EXPECT_EQ(run_program("imud", {"example", "native", "--model"}).exit_code, 2);
  const ProgramResult example = run_program("imud", {"example", "vn-100"});
  EXPECT_NE(example.output.find("\nmodel = \"vn-100\"\n"), std::string::npos) << example.output;
  std::ofstream(path_) << example.output;
  EXPECT_NO_THROW(load_config(path_));
}

}  // namespace
}  // namespace imud
