// Faults of sensors: each kind in closed form, through the bytes, with its begin and end exact to the sample.
#include "emulator/faults/sensor_faults.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "emulator/faults/fault_kinds.hpp"
#include "tests/emulator/faults/faulty_run.hpp"

namespace imud {
namespace {

// Samples 1000 to 1499.
constexpr std::size_t first = 1000, last = 1499;
const std::string window = "at_s = 2\nfor_s = 1\n";

// The value and the increment that are expected of an axis, by those without the fault.
struct Closed {
  double value, increment;
};
struct Case {
  std::string name, settings;
  // `k`: the sample; `axis` and the clean samples, of which the last is that before the fault.
  std::function<Closed(double value, double increment, std::size_t k, double held)> expected;
  double held_increment = 0;
};

class SensorFaultsTest : public FaultyRunTest {};

std::vector<Case> cases(double T) {
  const double p = 0.05;  // of either unit
  const std::string value = fmt::format("value = {}\n", p);
  return {
      {"bias", value,
       [=](double v, double d, std::size_t, double) {
         return Closed{v + p, d + p * T};
       }},
      {"drift", value,
       [=](double v, double d, std::size_t k, double) {
         const double t = static_cast<double>(k - first) * T;
         return Closed{v + p * t, k == first ? d : d + p * T * (t - 0.5 * T)};
       }},
      {"scale", "value = 1.5\n",
       [](double v, double d, std::size_t, double) {
         return Closed{1.5 * v, 1.5 * d};
       }},
      {"stuck", "",
       [=](double, double, std::size_t, double held) {
         return Closed{held, held * T};
       }},
      {"stuck_at", value,
       [=](double, double, std::size_t, double) {
         return Closed{p, p * T};
       }},
      {"dead", "",
       [](double, double, std::size_t, double) {
         return Closed{0, 0};
       }},
      {"inverted", "",
       [](double v, double d, std::size_t, double) {
         return Closed{-v, -d};
       }},
      {"saturation", "value = 0.001\n",
       [=](double v, double d, std::size_t, double) {
         const double limited = std::clamp(v, -0.001, 0.001);
         return Closed{limited, limited == v ? d : limited * T};
       }},
      {"quantisation", "value = 0.004\n",
       [=](double v, double d, std::size_t, double) {
         const double rounded = 0.004 * std::floor(v / 0.004 + 0.5);
         return Closed{rounded, d + T * (rounded - v)};
       }},
      {"vibration", value + "hz = 20\n",
       [=](double v, double d, std::size_t k, double) {
         const double w = 2 * std::numbers::pi * 20, t = static_cast<double>(k - first) * T;
         return Closed{v + p * std::sin(w * t), d + p / w * (std::cos(w * std::max(0.0, t - T)) - std::cos(w * t))};
       }},
  };
}

TEST_F(SensorFaultsTest, EachKindInClosedForm) {
  const Result clean = run("");
  ASSERT_EQ(clean.measurements.size(), 5001U);
  std::size_t checked = 0;
  for (const Case& one : cases(period_s))
    for (const bool is_gyro : {true, false}) {
      SCOPED_TRACE(fmt::format("{} of {}", one.name, is_gyro ? "gyro" : "accelerometer"));
      const Result faulty = run(fmt::format("[[fault]]\ntarget = \"{}.xz\"\nkind = \"{}\"\n{}{}",
                                            is_gyro ? "gyro" : "accelerometer", one.name, one.settings, window));
      ASSERT_EQ(faulty.measurements.size(), clean.measurements.size());
      const auto values = [&](const Result& result, std::size_t k) -> const Vector3& {
        const Sample& s = result.measurements[k].sample;
        return is_gyro ? s.rate : s.specific_force;
      };
      const auto increments = [&](const Result& result, std::size_t k) -> const Vector3& {
        const Sample& s = result.measurements[k].sample;
        return is_gyro ? s.delta_angle : s.delta_velocity;
      };
      std::size_t changed = 0;
      for (std::size_t k = 0; k < clean.frames.size(); ++k) {
        if (k < first || k > last) {
          ASSERT_EQ(faulty.frames[k].bytes, clean.frames[k].bytes) << k;
          continue;
        }
        changed += faulty.frames[k].bytes != clean.frames[k].bytes;
        for (int axis = 0; axis < 3; ++axis) {
          const double value = values(clean, k)[axis], increment = increments(clean, k)[axis];
          const Closed expected = axis == 1 ? Closed{value, increment}
                                            : one.expected(value, increment, k, values(clean, first - 1)[axis]);
          ASSERT_NEAR(values(faulty, k)[axis], expected.value, 1e-13) << k << ' ' << axis;
          ASSERT_NEAR(increments(faulty, k)[axis], expected.increment, 1e-15) << k << ' ' << axis;
          ++checked;
        }
      }
      EXPECT_GE(changed, last - first) << "those of drift and vibration begin with 0";
      ASSERT_EQ(faulty.labels.size(), 1U);
      EXPECT_EQ(faulty.labels[0].first.sample, first);
      EXPECT_EQ(faulty.labels[0].last.sample, last);
      EXPECT_TRUE(faulty.labels[0].has_ended);
    }
  EXPECT_EQ(checked, cases(period_s).size() * 2 * 3 * (last - first + 1));
}

TEST_F(SensorFaultsTest, AxesAreExchanged) {
  const Result clean = run("");
  const Result two = run("[[fault]]\ntarget = \"gyro.xz\"\nkind = \"swapped\"\n" + window);
  const Result three = run("[[fault]]\ntarget = \"accelerometer\"\nkind = \"swapped\"\n" + window);
  for (std::size_t k = 0; k < clean.frames.size(); ++k) {
    const Sample& c = clean.measurements[k].sample;
    const bool is_within = k >= first && k <= last;
    const Vector3 rate = is_within ? Vector3(c.rate.z(), c.rate.y(), c.rate.x()) : c.rate;
    ASSERT_EQ(two.measurements[k].sample.rate, rate) << k;
    const Vector3& f = c.specific_force;
    ASSERT_EQ(three.measurements[k].sample.specific_force, is_within ? Vector3(f.y(), f.z(), f.x()) : f) << k;
  }
}

TEST_F(SensorFaultsTest, SaturationSetsItsStatus) {
  const Result faulty =
      run("[[fault]]\ntarget = \"accelerometer.z\"\nkind = \"saturation\"\nvalue_g = 0.1\n" + window);
  for (std::size_t k = 0; k < faulty.frames.size(); ++k) {
    const Sample& s = faulty.measurements[k].sample;
    const bool is_cut = k >= first && k <= last;
    ASSERT_EQ((s.status & status::accelerometer_saturated_x << 2U) != 0, is_cut) << k;
    ASSERT_TRUE(!is_cut || std::abs(std::abs(s.specific_force.z()) - 0.1 * 9.80665) < 1e-12);
  }
}

// The mean square of 1500 added deviates of variance s^2 is within 5 standard deviations of it, s^2 (1 +- 0.18), with
// a false-alarm probability of 6e-7.
TEST_F(SensorFaultsTest, NoiseHasItsVariance) {
  const std::string errors =
      "rate_hz = 500\nmodel = \"white\"\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n"
      "gyro.angle_random_walk_rad_per_rt_s = 1e-3\n";
  const Result clean = run("", "native", 1, errors);
  const double own = 1e-3 * std::sqrt(rate_hz);
  for (const auto& [settings, sigma] :
       {std::pair<std::string, double>{"factor = 3\n", own * std::sqrt(8.0)}, {"value_deg_per_s = 1\n", 0.0174533}}) {
    const Result faulty =
        run("[[fault]]\ntarget = \"gyro\"\nkind = \"noise\"\n" + settings + window, "native", 1, errors);
    double square = 0;
    for (std::size_t k = first; k <= last; ++k) {
      const Sample &f = faulty.measurements[k].sample, &c = clean.measurements[k].sample;
      const Vector3 added = f.rate - c.rate;
      square += added.squaredNorm();
      ASSERT_LT((f.delta_angle - c.delta_angle - period_s * added).norm(), 1e-12);
    }
    EXPECT_NEAR(square / 1500 / (sigma * sigma), 1, 0.18) << settings;
    EXPECT_EQ(faulty.frames[first - 1].bytes, clean.frames[first - 1].bytes);
    EXPECT_EQ(faulty.frames[last + 1].bytes, clean.frames[last + 1].bytes);
  }
}

// 50 spikes a second on each axis for a second: 150 on average, and 150 +- 5 sqrt(150) with a false-alarm probability
// of 1e-6.
TEST_F(SensorFaultsTest, SpikesHaveTheirRate) {
  const Result clean = run(""),
               faulty = run("[[fault]]\ntarget = \"gyro\"\nkind = \"spike\"\nvalue = 0.5\nper_s = 50\n" + window);
  int spikes = 0, positive = 0;
  for (std::size_t k = 0; k < clean.frames.size(); ++k)
    for (int axis = 0; axis < 3; ++axis) {
      const double added = faulty.measurements[k].sample.rate[axis] - clean.measurements[k].sample.rate[axis];
      if (added == 0) continue;
      ASSERT_TRUE(k >= first && k <= last) << k;
      ASSERT_NEAR(std::abs(added), 0.5, 1e-12);
      ++spikes;
      positive += added > 0;
    }
  EXPECT_NEAR(spikes, 150, 61);
  EXPECT_NEAR(positive, spikes / 2.0, 2.5 * std::sqrt(spikes));
}

TEST_F(SensorFaultsTest, RampsAreLinear) {
  const Result clean = run("");
  const Result faulty = run(
      "[[fault]]\ntarget = \"gyro.y\"\nkind = \"bias\"\nvalue = 0.2\nramp_in_s = 0.5\nramp_out_s = 0.25\n" + window);
  for (std::size_t k = 0; k < clean.frames.size(); ++k) {
    const double t = static_cast<double>(k) * period_s - 2;
    const double weight = t < 0 || t >= 1 ? 0 : std::min({1.0, t / 0.5, (1 - t) / 0.25});
    const double added = faulty.measurements[k].sample.rate.y() - clean.measurements[k].sample.rate.y();
    ASSERT_NEAR(added, 0.2 * weight, 1e-12) << k;
  }
}

// A product's quantisation: within one LSB of 24 bits, 400 deg/s, as the clean value is rounded, too.
TEST_F(SensorFaultsTest, ThroughTheBytesOfAProduct) {
  const std::string errors = "model = \"ideal\"\n[imu.device]\nsample_rate = 500\nstart_up = false\n";
  const Result clean = run("", "stim300", 1, errors);
  const Result faulty =
      run("[[fault]]\ntarget = \"gyro.x\"\nkind = \"bias\"\nvalue_deg_per_s = 2\n" + window, "stim300", 1, errors);
  ASSERT_GT(clean.measurements.size(), 2000U);
  ASSERT_EQ(clean.measurements.size(), faulty.measurements.size());
  int within = 0;
  for (std::size_t k = 0; k < clean.measurements.size(); ++k) {
    const double added = faulty.measurements[k].sample.rate.x() - clean.measurements[k].sample.rate.x();
    if (std::abs(added) < 1e-9) continue;
    EXPECT_NEAR(added, 2 * std::numbers::pi / 180, 1.1 * std::numbers::pi / 180 / 16384) << k;
    ++within;
  }
  EXPECT_EQ(within, 500);
}

// A fault of the inclinometers changes the inclination alone, within the window. A fault of the accelerometers leaves
// the inclination as it is.
TEST_F(SensorFaultsTest, OfInclinometersAreTheirOwn) {
  const std::string errors = "model = \"white\"\n[imu.device]\nsample_rate = 500\nstart_up = false\n";
  const Result clean = run("", "stim300", 1, errors);
  const auto compare = [&](const Result& faulty, bool inclinometers_fail) {
    ASSERT_GT(clean.measurements.size(), 2000U);
    ASSERT_EQ(clean.measurements.size(), faulty.measurements.size());
    std::size_t changed = 0;
    for (std::size_t k = 0; k < clean.measurements.size(); ++k) {
      const Sample &before = clean.measurements[k].sample, &after = faulty.measurements[k].sample;
      const bool differs = inclinometers_fail ? *after.inclination != *before.inclination
                                              : after.specific_force != before.specific_force;
      const bool is_within = k >= first && k <= last;
      EXPECT_TRUE(is_within || !differs) << k;
      changed += differs ? 1U : 0U;
      const bool other_is_same = inclinometers_fail ? after.specific_force == before.specific_force
                                                    : *after.inclination == *before.inclination;
      ASSERT_TRUE(other_is_same && after.rate == before.rate) << k;
    }
    EXPECT_GT(changed, 20U);
  };
  const std::string bias = "\nkind = \"bias\"\nvalue_mg = 50\n" + window;
  const Result biased = run("[[fault]]\ntarget = \"inclinometer.x\"" + bias, "stim300", 1, errors);
  for (std::size_t k = first; k <= last; ++k) {
    const Vector3 added =
        (*biased.measurements[k].sample.inclination - *clean.measurements[k].sample.inclination) / 9.80665;
    ASSERT_LT((added - Vector3(0.05, 0, 0)).cwiseAbs().maxCoeff(), 1.1 * 0x1p-22) << k;
  }
  compare(run("[[fault]]\ntarget = \"accelerometer\"" + bias, "stim300", 1, errors), false);
  const std::string of_csv =
      "model = \"white\"\nrate_hz = 500\ngyro.max_rad_per_s = 9\naccelerometer.max_m_per_s2 = 99\n"
      "[imu.inclinometer]\n";
  const Result upright = run("", "csv", 1, of_csv);
  const Result leaning = run("[[fault]]\ntarget = \"inclinometer.x\"" + bias, "csv", 1, of_csv);
  ASSERT_GT(leaning.measurements.size(), 2000U);
  const Vector3 lean =
      *leaning.measurements[first].sample.inclination - *upright.measurements[first].sample.inclination;
  EXPECT_NEAR(lean.x(), 0.05 * 9.80665, 1e-12);
  std::size_t kinds = 0;
  for (const FaultKind& kind : sensor_fault_kinds()) {
    if (std::ranges::count(kind.targets, "inclinometer") == 0) continue;
    SCOPED_TRACE(kind.name);
    std::string fault = fmt::format("[[fault]]\ntarget = \"inclinometer\"\nkind = \"{}\"\n", kind.name);
    for (const FaultParameter& parameter : kind.parameters)
      fault += fmt::format("{} = {}\n", parameter.key, parameter.key == "value" ? 0.5 : 200);
    const Result faulty = run(fault + window, "stim300", 1, errors);
    compare(faulty, true);
    constexpr std::size_t status_at = 30;  // of the datagram
    if (kind.name == "saturation") {
      EXPECT_EQ(faulty.frames[last].bytes[status_at] & 0x10, 0x10) << "overload";
    }
    EXPECT_EQ(clean.frames[last].bytes[status_at], 0);
    ++kinds;
  }
  EXPECT_EQ(kinds, 13U);
  EXPECT_EQ(fault_objection(sensor_fault_kinds()[0], "inclinometer", *find_protocol("native"), Settings()),
            "needs inclinometers, which native does not have; these do: csv with [imu.inclinometer], stim300");
}

// A bias far below half of the values' LSB is in increments that have an LSB of their own.
TEST_F(SensorFaultsTest, IncrementsKeepTheirDigits) {
  const auto angles = [&](const std::string& own_lsb, const std::string& fault) {
    Vector3 sum = Vector3::Zero();
    for (const Measurement& one :
         run(fault, "native", 1,
             "rate_hz = 500\nmodel = \"ideal\"\ngyro.max_rad_per_s = 10\ngyro.lsb_rad_per_s = 1e-3\n" + own_lsb +
                 "accelerometer.max_m_per_s2 = 100\n")
             .measurements)
      sum += one.sample.delta_angle;
    return sum;
  };
  const std::string bias = "[[fault]]\ntarget = \"gyro.x\"\nkind = \"bias\"\nvalue = 1e-5\n" + window;
  const std::string own = "gyro.lsb_delta_angle_rad = 1e-10\n";
  EXPECT_NEAR((angles(own, bias) - angles(own, "")).x(), 1e-5, 1e-8);
  EXPECT_NEAR((angles("", bias) - angles("", "")).x(), 0, 1e-8);
}

TEST_F(SensorFaultsTest, EveryKindOfEveryTargetRuns) {
  std::size_t kinds = 0;
  for (const FaultKind& kind : sensor_fault_kinds())
    for (const std::string_view target : kind.targets) {
      std::string text = fmt::format("[[fault]]\ntarget = \"{}\"\nkind = \"{}\"\n{}", target, kind.name, window);
      for (const FaultParameter& parameter : kind.parameters) text += fmt::format("{} = 1\n", parameter.key);
      const bool has_inclinometers = target == "inclinometer";
      const Result result = has_inclinometers ? run(text, "stim300", 1, "device.sample_rate = 500\n") : run(text);
      EXPECT_EQ(result.labels.size(), 1U) << text;
      ++kinds;
    }
  EXPECT_GE(kinds, 50U);
}

// The place of a sample, of which no format of measurements reports all.
TEST(GnssFaults, ChangeThePlace) {
  ImuModel model;
  model.rate_hz = 100;
  const std::vector<Normals> normals = fault_normals("imu1", 1, 1);
  SensorFaults faults(model, normals);
  Sample clean;
  clean.navigation.is_known = true;
  clean.navigation.latitude = 0.8;
  clean.navigation.r_E = r_E_of({0.8, 0, 0});
  const auto changed = [&](std::string_view name, std::array<double, 4> parameters, std::uint64_t since) {
    const ActiveFault fault{.kind = find_fault_kind(name, "gnss"),
                            .parameters = parameters,
                            .since = since,
                            .since_s = 0.01 * static_cast<double>(since)};
    Sample sample = clean;
    faults.apply(std::span(&fault, 1), since, 0.01, sample);
    return sample.navigation;
  };
  EXPECT_FALSE(changed("no_fix", {}, 5).is_known);
  EXPECT_NEAR((changed("jump", {100, 0, 0}, 0).r_E - clean.navigation.r_E).norm(), 100, 1e-3);
  const Navigation drifted = changed("drift", {0, 2, 0}, 300);
  EXPECT_NEAR((drifted.r_E - clean.navigation.r_E).norm(), 6, 1e-3);
  EXPECT_EQ(drifted.v_L, Vector3(0, 2, 0));
  EXPECT_EQ(changed("time_jump", {0.5}, 0).gps_ns, 500'000'000);
}

}  // namespace
}  // namespace imud
