// Faults of magnetometer, barometer, thermometer and GNSS receiver in closed form, through the bytes of a unit that
// sends doubles. Those of gyro and accelerometer: sensor_faults_test.cpp.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <span>

#include "tests/emulator/every_quantity.hpp"

namespace imud {
namespace {

constexpr std::size_t begins = 60, ends = 99;  // first and last sample of the fault
constexpr double fault_run_s = 0.8, sample_s = 0.005;

using Quantities = std::vector<std::map<std::string_view, double>>;  // by sample

// The value that is expected in place of `v`, `t` seconds after the begin; `held`: the last one before it.
struct Shape {
  std::string kind, keys;
  std::function<double(double v, double t, double held)> expected;
  bool is_of_triads = false;
};
std::vector<Shape> shapes(double p) {
  const std::string value = fmt::format("value = {}\n", p);
  return {
      {"bias", value, [=](double v, double, double) { return v + p; }},
      {"drift", value, [=](double v, double t, double) { return v + p * t; }},
      {"scale", "value = 0.75\n", [](double v, double, double) { return 0.75 * v; }},
      {"noise", "value = 0\n", [](double v, double, double) { return v; }},
      {"stuck", "", [](double, double, double held) { return held; }},
      {"stuck_at", value, [=](double, double, double) { return p; }},
      {"dead", "", [](double, double, double) { return 0.0; }},
      {"quantisation", value, [=](double v, double, double) { return p * std::floor(v / p + 0.5); }},
      {"inverted", "", [](double v, double, double) { return -v; }, true},
      {"saturation", value, [=](double v, double, double) { return std::clamp(v, -p, p); }, true},
      {"vibration", value + "hz = 20\n",
       [=](double v, double t, double) { return v + p * std::sin(2 * std::numbers::pi * 20 * t); }, true},
  };
}

class QuantityFaultsTest : public EveryQuantityTest {
 protected:
  Quantities measured(const std::string& fault) const {
    const std::string window =
        fault.empty() ? "" : fmt::format("at_sample = {}\nfor_samples = {}\n", begins, ends - begins + 1);
    Quantities all;
    const Sampled one = run(
        {every_quantity_unit("imu1", "gyro.temperature_bias_rad_per_s_per_c = 0.001\ntemperature.warm_up_c = 10\n")},
        fault.empty() ? "" : "[[fault]]\n" + fault + window, fault_run_s);
    for (const std::string& sent : one.sent[0]) all.push_back(quantities(sent));
    for (const auto& sample : all) EXPECT_EQ(sample.size(), all_quantities.size());
    return all;
  }
  // Expects these quantities to be as `expected(name, sample)` within the window, and all others, and all samples
  // outside, to be as without the fault.
  static void compare(const Quantities& faulty, const Quantities& clean, std::span<const std::string_view> changed,
                      const std::function<double(std::string_view, std::size_t)>& expected, double tolerance) {
    ASSERT_EQ(faulty.size(), clean.size());
    for (std::size_t k = 0; k < clean.size(); ++k)
      for (const auto& [name, value] : clean[k]) {
        const bool is_changed = k >= begins && k <= ends && std::ranges::count(changed, name) > 0;
        if (is_changed) {
          ASSERT_NEAR(faulty[k].at(name), expected(name, k), tolerance) << name << ", sample " << k;
        } else {
          ASSERT_EQ(faulty[k].at(name), value) << name << ", sample " << k;
        }
      }
  }
};

constexpr std::string_view field_names[] = {"magnetic_field_x_t", "magnetic_field_y_t", "magnetic_field_z_t"};
constexpr std::string_view pressure_name[] = {"pressure_pa"};

TEST_F(QuantityFaultsTest, OfMagnetometerAndBarometer) {
  const Quantities clean = measured("");
  for (const auto& [target, p, names] :
       {std::tuple<std::string, double, std::span<const std::string_view>>{"magnetometer", 7e-6, field_names},
        {"barometer", 40, pressure_name}})
    for (const Shape& shape : shapes(p)) {
      if (shape.is_of_triads && target == "barometer") continue;
      SCOPED_TRACE(target + " " + shape.kind);
      const Quantities faulty =
          measured(fmt::format("target = \"{}\"\nkind = \"{}\"\n{}", target, shape.kind, shape.keys));
      compare(
          faulty, clean, names,
          [&](std::string_view name, std::size_t k) {
            return shape.expected(clean[k].at(name), sample_s * static_cast<double>(k - begins),
                                  clean[begins - 1].at(name));
          },
          1e-10 * p);
      EXPECT_EQ(faulty[ends].at(names[0]) != clean[ends].at(names[0]), shape.kind != "noise");
    }
  const Quantities swapped = measured("target = \"magnetometer.xz\"\nkind = \"swapped\"\n");
  compare(
      swapped, clean, field_names,
      [&](std::string_view name, std::size_t k) {
        return clean[k].at(name == field_names[1] ? name : name == field_names[0] ? field_names[2] : field_names[0]);
      },
      0);
}

// A change of the temperature also changes the rate, by the gyro's temperature_bias of 0.001 rad/s for each degree.
TEST_F(QuantityFaultsTest, OfTheThermometer) {
  const Quantities clean = measured("");
  constexpr std::string_view names[] = {"temperature_c",    "rate_x_rad_per_s",  "rate_y_rad_per_s",
                                        "rate_z_rad_per_s", "delta_angle_x_rad", "delta_angle_y_rad",
                                        "delta_angle_z_rad"};
  for (const Shape& shape : shapes(4)) {
    if (shape.is_of_triads) continue;
    SCOPED_TRACE(shape.kind);
    compare(
        measured(fmt::format("target = \"temperature\"\nkind = \"{}\"\n{}", shape.kind, shape.keys)), clean, names,
        [&](std::string_view name, std::size_t k) {
          const double before = clean[k].at("temperature_c");
          const double after = shape.expected(before, sample_s * static_cast<double>(k - begins),
                                              clean[begins - 1].at("temperature_c"));
          if (name == "temperature_c") return after;
          return clean[k].at(name) + 0.001 * (after - before) * (name.starts_with("rate") ? 1 : sample_s);
        },
        1e-12);
  }
}

// The variance of 40 to 120 added deviates within a factor of 3 of its value, beyond which it is with a probability
// below 1e-7; and that of spikes, which are as high as configured.
TEST_F(QuantityFaultsTest, NoiseAndSpikes) {
  const Quantities clean = measured("");
  for (const auto& [target, p, names] :
       {std::tuple<std::string, double, std::span<const std::string_view>>{"magnetometer", 7e-6, field_names},
        {"barometer", 40, pressure_name}}) {
    double square = 0;
    std::size_t count = 0, spikes = 0;
    const Quantities noisy = measured(fmt::format("target = \"{}\"\nkind = \"noise\"\nvalue = {}\n", target, p));
    const Quantities spiky =
        measured(fmt::format("target = \"{}\"\nkind = \"spike\"\nvalue = {}\nper_s = 100\n", target, p));
    for (std::size_t k = 0; k < clean.size(); ++k)
      for (const std::string_view name : names) {
        const double noise = noisy[k].at(name) - clean[k].at(name), spike = spiky[k].at(name) - clean[k].at(name);
        if (k < begins || k > ends) {
          ASSERT_TRUE(noise == 0 && spike == 0) << k;
          continue;
        }
        square += noise * noise;
        ++count;
        if (spike == 0) continue;
        ASSERT_NEAR(std::abs(spike), p, 1e-10 * p);
        ++spikes;
      }
    EXPECT_GT(square / static_cast<double>(count), p * p / 3);
    EXPECT_LT(square / static_cast<double>(count), p * p * 3);
    // Half of the samples have a spike: within 5 standard deviations.
    EXPECT_NEAR(static_cast<double>(spikes), 0.5 * static_cast<double>(count), 2.5 * std::sqrt(count));
  }
}

// By the radii of curvature of WGS 84 (NGA.STND.0036, a = 6378137 m, 1/f = 298.257223563); the Earth's curvature over
// 30 m is below the tolerance of 1 mm.
TEST_F(QuantityFaultsTest, OfTheGnssReceiver) {
  const Quantities clean = measured("");
  constexpr double a = 6378137, f = 1 / 298.257223563, e2 = f * (2 - f);
  constexpr std::string_view all[] = {
      "latitude_rad",           "longitude_rad",         "height_m",
      "velocity_north_m_per_s", "velocity_east_m_per_s", "velocity_down_m_per_s",
      "gps_time_of_week_s",     "gnss_satellites",       "gnss_position_sigma_north_m"};
  const std::span<const std::string_view> place(all, 3), motion(all, 6), time(all + 6, 1), satellites(all + 7, 1),
      sigma(all + 8, 1);
  // In metres north, east and down of the place without the fault.
  const auto off = [&](const Quantities& faulty, std::size_t k) {
    const auto change = [&](std::string_view name) { return faulty[k].at(name) - clean[k].at(name); };
    const double latitude = clean[k].at("latitude_rad"), height = clean[k].at("height_m");
    const double w = std::sqrt(1 - e2 * std::sin(latitude) * std::sin(latitude));
    return Vector3(change("latitude_rad") * (a * (1 - e2) / (w * w * w) + height),
                   change("longitude_rad") * (a / w + height) * std::cos(latitude), -change("height_m"));
  };
  const auto any = [](const Quantities& faulty) {
    return [&faulty](std::string_view name, std::size_t k) { return faulty[k].at(name); };
  };
  const Quantities jump = measured("target = \"gnss\"\nkind = \"jump\"\nnorth_m = 30\neast_m = -20\ndown_m = 5\n");
  compare(jump, clean, place, any(jump), 0);
  const Quantities drift =
      measured("target = \"gnss\"\nkind = \"drift\"\nnorth_m_per_s = 30\neast_m_per_s = 20\ndown_m_per_s = -10\n");
  compare(drift, clean, motion, any(drift), 0);
  for (std::size_t k = begins; k <= ends; ++k) {
    EXPECT_LT((off(jump, k) - Vector3(30, -20, 5)).norm(), 1e-3) << k;
    const Vector3 speed(30, 20, -10);
    EXPECT_LT((off(drift, k) - sample_s * static_cast<double>(k - begins) * speed).norm(), 1e-3) << k;
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(drift[k].at(motion[static_cast<std::size_t>(3 + axis)]),
                  clean[k].at(motion[static_cast<std::size_t>(3 + axis)]) + speed[axis], 1e-12);
  }
  compare(
      measured("target = \"gnss\"\nkind = \"time_jump\"\nvalue_s = -1.5\n"), clean, time,
      [&](std::string_view name, std::size_t k) { return clean[k].at(name) - 1.5; }, 1e-9);
  compare(
      measured("target = \"gnss\"\nkind = \"satellites\"\nvalue = 5\n"), clean, satellites,
      [](std::string_view, std::size_t) { return 5.0; }, 0);
  compare(
      measured("target = \"gnss\"\nkind = \"accuracy\"\nfactor = 4\n"), clean, sigma,
      [&](std::string_view name, std::size_t k) { return 4 * clean[k].at(name); }, 1e-6);
  compare(
      measured("target = \"gnss\"\nkind = \"no_fix\"\n"), clean, all,
      [](std::string_view, std::size_t) { return 0.0; }, 0);
}

}  // namespace
}  // namespace imud
