// The g-compensation of the STIM300, section 7.5.2.2.6 of TS1524 rev. 31: what is left of the bias by acceleration.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "core/units.hpp"
#include "tests/protocols/stim300/stim300_unit.hpp"

namespace imud {
namespace {

using namespace stim300_test;

constexpr double deg = units::degree, g = units::standard_gravity;
// 6 of 7 parts of the sensitivity are known to the calibration.
constexpr double per_g = 7 * deg, left_per_g = 1 * deg;
constexpr double half_lsb = 0.51 * 0x1p-14 * deg;

// A unit whose gyros have a bias of `per_g` for each g, along its own axis, and of 14 deg/s for g along z in x.
class AcceleratedUnit : public Stim300Unit {
 public:
  AcceleratedUnit() : Stim300Unit("start_up=false,sample_rate=2000,bit_rate=1843200,accelerometer_range_g=30") {
    figures.g_sensitivity = per_g / g * Matrix3::Identity();
    figures.g_sensitivity(0, 2) = 2 * per_g / g;
    device->set_figures(figures);
  }
  void configure(const std::string& command) {
    send_line("SERVICEMODE");
    EXPECT_EQ(send_line(command).find("E0"), std::string::npos) << command;
    send_line("x N");  // without saving
  }
  // Returns the last rate that is sent, after that many samples at a constant specific force.
  Vector3 rate_at(const Vector3& f, int samples = 4) {
    sample.specific_force = f;
    sample.rate = figures.g_sensitivity * f;
    sample.delta_angle = sample.rate / 2000;
    sample.delta_velocity = f / 2000;
    const Recording recording = decode(run(samples));
    EXPECT_FALSE(recording.measurements.empty());
    return recording.measurements.empty() ? Vector3(Vector3::Zero()) : recording.measurements.back().sample.rate;
  }
  OwnFigures figures;
};

void expect_near(const Vector3& a, const Vector3& b, double tolerance) {
  EXPECT_LE((a - b).cwiseAbs().maxCoeff(), tolerance) << a.transpose() << "; " << b.transpose();
}

TEST(Stim300GCompensation, IsOffAsDelivered) {
  AcceleratedUnit unit;
  const Vector3 f = g * Vector3(1, -0.5, 1);
  expect_near(unit.rate_at(f), unit.figures.g_sensitivity * f, half_lsb);
}

TEST(Stim300GCompensation, LeavesASeventh) {
  AcceleratedUnit unit;
  unit.configure("g 3");
  expect_near(unit.rate_at(g * Vector3(1, -0.5, 0)), left_per_g * Vector3(1, -0.5, 0), half_lsb);
  expect_near(unit.rate_at(g * Vector3(0, 0, 1)), left_per_g * Vector3(2, 0, 1), half_lsb);
  // Only the z axis is compensated.
  unit.configure("g 0,0,1,1,0,0,0");
  expect_near(unit.rate_at(g * Vector3(0, 1, 1)), Vector3(2 * per_g, per_g, left_per_g), half_lsb);
}

// The inclinometers measure 2 g at most; the accelerometers do not clip until 33 g.
TEST(Stim300GCompensation, KnowsOnlyWhatItsSourceMeasures) {
  AcceleratedUnit unit;
  const Vector3 f = g * Vector3(5, 0, 0);
  unit.configure("g 3");
  expect_near(unit.rate_at(f), Vector3(5 * left_per_g, 0, 0), half_lsb);
  unit.configure("g 5");
  expect_near(unit.rate_at(f), Vector3(5 * per_g - 2 * (per_g - left_per_g), 0, 0), half_lsb);
}

// The inclinometers' own value is the source, whatever the accelerometers measure, and is filtered as their value is.
TEST(Stim300GCompensation, UsesTheInclinometersThemselves) {
  AcceleratedUnit unit;
  const Vector3 f = g * Vector3(1, 0.5, 0), level = g * Vector3(0.25, -0.5, 0);
  unit.sample.inclination = level;
  const double known = per_g - left_per_g;
  unit.configure("g 5");
  expect_near(unit.rate_at(f), unit.figures.g_sensitivity * f - known / g * level, half_lsb);
  unit.configure("g 3");
  expect_near(unit.rate_at(f), left_per_g / g * f, half_lsb);
  AcceleratedUnit filtered;
  filtered.configure("g 6,5");
  filtered.sample.inclination = Vector3::Zero();
  filtered.rate_at(f);
  filtered.sample.inclination = level;
  const double passed = 1 - std::exp(-2 * 3.14159265358979 * 5 * 60 / 2000.0);
  expect_near(filtered.rate_at(f, 60), unit.figures.g_sensitivity * f - passed * known / g * level, half_lsb);
}

// Sums of the increments have it as the rates do.
TEST(Stim300GCompensation, ActsOnIncrements) {
  AcceleratedUnit unit;
  unit.configure("g 3");
  unit.rate_at(g * Vector3(1, 0, 0));
  unit.configure("u g,2");  // the average
  expect_near(unit.rate_at(g * Vector3(1, 0, 0), 8), Vector3(left_per_g, 0, 0), half_lsb);
}

// A step of the acceleration through the low-pass filter of 5 Hz: 1 - exp(-2 pi 5 Hz t) of it is compensated.
TEST(Stim300GCompensation, IsFiltered) {
  AcceleratedUnit unit;
  unit.configure("g 4,5");
  unit.rate_at(Vector3::Zero());
  const double known = per_g - left_per_g;
  const int samples = 60;
  const double passed = 1 - std::exp(-2 * 3.14159265358979 * 5 * samples / 2000.0);
  EXPECT_NEAR(unit.rate_at(g * Vector3(1, 0, 0), samples).x(), per_g - known * passed, half_lsb);
  EXPECT_GT(passed, 0.5);
  EXPECT_LT(passed, 0.7);
}

// A unit without that error has nothing to compensate.
TEST(Stim300GCompensation, IsNothingWithoutSensitivity) {
  AcceleratedUnit unit;
  unit.device->set_figures({});
  unit.configure("g 3");
  const Vector3 f = g * Vector3(1, 2, 3);
  expect_near(unit.rate_at(f), unit.figures.g_sensitivity * f, half_lsb);
}

}  // namespace
}  // namespace imud
