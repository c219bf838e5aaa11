// A host asks things of the navigation filter of a unit: a restart, a heading, which aids it uses, hard and soft
// iron.
#include <gtest/gtest.h>

#include <cstring>
#include <string>

#include "tests/emulator/navigation/ordered_unit.hpp"

namespace imud {
namespace {

using State = Solution::State;

// A command of MIP: a descriptor and its data.
std::string field(std::initializer_list<int> bytes) {
  std::string all;
  for (const int byte : bytes) all += static_cast<char>(byte);
  return all;
}
std::string with_float(std::string field, double value) {
  const auto number = static_cast<float>(value);
  std::uint32_t bits = 0;
  std::memcpy(&bits, &number, sizeof bits);
  for (int shift = 24; shift >= 0; shift -= 8) field += static_cast<char>(bits >> shift & 0xFFU);
  return field;
}
constexpr std::uint8_t of_filter = 0x0D, of_3dm = 0x0C, of_base = 0x01;
constexpr double degrees_given = 40;
const std::string heading_given = with_float(field({0x03}), degrees_given* units::degree);

TEST(NavigationRequests, AResetAlignsAgain) {
  const std::pair<const char*, State> models[] = {{"3dm-gx5-25", State::levelled},
                                                  {"3dm-cv7-ahrs", State::levelled},
                                                  {"3dm-gx5-45", State::aided},
                                                  {"3dm-cv7-ins", State::aided},
                                                  {"3dm-gq7", State::aided}};
  for (const auto& [model, running] : models) {
    SCOPED_TRACE(model);
    OrderedUnit unit("mip", model, running == State::levelled ? resting_truth : turn_at);
    for (const auto& [set, command] : {std::pair{of_filter, 0x01}, std::pair{of_base, 0x7E}}) {
      unit.run(4);
      EXPECT_EQ(unit.state(), running);
      EXPECT_EQ(unit.mip(of_base, field({0x01})), 0);
      unit.run(0.01);
      EXPECT_EQ(unit.state(), running) << "a ping";
      EXPECT_EQ(unit.mip(set, field({command})), 0);
      unit.run(0.01);
      EXPECT_EQ(unit.state(), State::aligning);
      EXPECT_GT(unit.heading_sigma(), 90);
    }
    unit.run(4);
    EXPECT_EQ(unit.state(), running);
    EXPECT_LT(std::abs(unit.yaw_error()), 5);
    EXPECT_LT(unit.heading_sigma(), 5);
  }
}

TEST(NavigationRequests, AVectorNavIsReset) {
  for (const auto& [model, running] :
       {std::pair{"vn-100", State::levelled}, std::pair{"vn-200", State::aided}, std::pair{"vn-300", State::aided}}) {
    SCOPED_TRACE(model);
    OrderedUnit unit("vectornav", model, running == State::levelled ? resting_truth : turn_at);
    unit.run(4);
    for (const char* other : {"VNRRG,1", "VNWNV", "VNTAR", "VNSGB"}) {
      unit.vectornav(other);
      unit.run(0.01);
      EXPECT_EQ(unit.state(), running) << other;
    }
    for (const char* reset : {"VNRST", "VNRFS"}) {
      unit.vectornav(reset);
      unit.run(0.01);
      EXPECT_EQ(unit.state(), State::aligning) << reset;
      unit.run(4);
      EXPECT_EQ(unit.state(), running) << reset;
      EXPECT_LT(std::abs(unit.yaw_error()), 5) << reset;
    }
  }
}

// The receiver goes on; the filter does not use its fixes, and coasts.
TEST(NavigationRequests, FixesAreWithheld) {
  const std::string external = field({0x15, 1, 2}), internal = field({0x15, 1, 1}), off = field({0x50, 1, 0, 0, 0}),
                    on = field({0x50, 1, 0, 0, 1});
  struct Case {
    const char* model;
    const std::string &withhold, &use;
  };
  for (const Case& one : {Case{"3dm-gx5-45", external, internal}, Case{"3dm-gq7", external, internal},
                          Case{"3dm-gq7", off, on}, Case{"3dm-cv7-ins", off, on}}) {
    SCOPED_TRACE(one.model);
    OrderedUnit unit("mip", one.model);
    unit.run(4);
    EXPECT_GT(unit.fixes_in(2), 8U);
    EXPECT_EQ(unit.mip(of_filter, one.withhold), 0);
    EXPECT_EQ(unit.fixes_in(4), 0U);
    EXPECT_EQ(unit.state(), State::coasting);
    EXPECT_TRUE(unit.sample().fix().is_known);
    EXPECT_EQ(unit.mip(of_filter, one.use), 0);
    EXPECT_GT(unit.fixes_in(2), 8U);
    EXPECT_EQ(unit.state(), State::aided);
  }
}

// The host of a GX5-45 switches the estimates of the gyros' and of the accelerometers' scale factors on and off.
TEST(NavigationRequests, ScaleFactorsAreEstimated) {
  const std::string off = field({0x14, 1, 0, 3}), of_gyros = field({0x14, 1, 0, 7}), both = field({0x14, 1, 0, 15});
  const std::string keys = "gyro.scale_factor = [1.002, 1, 1]\naccelerometer.scale_factor = [1, 1, 1.003]\n";
  const auto sigmas = [](OrderedUnit& unit) {
    const Solution& solution = *unit.run(0.1).solution;
    return std::pair(solution.gyro_scale_sigma.maxCoeff(), solution.accelerometer_scale_sigma.maxCoeff());
  };
  const auto none = std::pair(0.0F, 0.0F);
  OrderedUnit unit("mip", "3dm-gx5-45", turn_at, keys);
  unit.run(4);
  EXPECT_EQ(sigmas(unit), none) << "as delivered";
  EXPECT_EQ(unit.mip(of_filter, of_gyros), 0);
  EXPECT_NEAR(sigmas(unit).first, 0.002F, 1e-6F);
  EXPECT_EQ(sigmas(unit).second, 0.0F);
  // What was a part of the bias in gravity, or becomes one, is not known: 9.8 m/s^2 times 0.003.
  const auto bias_sigma = [](OrderedUnit& one) { return one.run(0.1).solution->accelerometer_bias_sigma.minCoeff(); };
  unit.run(20);
  EXPECT_LT(bias_sigma(unit), 0.02F);
  EXPECT_EQ(unit.mip(of_filter, both), 0);
  EXPECT_GT(bias_sigma(unit), 0.025F);
  EXPECT_GT(sigmas(unit).first, 0.0F);
  EXPECT_NEAR(sigmas(unit).second, 0.003F, 1e-4F);
  unit.run(20);
  EXPECT_EQ(unit.mip(of_filter, off), 0);
  EXPECT_GT(bias_sigma(unit), 0.025F);
  EXPECT_EQ(sigmas(unit), none);
  OrderedUnit gq7("mip", "3dm-gq7", turn_at, keys);
  gq7.run(6);
  EXPECT_EQ(gq7.mip(of_filter, both), 0);
  EXPECT_EQ(sigmas(gq7), none) << "this product has no scale factors that its host could switch on";
  // The key has them on whatever the host sends.
  OrderedUnit with_key("mip", "3dm-gx5-45", turn_at, keys + "navigation.estimate_scale_factors = true\n");
  EXPECT_EQ(with_key.mip(of_filter, off), 0);
  with_key.run(4);
  EXPECT_GT(sigmas(with_key).first, 0.001F);
  EXPECT_GT(sigmas(with_key).second, 0.0F);
}

// A filter without fixes cannot align.
TEST(NavigationRequests, AlignmentNeedsFixes) {
  OrderedUnit unit("mip", "3dm-gq7");
  unit.mip(of_filter, field({0x50, 1, 0, 0, 0}));
  unit.run(4);
  EXPECT_EQ(unit.state(), State::aligning);
  unit.mip(of_filter, field({0x50, 1, 0, 0, 1}));
  unit.run(4);
  EXPECT_EQ(unit.state(), State::aided);
}

TEST(NavigationRequests, TheMagnetometerIsWithheld) {
  struct Case {
    const char* model;
    std::string withhold, use;
  };
  const Case cases[] = {
      {"3dm-gx5-45", field({0x18, 1, 2}), field({0x18, 1, 4})},        // the velocity of GNSS; both
      {"3dm-gx5-25", field({0x18, 1, 0}), field({0x18, 1, 1})},        // none
      {"3dm-gx5-25", field({0x41, 1, 0, 1}), field({0x41, 1, 0, 3})},  // gravity alone
      {"3dm-cv7-ahrs", field({0x50, 1, 0, 4, 0}), field({0x50, 1, 0, 4, 1})},
      {"3dm-gq7", field({0x50, 1, 0, 4, 0}), field({0x50, 1, 0, 4, 1})},
  };
  for (const Case& one : cases) {
    SCOPED_TRACE(one.model);
    OrderedUnit unit("mip", one.model);
    unit.run(4);
    EXPECT_GT(unit.headings_in(1), 8U);
    const Vector3 field_before = unit.sample().magnetic_field;
    EXPECT_EQ(unit.mip(of_filter, one.withhold), 0);
    EXPECT_EQ(unit.headings_in(1), 0U);
    EXPECT_NEAR(unit.sample().magnetic_field.norm(), field_before.norm(), 5e-6) << "it is measured on";
    EXPECT_EQ(unit.mip(of_filter, one.use), 0);
    EXPECT_GT(unit.headings_in(1), 8U);
  }
  for (const char* model : {"vn-100", "vn-200"}) {
    SCOPED_TRACE(model);
    OrderedUnit unit("vectornav", model);
    unit.run(4);
    EXPECT_EQ(unit.vectornav("VNKMD,1").substr(0, 8), "$VNKMD,1");
    EXPECT_EQ(unit.headings_in(1), 0U);
    EXPECT_EQ(unit.vectornav("VNKMD,2").substr(0, 9), "$VNERR,07");
    EXPECT_EQ(unit.headings_in(1), 0U);
    unit.vectornav("VNKMD,0");
    EXPECT_GT(unit.headings_in(1), 8U);
    for (const auto& end :
         {+[](OrderedUnit& one) { one.vectornav("VNRST"); }, +[](OrderedUnit& one) { one.cycle_power(); }}) {
      unit.vectornav("VNKMD,1");
      end(unit);
      unit.run(4);
      EXPECT_GT(unit.headings_in(1), 8U) << "a start ends the disturbance";
    }
  }
}

// It makes a fix at once, which is as new as the sample.
TEST(NavigationRequests, AReceiverBeginsAnewWithItsPower) {
  OrderedUnit unit("vectornav", "vn-200");
  unit.run(4);
  while (unit.sample().solution->since_epoch < 4) unit.run(0.005);
  EXPECT_GT(unit.sample().fix_age(), Nanoseconds{0});
  unit.cycle_power();
  EXPECT_TRUE(unit.sample().fix().is_known);
  EXPECT_EQ(unit.sample().solution->since_epoch, 0U);
  EXPECT_EQ(unit.sample().fix_age(), Nanoseconds{0});
}

// Without gravity the tilt of an AHRS is not corrected, and its uncertainty grows.
TEST(NavigationRequests, GravityIsWithheld) {
  const auto drift = [](OrderedUnit& unit, const std::function<void(const char*)>& withhold) {
    unit.run(10);
    EXPECT_NE(unit.sample().solution->used & aid::gravity, 0);
    const float before = unit.sample().solution->attitude.x();
    withhold("1");
    unit.run(20);
    EXPECT_EQ(unit.sample().solution->used & aid::gravity, 0);
    const float without = unit.sample().solution->attitude.x();
    EXPECT_GT(without, before);
    withhold("0");
    unit.run(20);
    EXPECT_LT(unit.sample().solution->attitude.x(), before);
  };
  OrderedUnit vn100("vectornav", "vn-100", resting_truth);
  drift(vn100, [&](const char* state) { vn100.vectornav(std::string("VNKAD,") + state); });
  OrderedUnit gx5("mip", "3dm-gx5-25", resting_truth);
  drift(gx5, [&](const char* state) { gx5.mip(of_filter, field({0x41, 1, 0, *state == '1' ? 2 : 3})); });
}

// In every state, by all three forms of the command; the other angles of an attitude are not used.
TEST(NavigationRequests, AVectorNavTakesAHeading) {
  for (const char* model : {"vn-100", "vn-200"})
    for (const char* parameters : {"40.0", "+040.000,+020.000,+010.000", "0,0,0.3420201,0.9396926"}) {
      SCOPED_TRACE(std::string(model) + " " + parameters);
      OrderedUnit unit("vectornav", model, resting_truth);
      unit.run(4);
      unit.vectornav("VNKMD,1");
      EXPECT_EQ(unit.vectornav(std::string("VNSIH,") + parameters).substr(0, 6), "$VNSIH");
      unit.run(0.01);
      EXPECT_NEAR(unit.yaw(), degrees_given, 0.2);
      EXPECT_NEAR(unit.heading_sigma(), 5, 0.05);
      unit.run(2);
      EXPECT_NEAR(unit.yaw(), degrees_given, 1);
      unit.vectornav("VNKMD,0");
      unit.run(10);
      const double corrected = unit.yaw();
      EXPECT_LT(corrected, degrees_given - 2) << "by the magnetometer";
      unit.vectornav("VNRRG,1");
      unit.run(0.01);
      EXPECT_NEAR(unit.yaw(), corrected, 0.5) << "it was given once";
      unit.vectornav("VNRST");
      unit.vectornav("VNKMD,1");
      unit.vectornav(std::string("VNSIH,") + parameters);
      unit.run(4);
      EXPECT_NE(unit.state(), State::aligning);
      EXPECT_NEAR(unit.yaw(), degrees_given, 1);
      EXPECT_NEAR(unit.heading_sigma(), 5, 0.3);
    }
  OrderedUnit unit("vectornav", "vn-100", resting_truth);
  unit.run(4);
  unit.vectornav("VNKMD,1");
  const double before = unit.yaw();
  for (const char* wrong : {"VNSIH,x", "VNSIH,400", "VNSIH,1,2", "VNSIH,0,0,0,0", "VNSIH,1,2,3,4,5"})
    EXPECT_EQ(unit.vectornav(wrong).substr(0, 9), "$VNERR,07") << wrong;
  unit.vectornav("VNSIH,-100");
  unit.vectornav("VNRST");  // a reset forgets it
  unit.run(4);
  EXPECT_NEAR(unit.yaw(), before, 3);
}

// Register 26 turns the host's axes, and a given heading is the one of these.
TEST(NavigationRequests, AHeadingIsOfTheHostsAxes) {
  OrderedUnit unit("vectornav", "vn-100", resting_truth);
  unit.vectornav("VNWRG,26,0,1,0,-1,0,0,0,0,1");  // its x axis is the platform's y axis
  unit.vectornav("VNWNV");
  unit.vectornav("VNRST");
  unit.run(4);
  unit.vectornav("VNKMD,1");
  unit.vectornav("VNSIH,40");
  unit.run(0.01);
  EXPECT_NEAR(unit.yaw(), degrees_given - 90, 0.2);
}

// A device of the 7 series sets its heading at any time, unless the magnetometer aids it.
TEST(NavigationRequests, ASevenSeriesTakesAHeading) {
  for (const char* model : {"3dm-cv7-ahrs", "3dm-cv7-ins", "3dm-gq7"}) {
    SCOPED_TRACE(model);
    OrderedUnit unit("mip", model, resting_truth);
    unit.run(4);
    const double before = unit.yaw();
    EXPECT_EQ(unit.mip(of_filter, heading_given), 0);
    unit.run(0.01);
    EXPECT_NEAR(unit.yaw(), before, 0.2) << "the magnetometer aids it";
    unit.mip(of_filter, field({0x50, 1, 0, 4, 0}));
    EXPECT_EQ(unit.mip(of_filter, with_float(field({0x03}), 3.2)), 3);
    EXPECT_EQ(unit.mip(of_filter, heading_given), 0);
    unit.run(0.01);
    EXPECT_NEAR(unit.yaw(), degrees_given, 0.2);
    EXPECT_NEAR(unit.heading_sigma(), 5, 0.05);
  }
}

// A GX5 takes a heading, and any model an attitude, only while its filter initializes.
TEST(NavigationRequests, AGx5TakesAHeadingInItsInitialization) {
  const std::string attitude =
      with_float(with_float(with_float(field({0x02}), 0.1), -0.1), degrees_given * units::degree);
  for (const char* model : {"3dm-gx5-25", "3dm-gx5-45"})
    for (const std::string& command : {heading_given, attitude}) {
      SCOPED_TRACE(model);
      OrderedUnit unit("mip", model, resting_truth);
      unit.mip(of_filter, field({0x18, 1, 0}));  // no heading aids
      EXPECT_EQ(unit.mip(of_filter, command), 0);
      unit.run(3);
      EXPECT_NE(unit.state(), State::aligning);
      EXPECT_NEAR(unit.yaw(), degrees_given, 1);
      EXPECT_NEAR(unit.heading_sigma(), 5, 0.3);
      EXPECT_EQ(unit.mip(of_filter, with_float(field({0x03}), -1)), 0);
      unit.run(0.1);
      EXPECT_NEAR(unit.yaw(), degrees_given, 1) << "it runs";
    }
  OrderedUnit unit("mip", "3dm-cv7-ahrs", resting_truth);
  EXPECT_EQ(unit.mip(of_filter, with_float(with_float(with_float(field({0x02}), 0), 0), -3.2)), 3);
  unit.run(3);
  const double before = unit.yaw();
  EXPECT_EQ(unit.mip(of_filter, attitude), 0);
  unit.run(0.1);
  EXPECT_NEAR(unit.yaw(), before, 0.2) << "it runs";
}

// Without the automatic initialization a GX5 waits for a heading.
TEST(NavigationRequests, AGx5WaitsForAHeading) {
  for (const char* model : {"3dm-gx5-25", "3dm-gx5-45"}) {
    SCOPED_TRACE(model);
    OrderedUnit unit("mip", model, resting_truth);
    EXPECT_EQ(unit.mip(of_filter, field({0x19, 1, 0})), 0);
    unit.run(5);
    EXPECT_EQ(unit.state(), State::aligning);
    unit.mip(of_filter, field({0x18, 1, 0}));
    unit.mip(of_filter, heading_given);
    unit.run(2.5);
    EXPECT_NE(unit.state(), State::aligning);
    EXPECT_NEAR(unit.yaw(), degrees_given, 1);
    unit.mip(of_filter, field({0x01}));
    unit.run(3);
    EXPECT_EQ(unit.state(), State::aligning);
  }
}

// A heading is given after a turn of a second, and the alignment ends after two more: it is of the time of the
// command.
TEST(NavigationRequests, AGivenHeadingTurnsWithThePlatform) {
  OrderedUnit unit("mip", "3dm-gq7");
  unit.mip(of_filter, field({0x50, 1, 0, 0, 0}));
  unit.mip(of_filter, field({0x50, 1, 0, 4, 0}));
  unit.run(1);
  unit.mip(of_filter, with_float(field({0x03}), 0.1));  // the true one: 0.1 rad/s
  unit.run(2);
  unit.mip(of_filter, field({0x50, 1, 0, 0, 1}));
  unit.run(1.5);
  EXPECT_EQ(unit.state(), State::aided);
  EXPECT_LT(std::abs(unit.yaw_error()), 3);
}

// So are two antennas and the barometer: they are neither used nor rejected.
TEST(NavigationRequests, AntennasAndHeightsAreWithheld) {
  OrderedUnit unit("mip", "3dm-gq7", turn_at,
                   "navigation.antennas_heading_deg = 0.5\nnavigation.barometer_rate_hz = 10\n");
  unit.run(4);
  for (const auto& [source, bit] : {std::pair{1, aid::antennas_heading}, std::pair{2, aid::pressure}}) {
    SCOPED_TRACE(source);
    const auto had = [&unit, bit = bit] {
      const Solution& solution = *unit.sample().solution;
      return ((solution.used | solution.rejected) & bit) != 0;
    };
    EXPECT_TRUE(had());
    EXPECT_EQ(unit.mip(of_filter, field({0x50, 1, 0, source, 0})), 0);
    unit.run(1);
    EXPECT_FALSE(had());
    EXPECT_EQ(unit.mip(of_filter, field({0x50, 1, 0, source, 1})), 0);
    unit.run(1);
    EXPECT_TRUE(had());
  }
}

// Scenario 2 of register 67 is an INS without pressure.
TEST(NavigationRequests, AScenarioHasNoPressure) {
  OrderedUnit unit("vectornav", "vn-200", turn_at, "navigation.barometer_rate_hz = 10\n");
  const auto had = [&unit] {
    const Solution& solution = *unit.sample().solution;
    return ((solution.used | solution.rejected) & aid::pressure) != 0;
  };
  unit.run(4);
  EXPECT_TRUE(had());
  EXPECT_EQ(unit.vectornav("VNWRG,67,2,1,1,0").substr(0, 12), "$VNWRG,67,2,");
  unit.run(1);
  EXPECT_FALSE(had());
  unit.vectornav("VNWRG,67,1,1,1,0");
  unit.run(1);
  EXPECT_TRUE(had());
}

// A heading of an x axis that stands upright is none: the unit has its heading by the magnetometer.
TEST(NavigationRequests, AnUprightAxisHasNoHeading) {
  const auto upright = [](TruthTime time) {
    Truth truth = resting_truth(time);
    truth.q_NB = exp(Vector3(0, units::pi / 2, 0));
    truth.specific_force_B = truth.q_NB.conjugate() * Vector3(0, 0, -units::standard_gravity);
    return truth;
  };
  for (const char* model : {"vn-100", "vn-200"}) {
    SCOPED_TRACE(model);
    OrderedUnit unit("vectornav", model, upright);
    const auto error = [&unit, &upright] {
      return Eigen::AngleAxisd(unit.sample().q_LP * upright({}).q_NB.conjugate()).angle() / units::degree;
    };
    unit.run(4);
    EXPECT_LT(error(), 5);
    unit.vectornav("VNSIH,100");
    unit.run(0.01);
    EXPECT_LT(error(), 5);
    unit.vectornav("VNRST");
    unit.vectornav("VNSIH,100");
    unit.run(4);
    EXPECT_NE(unit.state(), State::aligning);
    EXPECT_LT(error(), 5);
  }
}

// An offset of the magnetic field turns the heading; the same offset in the host's compensation does so too.
TEST(NavigationRequests, HardIronActsOnTheHeading) {
  OrderedUnit vn100("vectornav", "vn-100", resting_truth);
  vn100.run(3);
  const double before = vn100.yaw();
  constexpr double offset = 0.05;  // gauss, along the platform's y axis
  // By the angle by which the field seems to turn, the heading turns the other way.
  const auto moved_by = [](const Vector3& field_P) {
    return (std::atan2(field_P.y(), field_P.x()) - std::atan2(field_P.y() - 1e-4 * offset, field_P.x())) /
           units::degree;
  };
  const double moved = moved_by(vn100.sample().magnetic_field);
  EXPECT_GT(moved, 5);
  vn100.vectornav("VNWRG,23,1,0,0,0,1,0,0,0,1,0,0.05,0");
  vn100.vectornav("VNWNV");
  vn100.vectornav("VNRST");
  vn100.run(3);
  EXPECT_NEAR(vn100.yaw() - before, moved, 0.25 * moved);
  // Soft iron that undoes nothing of it, and the offset taken away again.
  vn100.vectornav("VNWRG,23,2,0,0,0,2,0,0,0,2,0,0,0");
  vn100.vectornav("VNWNV");
  vn100.vectornav("VNRST");
  vn100.run(3);
  EXPECT_NEAR(vn100.yaw(), before, 1.5);

  OrderedUnit gx5("mip", "3dm-gx5-25", resting_truth);
  gx5.run(3);
  const double without = gx5.yaw(), shifted = moved_by(gx5.sample().magnetic_field);
  EXPECT_EQ(gx5.mip(of_3dm, with_float(with_float(with_float(field({0x3A, 1}), 0), offset), 0)), 0);
  gx5.mip(of_filter, field({0x01}));
  gx5.run(3);
  EXPECT_NEAR(gx5.yaw() - without, shifted, 0.25 * shifted);
}

// A host gives its heading when it has switched the unit on, before there is truth. A later run does not begin with
// it.
TEST(NavigationRequests, AHeadingBeforeTheFirstRun) {
  OrderedUnit unit("vectornav", "vn-100", resting_truth);
  unit.vectornav("VNKMD,1");
  unit.vectornav("VNSIH,40");
  unit.begin_run();
  unit.run(3);
  EXPECT_NEAR(unit.yaw(), degrees_given, 1);
  unit.begin_run();
  unit.begin_run();  // a leap of the truth and a new run without a sample between them
  unit.run(3);
  EXPECT_NEAR(unit.yaw(), 0, 1) << "it has no magnetometer";
}

// Another model begins with the aids as the host has set them.
TEST(NavigationRequests, AReloadKeepsThem) {
  OrderedUnit unit("vectornav", "vn-200");
  unit.run(4);
  unit.vectornav("VNKMD,1");
  unit.vectornav("VNSIH,10");
  unit.run(1);
  unit.reload("gyro.bias_rad_per_s = [1e-4, 0, 0]\n");
  unit.run(0.1);
  EXPECT_EQ(unit.state(), State::aligning);
  unit.run(4);
  EXPECT_EQ(unit.state(), State::aided);
  EXPECT_EQ(unit.headings(), 0U);
  EXPECT_LT(std::abs(unit.yaw_error()), 15) << "the heading was given to the old filter";
  unit.vectornav("VNKMD,0");
  EXPECT_GT(unit.headings_in(1), 8U);
}

}  // namespace
}  // namespace imud
