// imu-fit: what dwells show of a sensor, what they do not, and by how much the errors found differ from those there
// were.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "core/effects/drawn_errors.hpp"
#include "core/triad.hpp"
#include "core/units.hpp"
#include "tests/support/text.hpp"
#include "tests/tools/run_program.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "tools/fit/dwell_means.hpp"
#include "tools/fit/sensor_fit.hpp"

namespace imud {
namespace {

constexpr double degree = units::degree, g = units::standard_gravity, ppm = 1e-6;

// Each axis up and down at rest, and turning both ways about the axis that is up; at two temperatures.
std::vector<Dwell> all_dwells(double seconds, bool has_temperatures) {
  const Vector3 earth = 15.041 * degree / 3600 * Vector3(0.3, -0.5, 0.8);
  std::vector<Dwell> dwells;
  for (const double temperature : {15.0, 35.0})
    for (int axis = 0; axis < 3; ++axis)
      for (const double up : {1.0, -1.0})
        for (const double rate : {0.0, 100 * degree, -100 * degree}) {
          Dwell& dwell = dwells.emplace_back();
          dwell.begin_s = (static_cast<double>(dwells.size()) - 1) * (seconds + 2);
          dwell.end_s = dwell.begin_s + seconds;
          dwell.rate = rate * Vector3::Unit(axis) + (rate == 0 ? earth : Vector3::Zero());
          dwell.force = up * g * Vector3::Unit(axis);
          if (has_temperatures) dwell.temperature_c = temperature;
        }
  return dwells;
}

// A recording of two triads over these dwells; between them they measure nothing.
StillRecording recording_of(const std::array<TriadErrors, 2>& errors, const std::vector<Dwell>& dwells,
                            double rate_hz, std::uint64_t seed) {
  StillRecording recording;
  recording.rate_hz = rate_hz;
  const auto samples = static_cast<std::size_t>(std::lround(dwells.back().end_s * rate_hz));
  const Normals normals(seed, stream_id("imu1"));
  for (std::size_t sensor = 0; sensor < 2; ++sensor) {
    Triad triad(errors[sensor], sensor == 0 ? Quantity::rate : Quantity::specific_force, 1 / rate_hz);
    for (std::size_t axis = 0; axis < 3; ++axis)
      recording.channels.push_back({3 * sensor + axis, std::vector<double>(samples)});
    std::size_t dwell = 0;
    for (std::size_t k = 0; k < samples; ++k) {
      while (static_cast<double>(k) >= dwells[dwell].end_s * rate_hz) ++dwell;
      const bool is_within = static_cast<double>(k) >= dwells[dwell].begin_s * rate_hz;
      const Vector3 zero = Vector3::Zero(), force = is_within ? *dwells[dwell].force : zero;
      const Surroundings surroundings = {.temperature_c = dwells[dwell].temperature_c.value_or(25)};
      TriadStep step = {.normals = normals,
                        .k = k,
                        .dt = 1 / rate_hz,
                        .since_power_on = static_cast<double>(k) / rate_hz,
                        .specific_force = force,
                        .delta_velocity = zero,
                        .surroundings = surroundings,
                        .value = lanes(!is_within    ? zero
                                       : sensor == 0 ? *dwells[dwell].rate
                                                     : force),
                        .increment = lanes(zero)};
      triad.apply(step);
      for (std::size_t axis = 0; axis < 3; ++axis)
        recording.channels[3 * sensor + axis].values[k] = step.value[static_cast<Eigen::Index>(axis)];
    }
  }
  return recording;
}

// The terms of an axis that the sensor has.
std::array<double, fit_terms> true_terms(const TriadErrors& errors, int axis) {
  std::array<double, fit_terms> terms{};
  terms[0] = errors.bias[axis];
  for (int j = 0; j < 3; ++j) {
    terms[static_cast<std::size_t>(1 + j)] = errors.scale_factor[axis] * errors.misalignment(axis, j);
    terms[static_cast<std::size_t>(4 + j)] = errors.g_sensitivity(axis, j);
  }
  terms[7] = errors.temperature_bias(axis, 0);
  terms[8] = errors.temperature_scale(axis, 0);
  return terms;
}

TriadErrors spread(double bias, double bias_by_temperature, double g_sensitivity) {
  TriadErrors errors;
  errors.unit_sigma.bias = Vector3::Constant(bias);
  errors.unit_sigma.scale_factor = Vector3::Constant(500 * ppm);
  errors.unit_sigma.misalignment = 1e-3 * (Matrix3::Ones() - Matrix3::Identity());
  errors.unit_sigma.g_sensitivity = Matrix3::Constant(g_sensitivity);
  errors.unit_sigma.temperature_bias.col(0) = Vector3::Constant(bias_by_temperature);
  errors.unit_sigma.temperature_scale.col(0) = Vector3::Constant(10 * ppm);
  return errors;
}

class Units {
 public:
  Units() {
    models_[0] = spread(100 * degree / 3600, 1 * degree / 3600, 7 * degree / 3600 / g);
    models_[1] = spread(2e-3 * g, 1e-5 * g, 0);
    models_[0].white_density = Vector3::Constant(0.15 * degree / 60);
    models_[0].bias_instability = Vector3::Constant(3 * degree / 3600);
    models_[1].white_density = Vector3::Constant(1e-3);
    models_[1].bias_instability = Vector3::Constant(5e-5 * g);
    for (std::size_t sensor = 0; sensor < 2; ++sensor) noise_[sensor] = allan_terms(models_[sensor], rate_hz);
  }
  std::array<TriadErrors, 2> unit(std::uint64_t seed) const {
    const Normals normals(seed, stream_id("imu1"));
    return {drawn_errors(models_[0], Quantity::rate, normals, normals, 0),
            drawn_errors(models_[1], Quantity::specific_force, normals, normals, 0)};
  }
  const std::array<AllanTerms, 3>& noise(std::size_t sensor) const { return noise_[sensor]; }
  static constexpr double rate_hz = 20;

 private:
  std::array<TriadErrors, 2> models_;
  std::array<std::array<AllanTerms, 3>, 2> noise_;
};

// 200 units, of which each of 45 terms is within two of its standard errors in 95.4 of 100 cases. The terms of an
// axis share the data of its dwells: 1200 independent fits have a standard error of 0.6 % at most, and the bounds
// are 2.5 of it away.
TEST(ImuFit, FindsTheTermsOf200UnitsWithinTheirStandardErrors) {
  const Units units;
  const std::vector<Dwell> dwells = all_dwells(8, true);
  int within = 0, all = 0, far = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    const std::array<TriadErrors, 2> errors = units.unit(seed);
    const StillRecording recording = recording_of(errors, dwells, Units::rate_hz, seed);
    for (std::size_t sensor = 0; sensor < 2; ++sensor) {
      const bool is_rate = sensor == 0;
      const auto means = dwell_means(recording, dwells, is_rate, 25);
      ASSERT_EQ(means.size(), 36U);
      const auto fits = fit_sensor(means, units.noise(sensor), {}, is_rate);
      for (int axis = 0; axis < 3; ++axis) {
        const AxisFit& fit = fits[static_cast<std::size_t>(axis)];
        const auto truth = true_terms(errors[sensor], axis);
        EXPECT_EQ(fit.rank, is_rate ? 9U : 6U);
        EXPECT_LT(fit.condition, 100);
        for (std::size_t term = 0; term < fit_terms; ++term) {
          const auto& [value, sigma] = fit.parameters[term];
          if (!is_rate && term >= 4 && term <= 6) {
            EXPECT_FALSE(sigma);
            continue;
          }
          ASSERT_TRUE(sigma) << sensor << axis << term;
          ++all;
          within += std::abs(value - truth[term]) <= 2 * *sigma;
          far += std::abs(value - truth[term]) > 5.5 * *sigma;
        }
      }
    }
  }
  EXPECT_EQ(all, 200 * 45);
  EXPECT_GT(within, 0.93 * all);
  EXPECT_LT(within, 0.97 * all);
  EXPECT_EQ(far, 0);  // the probability of one is 3e-4
  RecordProperty("within", within);
}

// Returns the fits of gyros and accelerometers with these errors in dwells at four temperatures, whose means have the
// variance 1e-16.
std::array<std::array<AxisFit, 3>, 2> exact_fits(const std::array<TriadErrors, 2>& errors) {
  const std::vector<Dwell> dwells = all_dwells(4, true);
  const StillRecording recording = recording_of(errors, dwells, Units::rate_hz, 5);
  std::array<std::array<AxisFit, 3>, 2> fits;
  for (std::size_t sensor = 0; sensor < 2; ++sensor) {
    auto means = dwell_means(recording, dwells, sensor == 0, 25);
    for (DwellMean& mean : means) mean.white = Vector3::Constant(1e-16);
    fits[sensor] = fit_sensor(means, {}, {}, sensor == 0);
  }
  return fits;
}

// Without noise every term is found as it is, up to the products of small terms.
TEST(ImuFit, IsExactWithoutNoise) {
  Units units;
  std::array<TriadErrors, 2> errors = units.unit(5);
  for (TriadErrors& one : errors) one.white_density = one.bias_instability = Vector3::Zero();
  const auto fits = exact_fits(errors);
  for (std::size_t sensor = 0; sensor < 2; ++sensor)
    for (int axis = 0; axis < 3; ++axis)
      for (std::size_t term = 0; term < fit_terms; ++term)
        EXPECT_NEAR(fits[sensor][static_cast<std::size_t>(axis)].parameters[term].value,
                    true_terms(errors[sensor], axis)[term], 2e-6)
            << sensor << axis << term;
}

// Temperature changes what the sensor measures along its own axes, as in imud: axes that are 20 mrad off leave no
// residuals, and the change of the scale factor is exact.
TEST(ImuFit, TheScaleFactorChangesAlongTheMisalignedAxes) {
  std::array<TriadErrors, 2> errors;
  for (TriadErrors& one : errors) {
    one.misalignment << 1, 0.02, -0.01, 0.005, 1, 0.02, -0.02, 0.01, 1;
    one.scale_factor = {1.002, 0.998, 1.001};
    one.temperature_scale.col(0) = Vector3(40 * ppm, -30 * ppm, 20 * ppm);
  }
  const auto fits = exact_fits(errors);
  for (std::size_t sensor = 0; sensor < 2; ++sensor)
    for (int axis = 0; axis < 3; ++axis) {
      const AxisFit& fit = fits[sensor][static_cast<std::size_t>(axis)];
      EXPECT_LT(fit.chi_square, 1) << sensor << axis;
      EXPECT_NEAR(fit[FitTerm::scale_by_temperature].value, errors[sensor].temperature_scale(axis, 0), 1e-9);
    }
}

// The terms that a procedure does not show are named, and the others are right.
TEST(ImuFit, NamesWhatTheDwellsDoNotShow) {
  Units units;
  const std::array<TriadErrors, 2> errors = units.unit(9);
  const auto shown = [&](std::vector<Dwell> dwells, bool is_rate) {
    const StillRecording recording = recording_of(errors, dwells, Units::rate_hz, 9);
    const auto fits = fit_sensor(dwell_means(recording, dwells, is_rate, 25), {}, {}, is_rate);
    std::string text;
    for (std::size_t term = 0; term < fit_terms; ++term) text += fits[0].parameters[term].sigma ? '+' : '-';
    return text;
  };
  // Bias, three inputs, three forces, bias and scale by temperature.
  EXPECT_EQ(shown(all_dwells(4, true), true), "+++++++++");
  EXPECT_EQ(shown(all_dwells(4, false), true), "+++++++--") << "one temperature";
  EXPECT_EQ(shown(all_dwells(4, true), false), "++++---++");
  for (const double earth : {1.0, 0.0}) {
    std::vector<Dwell> turns_in_the_cold = all_dwells(4, true);
    for (Dwell& dwell : turns_in_the_cold)
      if (dwell.rate->norm() < 0.1)
        *dwell.rate *= earth;
      else
        dwell.temperature_c = 15;
    EXPECT_EQ(shown(turns_in_the_cold, true), "++++++++-") << "all turns at one temperature";
  }
  const auto only = [&](auto&& keep) {
    std::vector<Dwell> dwells;
    for (Dwell dwell : all_dwells(4, false))
      if (keep(dwell)) {
        const double length = dwell.end_s - dwell.begin_s;
        dwell.begin_s = static_cast<double>(dwells.size()) * (length + 1);
        dwell.end_s = dwell.begin_s + length;
        dwells.push_back(dwell);
      }
    return dwells;
  };
  const auto is_up = [](const Dwell& dwell, int axis) { return dwell.force->normalized()[axis] > 0.5; };
  EXPECT_EQ(shown(only([&](const Dwell& d) { return is_up(d, 2); }), false), "---------")
      << "z up alone: bias and response to z cannot be told apart, the others have no input";
  EXPECT_EQ(shown(only([&](const Dwell& d) { return is_up(d, 2) || is_up(d, 1); }), false), "---------")
      << "two positions: three terms of them";
  EXPECT_EQ(shown(only([&](const Dwell& d) { return std::abs((*d.force)[2]) > 1; }), false), "+--+-----")
      << "z up and down";
  // One axis up, turning about it: the bias by its force cannot be told from the bias.
  EXPECT_EQ(shown(only([&](const Dwell& d) { return is_up(d, 2) && d.rate->norm() > 0.1; }), true), "---+-----");
}

// The true inputs differ from the plan by 1 %: the standard errors grow by the factor that explains the residuals.
TEST(ImuFit, ErrorsGrowWithResidualsThatTheNoiseDoesNotExplain) {
  Units units;
  const std::vector<Dwell> dwells = all_dwells(4, true);
  auto means = dwell_means(recording_of(units.unit(3), dwells, Units::rate_hz, 3), dwells, true, 25);
  const AxisFit good = fit_sensor(means, units.noise(0), {}, true)[0];
  EXPECT_EQ(good.error_factor, 1);
  for (std::size_t i = 0; i < means.size(); i += 5) means[i].input *= 1.01;
  const AxisFit bad = fit_sensor(means, units.noise(0), {}, true)[0];
  EXPECT_NEAR(bad.error_factor, std::sqrt(bad.chi_square / static_cast<double>(bad.degrees)), 1e-9);
  EXPECT_GT(bad.error_factor, 10);
  EXPECT_NEAR(*bad[FitTerm::bias].sigma, bad.error_factor * *good[FitTerm::bias].sigma,
              0.2 * *bad[FitTerm::bias].sigma);
}

TEST(ImuFit, TheFixturesErrorsAreInTheStandardErrors) {
  Units units;
  const std::array<TriadErrors, 2> errors = units.unit(3);
  const std::vector<Dwell> dwells = all_dwells(4, true);
  const auto means = dwell_means(recording_of(errors, dwells, Units::rate_hz, 3), dwells, true, 25);
  const auto plain = fit_sensor(means, {}, {}, true), scaled = fit_sensor(means, {}, {.scale = 1e-3}, true),
             tilted = fit_sensor(means, {}, {.angle_rad = 1e-2}, true);
  EXPECT_LT(*plain[0][FitTerm::x].sigma, 1e-4);
  EXPECT_NEAR(*scaled[0][FitTerm::x].sigma, 1e-3, 1e-5);
  EXPECT_EQ(scaled[0][FitTerm::bias].sigma, plain[0][FitTerm::bias].sigma);
  // A tilt in each dwell acts across the input: 1 % of the rate about y, over 8 dwells that turn about y.
  EXPECT_NEAR(*tilted[0][FitTerm::y].sigma, 1e-2 / std::sqrt(8), 1e-3);
  EXPECT_NEAR(*tilted[0][FitTerm::x].sigma, *plain[0][FitTerm::x].sigma, 0.1 * *plain[0][FitTerm::x].sigma);
  // Digits that the noise does not cover.
  StillRecording coarse;
  coarse.rate_hz = 100;
  for (std::size_t channel = 0; channel < 3; ++channel)
    coarse.channels.push_back({channel, std::vector<double>(100, 0)});
  coarse.channels[1].values[50] = 0.06;
  const std::vector<Dwell> one = {
      {.begin_s = 0, .end_s = 1, .rate = Vector3::Zero(), .force = {}, .temperature_c = {}}};
  EXPECT_NEAR(dwell_means(coarse, one, true, 25).at(0).white[1], 0.0003, 1e-4);
  EXPECT_EQ(dwell_means(coarse, one, true, 25).at(0).white[0], 0);
}

// imud turns a unit of its own; imu-fit finds what was drawn, and writes a model that imud reads.
TEST(ImuFit, AUnitBecomesAModel) {
  const ScratchFolder folder;
  const std::string port = folder / "sent", truth_path = folder / "truth.csv", plan_path = folder / "dwells.csv";
  std::ofstream truth(truth_path), plan(plan_path);
  truth << "time_ns,sigma_BN_1,sigma_BN_2,sigma_BN_3";
  for (const char* quantity : {"omega_BN_B", "nonConservativeAccelpntB_B"})
    for (const char axis : {'x', 'y', 'z'}) truth << ',' << quantity << '_' << axis;
  truth << '\n';
  plan << "# six positions, and turns about the axis that is up\nbegin_s,end_s,rate_x_deg_per_s,rate_y_deg_per_s,"
          "rate_z_deg_per_s,force_x_g,force_y_g,force_z_g\n";
  int dwell = 0;
  std::int64_t ms = 0;
  for (int axis = 0; axis < 3; ++axis)
    for (const double up : {1.0, -1.0})
      for (const double rate : {0.0, 90.0, -90.0}) {
        const Vector3 omega = rate * degree * Vector3::Unit(axis), force = up * g * Vector3::Unit(axis);
        const std::int64_t begin = ms;
        for (; ms < begin + 10'000; ms += 100) {
          const double angle = rate * degree * 1e-3 * static_cast<double>(ms - begin);
          const Vector3 sigma = std::tan(std::remainder(angle, 2 * M_PI) / 4) * Vector3::Unit(axis);
          truth << fmt::format("{},{},{},{},{},{},{},{},{},{}\n", ms * 1'000'000, sigma.x(), sigma.y(), sigma.z(),
                               omega.x(), omega.y(), omega.z(), force.x(), force.y(), force.z());
        }
        plan << fmt::format("{},{},{},{},{},{},{},{}\n", 10 * dwell + 1, 10 * dwell + 9, rate * (axis == 0),
                            rate * (axis == 1), rate * (axis == 2), up * (axis == 0), up * (axis == 1),
                            up * (axis == 2));
        ++dwell;
      }
  truth.close();
  plan.close();
  std::ofstream(folder / "imu.toml")
      << "clock = \"fast\"\n[truth]\nport = \"file:" << truth_path
      << "\"\nformat = \"csv\"\n[[imu]]\nname = \"imu1\"\n"
      << "protocol = \"native\"\nrate_hz = 100\nport = \"file:" << port << "\"\ngyro.max_deg_per_s = 400\n"
      << "gyro.angle_random_walk_deg_per_rt_hr = 0.15\ngyro.unit_sigma = {bias_deg_per_hr = 200, scale_factor_ppm = "
         "500, "
         "misalignment_mrad = 1}\naccelerometer.max_g = 10\naccelerometer.velocity_random_walk_m_per_s_per_rt_hr = "
         "0.06\n"
      << "accelerometer.unit_sigma = {bias_mg = 2, scale_factor_ppm = 500, misalignment_mrad = 1}\n";
  const auto run = run_program("imud", {"run", folder / "imu.toml", "--summary", folder / "summary.json"});
  ASSERT_EQ(run.exit_code, 0) << run.errors;
  const auto drawn = nlohmann::json::parse(std::ifstream(folder / "summary.json"))["imus"][0]["drawn"];

  const std::string mine = folder / "mine.toml";
  const auto fit = run_program("imu-fit", {"native", "file:" + port, "--dwells", plan_path, "--to-config", mine,
                                           "--json", folder / "fit.json"});
  ASSERT_EQ(fit.exit_code, 0) << fit.errors;
  EXPECT_TRUE(contains(fit.output, "18 dwells")) << fit.output;
  EXPECT_TRUE(contains(fit.output, "bias by temperature    not shown: it takes dwells at two temperatures"))
      << fit.output;
  const auto json = nlohmann::json::parse(std::ifstream(folder / "fit.json"));
  int compared = 0;
  for (const auto& [sensor, short_name] : {std::pair{"gyro", "gyro_"}, {"accelerometer", "accel_"}})
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::string prefix = short_name;
      const auto& found = json["axes"][prefix + "xyz"[axis]];
      const auto& unit = drawn[sensor]["unit"];
      const auto near = [&](const std::string& key, double wanted) {
        ++compared;
        EXPECT_NEAR(found[key]["si"].get<double>(), wanted, 5 * found[key]["si_error"].get<double>())
            << prefix << axis << key;
      };
      near("bias", unit["bias"][axis].get<double>());
      const double scale = 1 + unit["scale_factor"][axis].get<double>();
      for (std::size_t j = 0; j < 3; ++j)
        near(std::string("input_") + "xyz"[j],
             scale * ((axis == j) + unit["misalignment"][3 * axis + j].get<double>()));
      EXPECT_TRUE(found["bias_by_temperature"]["si"].is_null());
    }
  EXPECT_EQ(compared, 24);
  const auto check = run_program("imud", {"check", folder / "imu.toml", "--set", "imu.0.model=" + mine});
  EXPECT_EQ(check.exit_code, 0) << check.errors;
}

TEST(ImuFit, AWrongTableIsRefusedWithWhatWouldBeRight) {
  const auto fault = [](const std::string& text) {
    std::istringstream stream(text);
    try {
      read_dwells(stream, "plan.csv");
    } catch (const std::runtime_error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const std::string header = "begin_s,end_s,rate_x_deg_per_s\n";
  EXPECT_EQ(fault(header + "0,10,5\n# turned\n\n 20 , 30 , -5 \n"), "");
  EXPECT_TRUE(contains(fault("begin_s,end_s,rate_w_deg_per_s\n"),
                       "plan.csv:1: there is no column \"rate_w_deg_per_s\"; "
                       "right would be begin_s, end_s, temperature_c"));
  EXPECT_EQ(fault("end_s\n1\n"), "plan.csv:1: the header needs one column begin_s");
  EXPECT_EQ(fault(header + "0,10\n"), "plan.csv:2: 2 fields; right would be 3, as in the header");
  for (const std::string number : {"fast", "nan", "1e308", "-1e154", "1000001"})
    EXPECT_EQ(fault(header + "0,10," + number + "\n"),
              fmt::format("plan.csv:2: \"{}\"; right would be a number from -1000000 to 1000000", number));
  EXPECT_EQ(fault(header + "0,1e10,1\n"),
            "plan.csv:2: \"1e10\"; right would be a number from -1000000000 to 1000000000");
  EXPECT_EQ(fault("begin_s,end_s,force_x_g,force_x_g\n"),
            "plan.csv:1: the column force_x_g is given twice; right would be once");
  EXPECT_EQ(fault("begin_s,end_s,force_x_g,force_x_m_per_s2\n"),
            "plan.csv:1: force_x is given twice, by force_x_g and by force_x_m_per_s2; right would be one of them");
  EXPECT_EQ(fault("\xEF\xBB\xBF" + header + "0,10,1000000\n"), "") << "a byte order mark";
  EXPECT_EQ(fault(header + "10,10,1\n"), "plan.csv:2: begin_s must be at least 0, and end_s after it");
  EXPECT_EQ(fault(header + "0,10,1\n9,20,1\n"), "plan.csv:3: the dwell begins before the one above it ends");
  EXPECT_EQ(fault(header), "plan.csv: no dwell; right would be a header and a row for each dwell");

  std::istringstream good("begin_s,end_s,force_z_g,rate_y_rad_per_s,temperature_c\n0,1,,2,-5\n");
  const Dwell dwell = read_dwells(good, "good").at(0);
  EXPECT_FALSE(dwell.force);
  EXPECT_EQ(dwell.rate, Vector3(0, 2, 0));
  EXPECT_EQ(dwell.temperature_c, -5);
}

}  // namespace
}  // namespace imud
