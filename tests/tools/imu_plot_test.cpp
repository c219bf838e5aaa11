#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <map>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "core/units.hpp"
#include "tests/support/text.hpp"
#include "tests/tools/run_program.hpp"
#include "tests/tools/synthetic_noise.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "tools/plot/run_errors.hpp"
#include "tools/plot/run_plot.hpp"

namespace imud {
namespace {

StillRecording recording_of(std::vector<double> values) {
  StillRecording recording;
  recording.rate_hz = 10;
  recording.channels.push_back({2, std::move(values)});
  return recording;
}

TEST(RunErrors, ErrorMeanAndSigmaAreThoseOfTheSeeds) {
  // 99 samples are not smoothed. The other seeds' errors are -1, 1 and 3: mean 1, standard deviation 2.
  const std::vector<double> truth(99, 5), measured(99, 5.5);
  const auto run = compare_runs(recording_of(measured), recording_of(truth), 3, [](std::uint64_t seed) {
    return recording_of(std::vector<double>(99, 4 + 2 * static_cast<double>(seed)));
  });
  ASSERT_EQ(run.channels.size(), 1U);
  const auto& channel = run.channels[0];
  EXPECT_EQ(channel.name(), "gyro_z");
  EXPECT_DOUBLE_EQ(channel.error[50], 0.5);
  EXPECT_DOUBLE_EQ(channel.mean[50], 1);
  EXPECT_DOUBLE_EQ(channel.sigma[98], 2);
  EXPECT_EQ(channel.density.size(), run.frequencies_hz.size());
  EXPECT_DOUBLE_EQ(run.frequencies_hz.back(), 5);
  EXPECT_NEAR(channel.density[3], 0, 1e-12);  // a constant error

  EXPECT_THROW(compare_runs(recording_of(measured), recording_of({1, 2, 3}), 0, {}), std::runtime_error);
}

// The logarithmic axes of a spectrum end with its chart.
TEST(RunErrors, EachChartBeginsWithPlainAxes) {
  const std::vector<double> truth(99, 5), measured(99, 5.5);
  const auto run = compare_runs(recording_of(measured), recording_of(truth), 3, [](std::uint64_t seed) {
    return recording_of(std::vector<double>(99, 4 + 2 * static_cast<double>(seed)));
  });
  const std::string commands = run_plot_commands(run, "samples.csv", "spectrum.csv", "run.svg");
  std::size_t charts = 0, begin = 0;
  for (std::size_t at = commands.find("\nplot "); at != commands.npos; at = commands.find("\nplot ", begin)) {
    const std::string chart = commands.substr(begin, at - begin);
    const std::size_t plain = chart.find("unset logscale\nset format '%g'\nset autoscale\nunset xlabel\n");
    ASSERT_NE(plain, chart.npos) << chart;
    EXPECT_EQ(chart.substr(0, plain).find("set logscale"), chart.npos) << chart;
    begin = at + 1;
    ++charts;
  }
  EXPECT_EQ(charts, 3U);
}

// White noise of sigma 1 at 200 Hz has the one-sided density 2/200. The mean of the squares over 400,000 samples has
// a standard error below 0.3 %: the bound of 2 % is beyond chance.
TEST(RunErrors, TheDensityIsOneSided) {
  SyntheticNoise noise(3);
  std::vector<double> values(400'000);
  for (double& value : values) value = 7 + noise.normal();
  const auto density = root_density(values, 200);
  double mean = 0;
  for (std::size_t k = 10; k + 10 < density.size(); ++k)
    mean += density[k] * density[k] / static_cast<double>(density.size() - 20);
  EXPECT_NEAR(mean, 0.01, 0.0002);

  // The power of a sine of amplitude 3 is 4.5, and is at its frequency.
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = 3 * std::sin(2 * std::numbers::pi * 20 * static_cast<double>(i) / 200);
  const auto line = root_density(values, 200);
  double power = 0;
  const double step = 100 / static_cast<double>(line.size() - 1);
  for (const double root : line) power += root * root * step;
  EXPECT_NEAR(power, 4.5, 0.01);
  const auto peak = std::max_element(line.begin(), line.end()) - line.begin();
  EXPECT_NEAR(static_cast<double>(peak) * step, 20, step);
}

class ImuPlot : public testing::Test {
 protected:
  // A flight of ten seconds. The first imu would open a port that does not exist.
  void write_config(const std::string& imu) const {
    std::ofstream(folder_ / "imu.toml")
        << "[truth]\nport = \"udp:127.0.0.1:5140\"\nformat = \"jsbsim\"\n[[imu]]\nname = \"other\"\nprotocol = "
           "\"native\"\nrate_hz = 10\nport = \"serial:/dev/does/not/exist\"\nmodel = \"stim300\"\n[[imu]]\nname = "
           "\"mine\"\n"
        << imu;
  }
  ProgramResult plot(const std::string& picture, std::vector<std::string> more = {}) const {
    std::vector<std::string> arguments = {folder_ / "imu.toml",
                                          IMUD_TEST_DATA "/captures/jsbsim_c172_10s.pcap?port=5140",
                                          "--plot",
                                          folder_ / picture,
                                          "--imu",
                                          "mine"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_program("imu-plot", arguments);
  }
  // Returns the columns of a file by their names.
  std::map<std::string, std::vector<double>> columns(const std::string& name) const {
    std::ifstream file(folder_ / name);
    std::map<std::string, std::vector<double>> result;
    std::vector<std::string> names;
    std::string line, cell;
    std::getline(file, line);
    for (std::istringstream cells(line); std::getline(cells, cell, ',');) names.push_back(cell);
    while (std::getline(file, line)) {
      std::istringstream cells(line);
      for (std::size_t i = 0; std::getline(cells, cell, ','); ++i)
        result[names.at(i)].push_back(std::strtod(cell.c_str(), nullptr));
    }
    return result;
  }
  std::string content(const std::string& name) const {
    std::ifstream file(folder_ / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  ScratchFolder folder_;
};

double mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

// White noise of a known density, a scale factor and a bias, whose mean and sigma are known: sigma of 2001 samples of
// 16 seeds within 2 % (the standard error is 0.4 %).
TEST_F(ImuPlot, DrawsARunItsErrorsAndTheirSpectrum) {
  write_config(
      "port = \"pty:imu1\"\nprotocol = \"native\"\nrate_hz = 200\ngyro.max_rad_per_s = 10\ngyro.bias_rad_per_s = "
      "[0.01, 0, 0]\n"
      "gyro.noise_density_deg_per_s_per_rt_hz = 0.01\naccelerometer.max_g = 10\n"
      "accelerometer.scale_factor = [1, 1, 1.01]\naccelerometer.noise_density_mg_per_rt_hz = 0.1\n");
  const auto result = plot("run.svg");
  EXPECT_EQ(result.exit_code, 0) << result.errors;
  EXPECT_TRUE(result.errors.starts_with("imu-plot: truth: columns that are not used: ")) << result.errors;
  EXPECT_EQ(lines_of(result.errors).size(), 1U) << result.errors;
  EXPECT_TRUE(result.output.starts_with("mine: 2001 samples at 200 Hz, and 16 other seeds\ngyro_x   error rms "))
      << result.output;
  const std::string svg = content("run.svg");
  for (const char* text :
       {"</svg>", "accel_z in m/s^2", "error in mg", "error in deg/s/sqrt(Hz)", "1 sigma", "truth"})
    EXPECT_TRUE(contains(svg, text)) << text;

  const auto samples = columns("run.plot.csv");
  ASSERT_EQ(samples.size(), 31U);
  ASSERT_EQ(samples.at("time_s").size(), 2001U);
  EXPECT_DOUBLE_EQ(samples.at("time_s").back(), 10);
  const double sigma = 0.01 * units::degree * std::sqrt(200.0), force_sigma = 0.1e-3 * 9.80665 * std::sqrt(200.0);
  EXPECT_NEAR(mean(samples.at("gyro_x_sigma")), sigma, 0.02 * sigma);
  EXPECT_NEAR(mean(samples.at("accel_y_sigma")), force_sigma, 0.02 * force_sigma);
  EXPECT_NEAR(mean(samples.at("gyro_x_mean")), 0.01, 4 * sigma / std::sqrt(16 * 2001.0));
  EXPECT_NEAR(mean(samples.at("accel_z_mean")), 0.01 * mean(samples.at("accel_z_truth")),
              4 * force_sigma / std::sqrt(16 * 2001.0));
  for (const std::size_t i : {0U, 700U, 2000U})
    EXPECT_NEAR(samples.at("gyro_y")[i] - samples.at("gyro_y_truth")[i], samples.at("gyro_y_error")[i], 1e-12);

  // The one-sided density is sqrt(2) of the two-sided one. Its mean square over 250 frequencies has a standard error
  // of some 5 %.
  const auto spectrum = columns("run.plot_spectrum.csv");
  ASSERT_EQ(spectrum.size(), 7U);
  double square = 0;
  for (const double root : spectrum.at("gyro_z"))
    square += root * root / static_cast<double>(spectrum.at("gyro_z").size());
  EXPECT_NEAR(std::sqrt(square), std::sqrt(2.0) * 0.01 * units::degree, 0.15 * 0.01 * units::degree);
}

// The solution of a filter whose receiver jumps by 20 m from 5 s to 8 s, and accepts it after a second.
TEST_F(ImuPlot, DrawsTheSolutionOfAFilter) {
  const std::string unit =
      "port = \"pty:imu1\"\nprotocol = \"native\"\nrate_hz = 100\nmodel = \"vn-100\"\n[imu.magnetometer]\nmodel = "
      "\"rm3100\"\n[imu.navigation]\nposition_noise_m = 1\nvelocity_noise_m_per_s = 0.05\n";
  const std::string jump =
      "[earth]\nframe = \"inertial\"\n[[fault]]\ntarget = \"gnss\"\nkind = \"jump\"\nnorth_m = 20\nat_s = 5\nfor_s = "
      "3\n";
  const std::vector<std::string> more = {"--solution", folder_ / "solution.svg", "--seeds", "2"};
  write_config(unit + jump);
  const auto none = plot("run.svg", more);
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_EQ(content("run.svg"), "") << "the run has not begun";
  EXPECT_TRUE(contains(none.errors, "[imu.navigation] solution = \"filter\"")) << none.errors;
  write_config(unit + "solution = \"filter\"\naccept_after_s = 1\n" + jump);
  const auto result = plot("run.svg", more);
  ASSERT_EQ(result.exit_code, 0) << result.errors;
  EXPECT_TRUE(contains(result.output, "\nabout_down     error rms ")) << result.output;
  for (const char* text : {"</svg>", "error about_north, deg", "1 sigma, as reported", "magnetic_heading"})
    EXPECT_TRUE(contains(content("solution.svg"), text)) << text;
  const auto rows = columns("solution.plot.csv");
  ASSERT_EQ(rows.size(), 42U);
  ASSERT_EQ(rows.at("time_s").size(), 1001U);
  for (std::size_t i = 0; i < 1001; i += 25) {
    SCOPED_TRACE(i);
    const bool is_aligned = i >= 100, has_jumped = i >= 620 && i<800, is_before = i> 300 && i < 500;
    EXPECT_EQ(std::isnan(rows.at("north")[i]), !is_aligned);
    EXPECT_EQ(std::isnan(rows.at("about_down_sigma")[i]), !is_aligned);
    if (!is_aligned) continue;
    EXPECT_NEAR(rows.at("north")[i] - rows.at("north_truth")[i], rows.at("north_error")[i], 0.01);
    EXPECT_LT(std::abs(rows.at("roll")[i] - rows.at("roll_truth")[i]), 2);
    EXPECT_GT(rows.at("velocity_down_sigma")[i], 0.001);
    if (is_before) {
      EXPECT_LT(std::abs(rows.at("north_error")[i]), 3);
      EXPECT_LT(rows.at("normalized_square")[i], 5);
      EXPECT_EQ(rows.at("gnss_position")[i], 1);
    } else if (has_jumped) {
      EXPECT_NEAR(rows.at("north_error")[i], 20, 3);
      EXPECT_GT(rows.at("normalized_square")[i], 10);
    }
  }
  EXPECT_EQ(rows.at("gnss_position")[550], -1);
  EXPECT_EQ(rows.at("magnetic_heading")[550], 1);
}

// Without a place an AHRS has an attitude alone, and a filter that needs places never aligns.
TEST_F(ImuPlot, DrawsTheAttitudeOfAUnitWithoutAPlace) {
  const std::string truth = folder_ / "truth.csv";
  ASSERT_EQ(run_program("imu-truth", {"spiral", "--rate", "50", "--for", "10", "--csv", truth}).exit_code, 0);
  const auto draw = [&](const std::string& solution) {
    std::ofstream(folder_ / "imu.toml")
        << "[truth]\nport = \"udp:127.0.0.1:5140\"\nformat = \"csv\"\n[[imu]]\nprotocol = \"native\"\nrate_hz = 100\n"
           "port = \"pty:imu1\"\nmodel = \"vn-100\"\nnavigation.solution = \""
        << solution << "\"\n";
    return run_program("imu-plot", {folder_ / "imu.toml", truth, "--plot", folder_ / "run.svg", "--solution",
                                    folder_ / "solution.svg", "--seeds", "2"});
  };
  const auto attitude = draw("attitude");
  ASSERT_EQ(attitude.exit_code, 0) << attitude.errors;
  EXPECT_TRUE(contains(attitude.output, "\nabout_down     error rms ")) << attitude.output;
  EXPECT_FALSE(contains(attitude.output, "velocity_north")) << attitude.output;
  EXPECT_FALSE(contains(content("solution.svg"), "velocity_north"));
  const auto squares = columns("solution.plot.csv").at("normalized_square");
  EXPECT_GT(std::ranges::count_if(squares, [](double one) { return one < 100; }), 500) << "of the attitude";

  const auto filter = draw("filter");
  EXPECT_EQ(filter.exit_code, 1);
  EXPECT_TRUE(contains(filter.errors, "has not aligned in this run")) << filter.errors;
  EXPECT_FALSE(contains(filter.errors, "gnuplot")) << filter.errors;
}

// Products of both links, one with lists as settings: the same errors, through their bytes.
TEST_F(ImuPlot, DecodesProductsOfBothLinks) {
  for (const std::string device :
       {"port = \"pty:imu1\"\nprotocol = \"vectornav\"\ndevice.binary_1 = \"1,4,01,0121\"\ndevice.baud = 921600\n",
        "port = \"pty:imu1\"\nprotocol = \"stim300\"\ndevice.sample_rate = 250\n",
        "port = \"can:none\"\nprotocol = \"xsens-can\"\ndevice.output_rate_hz = 200\n",
        "port = \"can:none\"\nprotocol = \"native-can\"\nrate_hz = 200\ngyro.max_rad_per_s = 9\naccelerometer.max_g "
        "= 9\n"}) {
    write_config(device + "model = \"white\"\ngyro.walk_sqrt_cov = [0, 0, 0]\ngyro.bias_rad_per_s = [0, 0, 0.25]\n");
    const auto result = plot("run.png", {"--seeds", "2"});
    EXPECT_EQ(result.exit_code, 0) << result.errors;
    EXPECT_FALSE(contains(result.errors, "Warning")) << result.errors;
    // Its samples have no time: the rate is that of its settings.
    if (contains(device, "stim300")) {
      EXPECT_TRUE(contains(result.output, " samples at 250 Hz,")) << result.output;
    }
    EXPECT_TRUE(content("run.png").starts_with("\x89PNG"));
    const auto samples = columns("run.plot.csv");
    ASSERT_EQ(samples.count("gyro_z_error"), 1U) << device;
    EXPECT_GT(samples.at("gyro_z_error").size(), 1900U);
    EXPECT_NEAR(mean(samples.at("gyro_z_error")), 0.25, 1e-4) << device;
    EXPECT_NEAR(mean(samples.at("gyro_x_error")), 0, 1e-4) << device;
  }
}

// Ten measurements a second between slower messages, of the rate about z alone.
TEST_F(ImuPlot, SlowMessagesDoNotCountForTheRate) {
  std::ofstream(folder_ / "turns.toml") << "frame_version = 1\nname = \"turns\"\ndocument = \"none\"\n"
                                           "[line]\nbaud = 115200\n"
                                           "[[message]]\nname = \"DATE\"\nrate_hz = 1\n"
                                           "text = \"$D,{utc_day:02d?}*{check:xor8}\\r\\n\"\n"
                                           "[[message]]\nname = \"TURN\"\nrate_hz = 10\n"
                                           "text = \"$R,{rate_z_deg_per_s:.1f}*{check:xor8}\\r\\n\"\n";
  write_config(
      "port = \"pty:imu1\"\nprotocol = \"frame\"\ndevice.frame_file = \"turns.toml\"\nrate_hz = 100\n"
      "gyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 200\n");
  const auto result = plot("run.png");
  EXPECT_EQ(result.exit_code, 0) << result.errors;
  EXPECT_TRUE(contains(result.output, " samples at 10 Hz,")) << result.output;
  const auto samples = columns("run.plot.csv");
  EXPECT_EQ(samples.count("gyro_z_error"), 1U);
  EXPECT_EQ(samples.count("gyro_x_error"), 0U);
}

// The truth is the motion without faults; faults of another imu and expectations of a host are no matter.
TEST_F(ImuPlot, AFaultIsAnError) {
  write_config(
      "port = \"pty:imu1\"\nprotocol = \"native\"\nrate_hz = 200\nmodel = \"ideal\"\ngyro.max_rad_per_s = 10\n"
      "accelerometer.max_g = 10\n"
      "[[fault]]\nimu = \"other\"\ntarget = \"gyro.y\"\nkind = \"stuck\"\nat_s = 1\n"
      "[[fault]]\nimu = \"*\"\ntarget = \"gyro.x\"\nkind = \"bias\"\nvalue_deg_per_s = 1\nat_s = 5\n"
      "[[expect]]\nimu = \"mine\"\nwhat = \"host_sends\"\nwithin_s = 1\n");
  const auto result = plot("run.svg", {"--seeds", "2"});
  EXPECT_EQ(result.exit_code, 0) << result.errors;
  const auto samples = columns("run.plot.csv");
  ASSERT_EQ(samples.at("gyro_x_error").size(), 2001U);
  for (std::size_t i = 0; i < 2001; ++i) {
    ASSERT_NEAR(samples.at("gyro_x_error")[i], i < 1000 ? 0 : units::degree, 1e-12) << i;
    ASSERT_EQ(samples.at("gyro_y_error")[i], 0) << i;
  }
  EXPECT_TRUE(contains(result.output, "gyro_x   error rms 0.7073 deg/s")) << result.output;
}

// A low-pass filter makes the values late. With --filter-truth the truth is as late, and a bias is all that is left.
TEST_F(ImuPlot, TheTruthMayPassTheSensorsFilters) {
  write_config(
      "port = \"pty:imu1\"\nprotocol = \"native\"\nrate_hz = 200\nmodel = \"ideal\"\ngyro.max_rad_per_s = 10\n"
      "accelerometer.max_g = 10\ninternal_rate_hz = 400\ngyro.low_pass_hz = 2\ngyro.bias_deg_per_s = [0, 0.5, 0]\n");
  const auto greatest_errors = [&](std::vector<std::string> more) {
    more.insert(more.end(), {"--seeds", "2"});
    const auto result = plot("run.svg", more);
    EXPECT_EQ(result.exit_code, 0) << result.errors;
    const auto samples = columns("run.plot.csv");
    std::vector<double> greatest;
    for (const char* name : {"gyro_x_error", "gyro_y_error"}) {
      double most = 0;
      for (const double error : samples.at(name)) most = std::max(most, std::abs(error));
      greatest.push_back(most);
    }
    return greatest;
  };
  const auto late = greatest_errors({}), filtered = greatest_errors({"--filter-truth"});
  EXPECT_GT(late[0], 1e-4);
  EXPECT_LT(filtered[0], 1e-12);
  EXPECT_NEAR(filtered[1], 0.5 * units::degree, 1e-9);
}

// The errors are constant except for rounding.
TEST_F(ImuPlot, ARunWithoutNoiseIsDrawnWithoutAWarning) {
  write_config(
      "port = \"pty:imu1\"\nprotocol = \"native\"\nrate_hz = 200\nmodel = \"ideal\"\ngyro.max_rad_per_s = 10\n"
      "accelerometer.max_g = 10\ngyro.bias_rad_per_s = -0.001\naccelerometer.bias_m_per_s2 = [0.01, 0.02, -0.03]\n");
  const auto result = plot("run.svg", {"--seeds", "2"});
  EXPECT_EQ(result.exit_code, 0) << result.errors;
  EXPECT_FALSE(contains(result.errors, "warning")) << result.errors;
  EXPECT_EQ(lines_of(result.errors).size(), 1U) << result.errors;
}

TEST_F(ImuPlot, FilesOfOthersStay) {
  write_config(
      "port = \"pty:imu1\"\nprotocol = \"native\"\nrate_hz = 200\ngyro.max_rad_per_s = 10\naccelerometer.max_g = "
      "10\n");
  for (const char* name : {"run.csv", "run_spectrum.csv"}) std::ofstream(folder_ / name) << "the user's\n";
  for (int i = 0; i < 2; ++i)
    EXPECT_EQ(plot("run.svg", {"--seeds", "2"}).exit_code, 0) << "its own data are replaced";
  for (const char* name : {"run.csv", "run_spectrum.csv"}) EXPECT_EQ(content(name), "the user's\n");
  std::ofstream(folder_ / "run.plot_spectrum.csv") << "the user's\n";
  const auto refused = plot("run.svg", {"--seeds", "2"});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_TRUE(contains(refused.errors, "run.plot_spectrum.csv: has other data than those of a plot; move it"))
      << refused.errors;
  EXPECT_EQ(content("run.plot_spectrum.csv"), "the user's\n");
}

TEST_F(ImuPlot, AWrongCommandLineIsAnErrorThatHasTheRemedy) {
  write_config(
      "port = \"pty:imu1\"\nprotocol = \"native\"\nrate_hz = 200\ngyro.max_rad_per_s = 10\naccelerometer.max_g = "
      "10\n");
  const struct {
    std::string picture;
    std::vector<std::string> more;
    std::string_view message;
  } cases[] = {
      {"run.jpg", {}, "right would be FILE.svg or FILE.png"},
      {"run.svg", {"--set", "imu.1.rate=3"}, "did you mean"},
      {"run.svg", {"--seeds", "1"}, "--seeds"},
  };
  for (const auto& [picture, more, message] : cases) {
    const auto result = plot(picture, more);
    EXPECT_EQ(result.exit_code, 2) << message;
    EXPECT_TRUE(contains(result.errors, message)) << result.errors;
  }
  const auto no_imu = run_program("imu-plot", {folder_ / "imu.toml", "x.pcap", "--plot", "x.svg", "--imu", "your"});
  EXPECT_EQ(no_imu.exit_code, 2);
  EXPECT_TRUE(contains(no_imu.errors, "--imu your: right would be one of other, mine")) << no_imu.errors;
  const auto no_capture =
      run_program("imu-plot", {folder_ / "imu.toml", folder_ / "no.pcap", "--plot", folder_ / "x.svg"});
  EXPECT_EQ(no_capture.exit_code, 1);
  EXPECT_TRUE(contains(no_capture.errors, "no.pcap")) << no_capture.errors;
  const auto too_slow = plot("run.svg", {"--set", "imu.1.rate_hz=1"});
  EXPECT_EQ(too_slow.exit_code, 1);
  EXPECT_TRUE(contains(too_slow.errors, "imu-plot: 11 samples are too few; right would be at least 32\n"))
      << too_slow.errors;
  const auto over_input = run_program("imu-plot", {folder_ / "x.plot.csv", "y.pcap", "--plot", folder_ / "x.svg"});
  EXPECT_EQ(over_input.exit_code, 2);
}

}  // namespace
}  // namespace imud
