// imu-allan and imud against one another: recordings of imud's models, and models made of recordings.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/units.hpp"
#include "tests/support/text.hpp"
#include "tests/tools/run_program.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "tools/allan/allan_comparison.hpp"
#include "tools/allan/model_terms.hpp"

namespace imud {
namespace {

using Word = TermVerdict::Word;
constexpr double deg = units::degree, mg = 1e-3 * units::standard_gravity, hour = 3600, root_hour = 60;

class ImuAllanModel : public testing::Test {
 protected:
  // Writes what a sensor at rest with these keys sends, and returns its port. A product has its own rate.
  std::string recording(const std::vector<std::string>& keys, const std::string& name = "sent", int rate_hz = 100,
                        std::int64_t minutes = 30, const std::string& protocol = "native") const {
    std::ofstream truth(folder_ / "truth.csv");
    truth << "time_ns,sigma_BN_1,sigma_BN_2,sigma_BN_3";
    for (const char* quantity : {"r_BN_N", "v_BN_N", "omega_BN_B", "omegaDot_BN_B", "nonConservativeAccelpntB_B"})
      for (const char axis : {'x', 'y', 'z'}) truth << ',' << quantity << '_' << axis;
    for (std::int64_t minute = 0; minute <= minutes; ++minute)
      truth << '\n' << 60'000'000'000 * minute << ",0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,-9.80665";
    truth << '\n';
    truth.close();
    std::ofstream config(folder_ / "imu.toml");
    config << "clock = \"fast\"\n[truth]\nport = \"file:" << folder_ / "truth.csv"
           << "\"\nformat = \"csv\"\n[[imu]]\nprotocol = \"" << protocol << "\"\nport = \"file:" << folder_ / name
           << "\"\n";
    if (rate_hz > 0) config << "rate_hz = " << rate_hz << "\n";
    for (const std::string& key : keys) config << key << "\n";
    config.close();
    const auto run = run_program("imud", {"run", folder_ / "imu.toml"});
    EXPECT_EQ(run.exit_code, 0) << run.errors;
    return "file:" + (folder_ / name);
  }

  ScratchFolder folder_;
};

TEST_F(ImuAllanModel, ARecordingOfAPresetAgreesWithItAndWithNoOther) {
  const std::string port = recording({"model = \"vn-100\""});
  const auto same =
      run_program("imu-allan", {"native", port, "--against", "vn-100", "--json", folder_ / "same.json"});
  EXPECT_EQ(same.exit_code, 0) << same.output << same.errors;
  EXPECT_TRUE(contains(same.output, "against    vn-100, within 10 % at 99.9 % confidence: agrees\n"));
  EXPECT_TRUE(contains(same.output, " for 0.21 deg/sqrt(h): agrees\n")) << same.output;
  const auto json = nlohmann::json::parse(std::ifstream(folder_ / "same.json"));
  EXPECT_EQ(json["against"]["agrees"], true);
  const auto& axis = json["axes"]["gyro_z"];
  EXPECT_NEAR(axis["N"]["model_si"].get<double>(), 0.0035 * deg, 1e-12);
  EXPECT_EQ(axis["N"]["verdict"], "agrees");
  EXPECT_EQ(axis["model"].size(), axis["tau_s"].size());

  const auto other = run_program("imu-allan", {"native", port, "--against", "stim300"});
  EXPECT_EQ(other.exit_code, 3);
  EXPECT_TRUE(contains(other.output, "against    stim300, within 10 % at 99.9 % confidence: DIFFERS\n"));
  EXPECT_TRUE(contains(other.output, " for 0.15 deg/sqrt(h): DIFFERS\n")) << other.output;
}

// The axis whose term is wrong by 20 % is found, and no other.
TEST_F(ImuAllanModel, AnErrorOfTwentyPercentIsFound) {
  const std::string port =
      recording({"model = \"vn-100\"", "gyro.noise_density_deg_per_s_per_rt_hz = [0.0035, 0.0042, 0.0035]",
                 "accelerometer.noise_density_mg_per_rt_hz = [0.14, 0.14, 0.112]"});
  const auto result =
      run_program("imu-allan", {"native", port, "--against", "vn-100", "--json", folder_ / "result.json"});
  EXPECT_EQ(result.exit_code, 3);
  const auto json = nlohmann::json::parse(std::ifstream(folder_ / "result.json"));
  for (const auto& [name, axis] : json["axes"].items())
    for (const char* term : {"Q", "N", "B", "K", "R"})
      EXPECT_EQ(axis[term]["verdict"] == "differs", *term == 'N' && (name == "gyro_y" || name == "accel_z"))
          << name << term << result.output;
}

// A VN-100 sends one in so many samples of values behind its filter: by the curve its N agrees with the model, though
// the fit of 40 samples a second has another. A unit with 20 % more noise differs all the same.
TEST_F(ImuAllanModel, AProductAgreesWithItsOwnModelBehindFilterAndDecimation) {
  const auto compared = [&](const std::vector<std::string>& keys) {
    const std::string port = recording(keys, "product", 0, 30, "vectornav");
    return run_program("imu-allan", {"vectornav", port, "--rate-hz", "40", "--against", "vn-100"});
  };
  const auto same = compared({});
  EXPECT_EQ(same.exit_code, 0) << same.output << same.errors;
  EXPECT_TRUE(contains(same.output, "against    vn-100, within 10 % at 99.9 % confidence: agrees\n"));
  EXPECT_TRUE(contains(same.output, " for 0.21 deg/sqrt(h): agrees, by the curve of its samples\n")) << same.output;
  const auto other = compared({"gyro.noise_density_deg_per_s_per_rt_hz = 0.0042"});
  EXPECT_EQ(other.exit_code, 3);
  EXPECT_TRUE(contains(other.output, " for 0.21 deg/sqrt(h): DIFFERS\n")) << other.output;
}

// Digits of 0.02 deg/s on white noise of 0.012 deg/s: N is larger by them.
TEST_F(ImuAllanModel, ASensorAgreesWithItsOwnModelInItsDigits) {
  const auto write = [&](const std::string& name, const std::string& walk) {
    std::ofstream(folder_ / name) << "[imu.gyro]\nmax_rad_per_s = 10\nangle_random_walk_deg_per_rt_hr = " << walk
                                  << "\nlsb_deg_per_s = 0.02\nrounding = \"nearest\"\n[imu.accelerometer]\n"
                                     "max_g = 10\nvelocity_random_walk_m_per_s_per_rt_s = 1e-3\n";
    return folder_ / name;
  };
  const std::string own = write("own.toml", "0.1"), other = write("other.toml", "0.13");
  const std::string port = recording({"model = \"" + own + "\""}, "digits", 50);
  const auto same = run_program("imu-allan", {"native", port, "--against", own});
  EXPECT_EQ(same.exit_code, 0) << same.output;
  EXPECT_TRUE(contains(same.output, " for 0.1 deg/sqrt(h): agrees, by the curve of its samples\n")) << same.output;
  EXPECT_EQ(run_program("imu-allan", {"native", port, "--against", other}).exit_code, 3);
}

TEST_F(ImuAllanModel, ThePlotHasTheCurveOfTheModel) {
  const std::string port = recording({"model = \"vn-100\""});
  const auto result =
      run_program("imu-allan", {"native", port, "--against", "vn-100", "--plot", folder_ / "noise.svg"});
  EXPECT_EQ(result.exit_code, 0) << result.errors;
  EXPECT_EQ(result.errors, "");
  std::ifstream file(folder_ / "noise.svg");
  const std::string picture(std::istreambuf_iterator<char>(file), {});
  EXPECT_TRUE(contains(picture, "vn-100"));
  EXPECT_TRUE(contains(picture, "native " + port + ": 180001 samples at 100 Hz in 1800.01 s"))
      << picture.substr(picture.find("native "), 200);
  std::ifstream data(folder_ / "noise.plot.csv");
  std::string header, row;
  std::getline(data, header);
  std::getline(data, row);
  EXPECT_TRUE(header.starts_with("tau_s,gyro_x,gyro_x_low,gyro_x_high,gyro_x_fitted,gyro_x_model,gyro_y,")) << header;
  EXPECT_EQ(std::ranges::count(row, ','), 30) << row;
}

// A sensor of known terms becomes a preset: N within 2 %, B and K within 25 %, which is 4 standard errors or more in
// half an hour. imud accepts it, and a recording of that model agrees with it.
TEST_F(ImuAllanModel, ARecordingBecomesAPreset) {
  const std::string preset = folder_ / "mine.toml";
  const auto made = run_program(
      "imu-allan",
      {"native",
       recording({"gyro.max_deg_per_s = 300", "gyro.angle_random_walk_deg_per_rt_hr = [0.2, 0.3, 0.4]",
                  "gyro.bias_instability_deg_per_hr = [20, 30, 0]", "gyro.bias_instability_from_s = 0.1",
                  "accelerometer.max_g = 8", "accelerometer.velocity_random_walk_m_per_s_per_rt_hr = 0.05",
                  "accelerometer.acceleration_random_walk_mg_per_rt_hr = [0, 2, 3]"}),
       "--to-config", preset});
  EXPECT_EQ(made.exit_code, 0) << made.errors;
  const ModelTerms terms = model_terms(preset, 100);
  const std::array<AllanTerms, 6> wanted = {{
      {.N = 0.2 * deg / root_hour, .B = 20 * deg / hour},
      {.N = 0.3 * deg / root_hour, .B = 30 * deg / hour},
      {.N = 0.4 * deg / root_hour},
      {.N = 0.05 / root_hour},
      {.N = 0.05 / root_hour, .K = 2 * mg / root_hour},
      {.N = 0.05 / root_hour, .K = 3 * mg / root_hour},
  }};
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    EXPECT_NEAR(terms.of[i].N, wanted[i].N, 0.02 * wanted[i].N) << i;
    EXPECT_NEAR(terms.of[i].B, wanted[i].B, 0.25 * wanted[i].B) << i;
    EXPECT_NEAR(terms.of[i].K, wanted[i].K, 0.25 * wanted[i].K) << i;
  }
  const std::string again = recording({"model = \"" + preset + "\""}, "again");
  const auto result = run_program("imu-allan", {"native", again, "--against", preset});
  EXPECT_EQ(result.exit_code, 0) << result.output << result.errors;
}

// White noise has the variance of its term in every kind; a difference has that of quantization.
TEST(SampleNoise, HasTheVarianceOfItsTerms) {
  const SampleNoise white{.of_values = {2}, .of_rates = {2}, .decimation = 5};
  const SampleNoise difference{.of_values = {2, -1}, .of_rates = {2, -1}, .decimation = 1};
  for (const AllanKind kind : allan_kinds)
    for (const std::size_t factor : {1U, 2U, 3U, 64U, 100'000U}) {
      const auto m = static_cast<double>(factor);
      const auto unit = unit_variances(kind, {.factor = factor, .tau_s = m, .record_length = 0});
      EXPECT_NEAR(white.variance(kind, factor, false) / (2 * unit[1]), 1, 1e-6) << name_of(kind) << factor;
      const auto of_five = unit_variances(kind, {.factor = 5 * factor, .tau_s = 5 * m, .record_length = 0});
      EXPECT_NEAR(white.variance(kind, factor, true) / (2 * of_five[1]), 1, 1e-6) << name_of(kind) << factor;
      EXPECT_NEAR(difference.variance(kind, factor, false) / unit[0], 1, 1e-3) << name_of(kind) << factor;
    }
}

// Recordings of a minute and more: the curve of the model is the one of imud behind the filter, and with the digits,
// of the sensor, where the terms alone are far from it.
class ImuAllanCurve : public ImuAllanModel {
 protected:
  struct Points {
    std::vector<double> seen, model, terms;
  };
  // Compares the first `count` octaves within 3 % at a rate of `rate_hz`, and returns them.
  Points compare_octaves(const std::vector<std::string>& arguments, const std::string& axis, std::size_t count) {
    std::vector<std::string> all = arguments;
    for (const std::string& more : {std::string("--json"), folder_ / "curve.json"}) all.push_back(more);
    const auto result = run_program("imu-allan", all);
    EXPECT_TRUE(result.exit_code == 0 || result.exit_code == 3) << result.errors;
    const auto json = nlohmann::json::parse(std::ifstream(folder_ / "curve.json"))["axes"][axis];
    Points points;
    for (std::size_t i = 0; i < count; ++i) {
      points.seen.push_back(json["adev"][i]);
      points.model.push_back(json["model"][i]);
      points.terms.push_back(json["N"]["model_si"].get<double>() / std::sqrt(json["tau_s"][i].get<double>()));
      EXPECT_NEAR(points.model[i] / points.seen[i], 1, 0.03) << axis << ' ' << i;
    }
    return points;
  }
};

TEST_F(ImuAllanCurve, HasTheBandwidthOfThePreset) {
  const std::string port =
      recording({"model = \"stim300\"", "gyro.bias_instability_deg_per_hr = 0", "gyro.turn_on_bias_deg_per_hr = 0"},
                "fast", 1000, 3);
  const Points points = compare_octaves({"native", port, "--against", "stim300"}, "gyro_x", 7);
  EXPECT_LT(points.seen[0], 0.8 * points.terms[0]);
  compare_octaves({"native", port, "--against", "stim300", "--increments"}, "accel_y", 7);
}

TEST_F(ImuAllanCurve, HasTheDigitsOfTheModel) {
  std::ofstream(folder_ / "digits.toml")
      << "[imu.gyro]\nmax_rad_per_s = 10\nangle_random_walk_rad_per_rt_s = 1e-4\nlsb_rad_per_s = 2e-3\nrounding = "
         "\"nearest\"\n[imu.accelerometer]\nmax_g = 10\nvelocity_random_walk_m_per_s_per_rt_s = 1e-3\n"
         "lsb_m_per_s2 = 0.02\nrounding = \"nearest\"\ncarry = true\nfir_taps = [0.5, 0.5]\n";
  const std::string model = folder_ / "digits.toml";
  const std::string port = recording({"model = \"" + model + "\""}, "digits", 100, 30);
  const Points points = compare_octaves({"native", port, "--against", model}, "gyro_z", 6);
  EXPECT_GT(points.seen[0], 1.1 * points.terms[0]);
  compare_octaves({"native", port, "--against", model}, "accel_x", 6);
  compare_octaves({"native", port, "--against", model, "--increments"}, "accel_x", 6);
}

// A VN-100 sends 40 text messages a second, of values behind its filter.
TEST_F(ImuAllanCurve, HasTheFilterOfTheProduct) {
  const std::string port = recording({}, "product", 0, 60, "vectornav");
  const Points points = compare_octaves({"vectornav", port, "--rate-hz", "40", "--against", "vn-100"}, "gyro_y", 5);
  EXPECT_GT(std::abs(points.seen[0] / points.terms[0] - 1), 0.05);
}

TEST_F(ImuAllanModel, AModelThatIsNotRightIsAnErrorWithTheRemedy) {
  std::ofstream(folder_ / "no.toml") << "[imu.gyro]\nmax_deg_per_s = = 3\n";
  std::ofstream(folder_ / "lacking.toml") << "[imu.gyro]\nmax_deg_per_s = 300\nangle_random_walk = 1\n";
  const struct {
    std::string model;
    std::string_view message;
  } cases[] = {
      {"vn100", "there is no \"vn100\"; did you mean \"vn-100\"?"},
      {folder_ / "absent.toml", "absent.toml\"; known: white, ideal, "},
      {folder_ / "no.toml", "no.toml:2: TOML: "},
      {folder_ / "lacking.toml", "lacking.toml:3: imu.gyro.angle_random_walk: unknown key"},
  };
  for (const auto& [model, message] : cases) {
    const auto result = run_program("imu-allan", {"npy", folder_ / "none", "--rate-hz", "100", "--against", model});
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_TRUE(contains(result.errors, message)) << result.errors;
    EXPECT_EQ(result.output, "");
  }
  const auto result = run_program("imu-allan", {"native", "file:/dev/null", "--to-config", "mine.txt"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_TRUE(contains(result.errors, "--to-config mine.txt: right would be FILE.toml")) << result.errors;
}

// By numbers chosen by hand: N is known to 1 %, B to 50 %, K is not seen.
TEST(AllanComparison, EachRule) {
  AllanCurve curve;
  curve.period_s = 0.01;
  for (const std::size_t factor : {1U, 100U, 10'000U})
    curve.points.push_back({factor, 0.01 * static_cast<double>(factor), 1, 0, 1, {}});
  AllanFit fit;
  fit.terms[1] = {.value = 1, .error = 0.01, .least_seen = 0.1};
  fit.terms[2] = {.value = 0.5, .error = 0.05, .least_seen = 0.1};
  fit.terms[3] = {.value = {}, .error = 0, .least_seen = 0.01};
  const auto words = [&](const AllanTerms& model, double tolerance) {
    const auto verdicts = compare(curve, fit, model, tolerance);
    return std::array{verdicts[1].word, verdicts[2].word, verdicts[3].word};
  };
  using Words = std::array<Word, 3>;
  // 3.29 standard errors and the tolerance.
  EXPECT_EQ(words({.N = 1.03, .B = 0.65}, 0), (Words{Word::agrees, Word::agrees, Word::agrees}));
  EXPECT_EQ(words({.N = 1.04, .B = 0.70}, 0), (Words{Word::differs, Word::differs, Word::agrees}));
  EXPECT_EQ(words({.N = 1.14, .B = 0.73}, 0.1), (Words{Word::agrees, Word::agrees, Word::agrees}));
  EXPECT_EQ(words({.N = 1.16, .B = 0.75}, 0.1), (Words{Word::differs, Word::differs, Word::agrees}));
  EXPECT_EQ(words({.N = 0.95, .B = 0.25}, 0.1)[1], Word::differs);
  // A term that is not seen.
  EXPECT_EQ(words({.N = 1, .B = 0.5, .K = 0.019}, 0)[2], Word::undecided);
  EXPECT_EQ(words({.N = 1, .B = 0.5, .K = 0.021}, 0)[2], Word::differs);
  EXPECT_EQ(words({.N = 1, .B = 0.5, .K = 0.021}, 0.1)[2], Word::undecided);
  // A term that the model does not have: at 100 s, 0.664 (0.5 - 0.1645) is 0.223, beside 0.1 of N; beside 0.6 of a K
  // of 0.1 it adds 7 %.
  EXPECT_EQ(words({.N = 1}, 0.5)[1], Word::differs);
  EXPECT_EQ(words({.N = 1, .K = 0.1}, 0.1)[1], Word::agrees);

  // Where the curves agree, N does not differ; B does.
  const auto by_curve = compare(curve, fit, {.N = 0.5, .B = 2}, 0.1, true);
  EXPECT_EQ(by_curve[1].word, Word::agrees);
  EXPECT_TRUE(by_curve[1].is_by_curve);
  EXPECT_EQ(by_curve[2].word, Word::differs);
  EXPECT_FALSE(compare(curve, fit, {.N = 1, .B = 0.5}, 0.1, true)[1].is_by_curve);

  EXPECT_TRUE(agrees(compare(curve, fit, {.N = 1, .B = 0.5}, 0.1)));
  EXPECT_TRUE(agrees(compare(curve, fit, {.N = 1, .B = 0.5, .K = 0.01}, 0.1)));
  EXPECT_FALSE(agrees(compare(curve, fit, {.N = 2, .B = 0.5}, 0.1)));
  // Nothing of the model is decided.
  fit = {};
  fit.terms[3].least_seen = 1;
  EXPECT_FALSE(agrees(compare(curve, fit, {.K = 0.1}, 0.1)));
  EXPECT_TRUE(agrees(compare(curve, AllanFit{}, {}, 0.1)));
}

// With 200 degrees of freedom, at 1 - 1e-3/3 for each, a deviation is within about 15 % below and 21 % above.
TEST(AllanComparison, CurvesAgreeWithinTheirConfidence) {
  AllanCurve curve;
  for (const std::size_t factor : {1U, 2U, 4U})
    curve.points.push_back({factor, static_cast<double>(factor), 1, 0, 200, {}});
  const auto agrees_with = [&](double last, double tolerance) {
    return has_deviations_of(curve, std::array{1.0, 1.0, last}, tolerance);
  };
  EXPECT_TRUE(agrees_with(1, 0));
  EXPECT_TRUE(agrees_with(1.17, 0));
  EXPECT_TRUE(agrees_with(0.87, 0));
  EXPECT_FALSE(agrees_with(1.25, 0));
  EXPECT_FALSE(agrees_with(0.8, 0));
  EXPECT_TRUE(agrees_with(1.25, 0.1));
  EXPECT_FALSE(agrees_with(1.4, 0.1));
}

}  // namespace
}  // namespace imud
