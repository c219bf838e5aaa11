#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "core/units.hpp"
#include "tests/support/text.hpp"
#include "tests/tools/run_program.hpp"
#include "tests/tools/sample_stream.hpp"
#include "tests/tools/synthetic_noise.hpp"
#include "tests/transports/capture_builder.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

constexpr double rate_hz = 100;
constexpr double angle_random_walk = 0.15 * units::degree / 60;  // 0.15 deg/sqrt(h)
constexpr double velocity_random_walk = 0.07 / 60;               // 0.07 m/s/sqrt(h)

// White noise at rest, in rates and increments alike.
std::vector<Sample> still_samples(std::size_t count) {
  auto samples = steady_samples(count, rate_hz);
  SyntheticNoise noise(7);
  for (Sample& sample : samples) {
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      sample.rate[axis] = angle_random_walk * std::sqrt(rate_hz) * noise.normal();
      sample.specific_force[axis] = velocity_random_walk * std::sqrt(rate_hz) * noise.normal();
    }
    sample.specific_force[2] -= 9.80665;
    sample.delta_angle = sample.rate / rate_hz;
    sample.delta_velocity = sample.specific_force / rate_hz;
    sample.status = 0;
  }
  return samples;
}

std::string little_endian(double value) {
  const auto bits = std::bit_cast<std::uint64_t>(value);
  std::string bytes;
  for (unsigned i = 0; i < 8; ++i) bytes += static_cast<char>(bits >> (8 * i));
  return bytes;
}

std::string npy_of(std::span<const Sample> samples) {
  std::string header =
      "{'descr': '<f8', 'fortran_order': False, 'shape': (" + std::to_string(samples.size()) + ", 6), }";
  header += std::string((64 - (10 + header.size() + 1) % 64) % 64, ' ') + "\n";
  std::string file = std::string("\x93NUMPY\x01\x00", 8) + static_cast<char>(header.size()) + '\0' + header;
  for (const Sample& sample : samples) {
    for (const double value : sample.rate) file += little_endian(value);
    for (const double value : sample.specific_force) file += little_endian(value);
  }
  return file;
}

nlohmann::json result_of(const std::vector<std::string>& arguments, const ScratchFolder& folder) {
  auto all = arguments;
  all.insert(all.end(), {"--json", folder / "result.json"});
  const auto result = run_program("imu-allan", all);
  EXPECT_EQ(result.exit_code, 0) << result.errors;
  return nlohmann::json::parse(read_file(folder / "result.json"));
}

void expect_noise_of_the_samples(const nlohmann::json& result) {
  ASSERT_EQ(result["axes"].size(), 6U);
  for (const auto& [name, axis] : result["axes"].items()) {
    const bool is_rate = name.starts_with("gyro");
    const double expected = is_rate ? angle_random_walk : velocity_random_walk;
    const auto& N = axis["N"];
    // The bound is 4.5 standard errors of 20,000 samples.
    EXPECT_NEAR(N["si"].get<double>() / expected, 1, 4.5 * N["si_error"].get<double>() / expected) << name;
    EXPECT_LT(N["si_error"].get<double>() / expected, 0.01) << name;
    EXPECT_NEAR(N["datasheet"].get<double>(), N["si"].get<double>() / expected * (is_rate ? 0.15 : 0.07), 1e-9);
    EXPECT_EQ(N["datasheet_unit"], is_rate ? "deg/sqrt(h)" : "m/s/sqrt(h)");
    for (const char* term : {"B", "K", "Q", "R"}) EXPECT_TRUE(axis[term]["si"].is_null()) << name << term;
    ASSERT_GE(axis["tau_s"].size(), 12U);
    for (const char* list : {"adev", "confidence", "fitted", "degrees_of_freedom", "noise_exponent"})
      EXPECT_EQ(axis[list].size(), axis["tau_s"].size()) << list;
    EXPECT_DOUBLE_EQ(axis["tau_s"][0].get<double>(), 0.01);
    EXPECT_LT(axis["confidence"][3][0].get<double>(), axis["adev"][3].get<double>());
    EXPECT_GT(axis["confidence"][3][1].get<double>(), axis["adev"][3].get<double>());
  }
}

TEST(ImuAllan, EveryInputGivesTheSameNoise) {
  const ScratchFolder folder;
  const auto samples = still_samples(20'000);
  capture::write_file(folder / "native", bytes_of("native", samples));
  capture::write_file(folder / "rows.csv", csv_of(samples));
  capture::write_file(folder / "array.npy", npy_of(samples));
  const auto native = result_of({"native", "file:" + (folder / "native")}, folder);
  expect_noise_of_the_samples(native);
  EXPECT_EQ(native["samples"], 20'000);
  EXPECT_NEAR(native["rate_hz"].get<double>(), 100, 1e-9);
  EXPECT_EQ(native["missing"], 0);

  const auto csv = result_of({"csv", "file:" + (folder / "rows.csv")}, folder);
  const auto npy = result_of({"npy", folder / "array.npy", "--rate-hz", "100"}, folder);
  EXPECT_EQ(csv["axes"], native["axes"]);
  EXPECT_EQ(npy["axes"], native["axes"]);
  expect_noise_of_the_samples(result_of({"native", "file:" + (folder / "native"), "--increments"}, folder));
}

TEST(ImuAllan, TheTableHasDatasheetUnits) {
  const ScratchFolder folder;
  capture::write_file(folder / "native", bytes_of("native", still_samples(20'000)));
  const auto result = run_program("imu-allan", {"native", "file:" + (folder / "native")});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_TRUE(
      result.output.starts_with("samples    20000 in 200.000 s, 100 Hz (device clock)\n"
                                "gaps       0 (0 samples missing, 0 repeated, 0 invalid), joined\n"
                                "deviation  overlapping, 13 averaging times from 0.01 s to 40.96 s\n"
                                "gyro_x     Q quantization              not seen; from "))
      << result.output;
  EXPECT_TRUE(contains(result.output, " deg/sqrt(h)   = 4.3")) << result.output;
  EXPECT_TRUE(contains(result.output, "accel_z    Q "));
}

TEST(ImuAllan, MissingSamplesAreJoinedUpToALimit) {
  const ScratchFolder folder;
  auto samples = still_samples(20'000);
  samples.erase(samples.begin() + 5000, samples.begin() + 5015);
  capture::write_file(folder / "native", bytes_of("native", samples));
  const auto joined = result_of({"native", "file:" + (folder / "native")}, folder);
  EXPECT_EQ(joined["missing"], 15);
  EXPECT_NEAR(joined["rate_hz"].get<double>(), 100, 1e-9);
  expect_noise_of_the_samples(joined);
  const auto refused = run_program("imu-allan", {"native", "file:" + (folder / "native"), "--max-missing", "0.05"});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_TRUE(contains(refused.errors, "of 19985 samples 15 are missing")) << refused.errors;

  const auto again = still_samples(1000);
  samples.insert(samples.end(), again.begin(), again.end());
  capture::write_file(folder / "native", bytes_of("native", samples));
  const auto restarted = run_program("imu-allan", {"native", "file:" + (folder / "native")});
  EXPECT_EQ(restarted.exit_code, 1);
  EXPECT_TRUE(contains(restarted.errors, "right would be a recording without a restart")) << restarted.errors;
}

TEST(ImuAllan, LimitsDecideTheExitCode) {
  const ScratchFolder folder;
  capture::write_file(folder / "native", bytes_of("native", still_samples(20'000)));
  const auto with = [&](const std::string& limits) {
    return run_program("imu-allan", {"native", "file:" + (folder / "native"), "--require", limits});
  };
  EXPECT_EQ(with("gyro.N<4.5e-5,gyro_x.angle_random_walk_deg_per_rt_hr<0.155,accel.N>0.0011,gyro.K=0").exit_code, 0);
  const auto broken = with("gyro_z.angle_random_walk_deg_per_rt_hr<0.12");
  EXPECT_EQ(broken.exit_code, 3);
  EXPECT_TRUE(contains(broken.output, "required   gyro_z.angle_random_walk_deg_per_rt_hr<0.12: VIOLATED, 0.1"));
  // In 200 s a random walk of that size would not be seen.
  EXPECT_EQ(with("gyro.K<1e-12").exit_code, 3);
}

TEST(ImuAllan, ThePlotStandsBesideItsData) {
  const ScratchFolder folder;
  capture::write_file(folder / "native", bytes_of("native", still_samples(2'000)));
  for (const std::string ending : {".svg", ".png"}) {
    const std::string picture = folder / ("it's a \"plot\"" + ending);
    const auto result = run_program("imu-allan", {"native", "file:" + (folder / "native"), "--plot", picture});
    EXPECT_EQ(result.exit_code, 0) << result.errors;
    EXPECT_EQ(result.errors, "");
    const std::string content = read_file(picture);
    EXPECT_TRUE(ending == ".svg" ? contains(content, "accel_z") && contains(content, "</svg>")
                                 : content.starts_with("\x89PNG"));
    const std::string data = read_file(folder / "it's a \"plot\".plot.csv");
    EXPECT_TRUE(data.starts_with("tau_s,gyro_x,gyro_x_low,gyro_x_high,gyro_x_fitted,gyro_y,")) << data;
    EXPECT_EQ(std::ranges::count(data, '\n'), 11);
    EXPECT_EQ(std::ranges::count(data, ','), 11 * 24);
  }
  const std::string own = folder / "b.plot.csv";
  for (const char* content : {"the user's\n", "tau_s,of a plot\n"}) {
    std::ofstream(own) << content;
    const bool is_data = std::string_view(content).starts_with("tau_s,");
    const auto again =
        run_program("imu-allan", {"native", "file:" + (folder / "native"), "--plot", folder / "b.svg"});
    EXPECT_EQ(again.exit_code, is_data ? 0 : 2) << again.errors;
    EXPECT_EQ(read_file(own) == content, !is_data);
  }
  const auto without = run_program("/usr/bin/env", {"PATH=/nowhere", IMUD_BIN_DIR "/imu-allan", "native",
                                                    "file:" + (folder / "native"), "--plot", folder / "a.svg"});
  EXPECT_EQ(without.exit_code, 2);
  EXPECT_TRUE(contains(without.errors, "apt-get install gnuplot-nox")) << without.errors;
}

TEST(ImuAllan, EveryDeviationAndMoreTimesPerDecade) {
  const ScratchFolder folder;
  capture::write_file(folder / "array.npy", npy_of(still_samples(5'000)));
  for (const char* name : {"allan", "overlapping", "modified", "hadamard", "overlapping-hadamard", "total"}) {
    const auto result = result_of(
        {"npy", folder / "array.npy", "--rate-hz", "100", "--deviation", name, "--per-decade", "5"}, folder);
    EXPECT_EQ(result["deviation"], name);
    const auto& N = result["axes"]["gyro_y"]["N"];
    EXPECT_NEAR(N["datasheet"].get<double>(), 0.15, 4.5 * N["datasheet_error"].get<double>()) << name;
  }
}

TEST(ImuAllan, BadInputIsAnErrorThatHasTheRemedy) {
  const ScratchFolder folder;
  const auto samples = still_samples(100);
  auto with_nan = samples;
  with_nan[50].rate[1] = std::nan("");
  capture::write_file(folder / "nan.npy", npy_of(with_nan));
  capture::write_file(folder / "good.npy", npy_of(samples));
  capture::write_file(folder / "short.npy", npy_of(std::span(samples).first(31)));
  capture::write_file(folder / "text.npy", "1.0,2.0\n3.0,4.0\n");
  capture::write_file(folder / "short", bytes_of("native", std::span(samples).first(31)));
  capture::write_file(folder / "garbage", "Sensor 1: 17.3\nSensor 2: ...\n");
  std::string no_time(measurement_csv_header);
  for (int i = 0; i < 100; ++i) no_time += ",,1,2,3,,,,,,,,,,,\n";
  capture::write_file(folder / "no_time.csv", no_time);
  const std::string file = "file:" + (folder / "short");
  const struct {
    std::vector<std::string> arguments;
    int exit_code;
    std::string_view message;
  } cases[] = {
      {{"npy", folder / "nan.npy", "--rate-hz", "100"}, 1, "row 50, column 1 is nan; right would be a finite number"},
      {{"npy", folder / "short.npy", "--rate-hz", "100"}, 1, "31 samples are too few; right would be at least 32"},
      {{"npy", folder / "text.npy", "--rate-hz", "100"}, 1, "this is no NumPy file; right would be"},
      {{"npy", folder / "good.npy"}, 2, "right would be --rate-hz HZ"},
      {{"npy", folder / "none.npy", "--rate-hz", "100"}, 2, "cannot read it"},
      {{"npy", folder / "good.npy", "--rate-hz", "100", "--columns", "gyro_x,-"}, 2, "the array has 6 columns"},
      {{"npy", folder / "good.npy", "--rate-hz", "100", "--json", folder / "good.npy"}, 2, "is the input"},
      {{"native", file}, 1, "31 samples are too few"},
      {{"native", "file:" + (folder / "garbage")}, 1, "0 samples are too few"},
      {{"csv", "file:" + (folder / "garbage")}, 1, "0 samples are too few"},
      {{"csv", "file:" + (folder / "no_time.csv")}, 1, "right would be --rate-hz HZ"},
      {{"nativ", file}, 2, "there is no protocol 'nativ'"},
      {{"native", "can:can0"}, 2, "native needs a port for bytes"},
      {{"native", "file:/does/not/exist"}, 2, "cannot read it"},
      {{"native", file, "--deviation", "adev"}, 2, "right would be one of allan, overlapping, modified"},
      {{"native", file, "--plot", "a.jpg"}, 2, "right would be FILE.svg or FILE.png"},
      {{"native", file, "--require", "gyro.X<1"}, 2, "right would be an axis"},
      {{"native", file, "--require", "gyro.N"}, 2, "right would be FIGURE>=NUMBER"},
      {{"native", file, "--confidence", "1"}, 2, "--confidence"},
      {{"native", file, "--fit-from", "10", "--fit-to", "1"}, 2, "right would be a --fit-from below --fit-to"},
      {{"native", file, "--fit-from", "1", "--fit-to", "1"}, 2, "right would be a --fit-from below --fit-to"},
      {{"npy", folder / "good.npy", "--rate-hz", "100", "--fit-from", "1e6", "--to-config", folder / "model.toml"},
       2,
       "--fit-from, --fit-to: 0 averaging times lie in this range; right would be two or more of 0.01 s to 0.32 s"},
      {{"npy", folder / "good.npy", "--rate-hz", "100", "--fit-to", "0.01"},
       2,
       "1 averaging time lies in this range"},
      {{"native", file, "--tolerance", "5"}, 2, "--tolerance requires --against"},
      {{"native", file, "--columns", "gyro_x"}, 2, "--columns requires npy"},
      {{"npy", folder / "good.npy", "--rate-hz", "100", "--increments"}, 2, "npy excludes --increments"},
      {{"npy", folder / "good.npy", "--rate-hz", "100", "--count", "50"}, 2, "npy excludes --count"},
      {{"npy", folder / "good.npy", "--rate-hz", "100", "--set", "a=b"}, 2, "npy excludes --set"},
      {{"native", file, "--per-decade", "0"}, 2, "--per-decade"},
      {{"native", file, "--rate-hz", "nan"}, 2, "--rate-hz"},
      {{"native"}, 2, "PORT"},
  };
  for (const auto& [arguments, exit_code, message] : cases) {
    const auto result = run_program("imu-allan", arguments);
    EXPECT_EQ(result.exit_code, exit_code) << message;
    EXPECT_TRUE(contains(result.errors, message)) << result.errors << "\nlacks: " << message;
    EXPECT_EQ(result.output, "");
  }
  EXPECT_EQ(read_file(folder / "good.npy"), npy_of(samples));
  EXPECT_EQ(read_file(folder / "model.toml"), "");
}

// A sensor that does not move at all, or not between two LSB: no noise, and no term.
TEST(ImuAllan, ConstantDataHaveNoTerms) {
  const ScratchFolder folder;
  auto samples = still_samples(1000);
  for (Sample& sample : samples) sample.rate = {0, 1, 2};
  capture::write_file(folder / "array.npy", npy_of(samples));
  const auto result = result_of({"npy", folder / "array.npy", "--rate-hz", "100"}, folder);
  for (const char* term : {"N", "B", "K", "Q", "R"}) {
    EXPECT_TRUE(result["axes"]["gyro_x"][term]["si"].is_null()) << term;
    EXPECT_TRUE(result["axes"]["gyro_x"][term]["least_seen_si"].is_null()) << term;
  }
  EXPECT_EQ(result["axes"]["gyro_z"]["adev"][0], 0);
  EXPECT_FALSE(result["axes"]["accel_z"]["N"]["si"].is_null());

  // A picture has the other axes; without them there is none.
  const auto draw = [&] {
    return run_program("imu-allan", {"npy", folder / "array.npy", "--rate-hz", "100", "--plot", folder / "a.svg"});
  };
  samples[500].rate[2] = 3;
  capture::write_file(folder / "array.npy", npy_of(samples));
  const auto drawn = draw();
  EXPECT_EQ(drawn.exit_code, 0);
  EXPECT_EQ(drawn.errors, "");
  const std::string picture = read_file(folder / "a.svg");
  EXPECT_TRUE(contains(picture, "gyro_z") && contains(picture, "accel_x")) << picture.size();
  EXPECT_FALSE(contains(picture, "gyro_x"));
  for (Sample& sample : samples) sample.rate = sample.specific_force = {1, 2, 3};
  capture::write_file(folder / "array.npy", npy_of(samples));
  const auto none = draw();
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_EQ(lines_of(none.errors).size(), 1U) << none.errors;
  EXPECT_TRUE(
      contains(none.errors, "--plot: no channel changes, and a logarithmic axis cannot show a deviation of 0"))
      << none.errors;
}

TEST(ImuAllan, HelpAndVersion) {
  const auto help = run_program("imu-allan", {"--help"});
  EXPECT_EQ(help.exit_code, 0);
  for (const Protocol* protocol : protocols()) EXPECT_TRUE(contains(help.output, protocol->name));
  EXPECT_TRUE(run_program("imu-allan", {"--version"}).output.starts_with("imu-allan "));
}

}  // namespace
}  // namespace imud
