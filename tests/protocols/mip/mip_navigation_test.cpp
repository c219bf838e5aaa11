// Position, time and magnetic field, as a MIP device reports them.
#include <gtest/gtest.h>

#include <cmath>

#include "core/attitude.hpp"
#include "core/earth/earth.hpp"
#include "core/units.hpp"
#include "tests/protocols/mip/mip_unit.hpp"

namespace imud::mip_test {
namespace {

using std::int64_t;

Sample known() {
  Sample sample = over_boulder();
  sample.navigation.r_E = {-1e6, -4e6, 4e6};
  sample.magnetic_field = {20e-6, -1.5e-6, 48e-6};
  return sample;
}

// The packet of a set with these fields, sent by a unit of that model.
Bytes sent(const std::string& model, std::uint8_t set, std::vector<std::uint8_t> descriptors, const Sample& sample,
           const OwnFigures& figures = {}) {
  Unit unit({{"model", model}});
  unit.device->set_figures(figures);
  Bytes format = {1, set, static_cast<std::uint8_t>(descriptors.size())};
  for (const std::uint8_t descriptor : descriptors) format.insert(format.end(), {descriptor, 0, 1});
  EXPECT_EQ(unit.code(command(0x0C, 0x0F, format)), 0);
  unit.sample = sample;
  for (const Bytes& packet : unit.run(1))
    if (packet[2] == set) return packet;
  return {};
}

TEST(MipNavigation, MagneticFieldAndPressure) {
  for (const char* model : {"3dm-gx5-25", "3dm-cv7-ahrs", "3dm-gx5-45", "3dm-cv7-ins", "3dm-gq7"}) {
    const Bytes packet = sent(model, 0x80, {0x06, 0x17}, known());
    const Bytes field_G = field(packet, 0x06);
    EXPECT_FLOAT_EQ(number(field_G, 0), 0.2F);
    EXPECT_FLOAT_EQ(number(field_G, 1), -0.015F);
    EXPECT_FLOAT_EQ(number(field_G, 2), 0.48F);
    EXPECT_FLOAT_EQ(number(field(packet, 0x17), 0), 829.5F) << "mbar";
  }
}

// 2408 weeks after 1980-01-06 it is 2026-03-01, a Sunday; then UTC is 18 s behind: Wednesday 05:06:25.25.
TEST(MipNavigation, GpsTime) {
  constexpr double tow = 3 * 86400 + 5 * 3600 + 6 * 60 + 25.25;
  const auto check = [&](const Bytes& data, int valid) {
    ASSERT_EQ(data.size(), 12U);
    EXPECT_DOUBLE_EQ(number_at<double>(data, 0), tow);
    EXPECT_EQ(number_at<std::uint16_t>(data, 8), 2408);
    EXPECT_EQ(number_at<std::uint16_t>(data, 10), valid);
  };
  const Bytes imu = sent("3dm-cv7-ahrs", 0x80, {0x12, 0xD3}, known());
  check(field(imu, 0x12), 0x1C);
  check(field(imu, 0xD3), 3);
  check(field(sent("3dm-cv7-ins", 0x82, {0xD3}, known()), 0xD3), 3);
  check(field(sent("3dm-gx5-45", 0x82, {0x11}, known()), 0x11), 1);
  check(field(sent("3dm-gx5-45", 0x81, {0x09}, known()), 0x09), 3);
  // A receiver's pulse, and a bit that turns every second.
  Sample later = known();
  const auto flags = [&] {
    return number_at<std::uint16_t>(field(sent("3dm-gx5-45", 0x80, {0x12}, later), 0x12), 10);
  };
  const int at_first = flags();
  later.navigation.gps_ns += 1'000'000'000;
  EXPECT_EQ(at_first ^ flags(), 2);
  EXPECT_EQ(at_first & ~2, 0x1D);

  const Bytes utc = field(sent("3dm-gx5-45", 0x81, {0x08}, known()), 0x08);
  EXPECT_EQ(utc, (Bytes{0x07, 0xEA, 3, 4, 5, 6, 7, 0, 0, 0, 250, 0, 3}));

  Sample unknown;
  EXPECT_EQ(field(sent("3dm-gx5-25", 0x80, {0x12}, unknown), 0x12), Bytes(12)) << "the device's own time, not valid";
}

TEST(MipNavigation, FilterPositionAndVelocity) {
  for (const char* model : {"3dm-gx5-45", "3dm-cv7-ins"}) {
    const Bytes packet = sent(model, 0x82, {0x01, 0x02, 0x40}, known());
    const Bytes position = field(packet, 0x01), velocity = field(packet, 0x02), ecef = field(packet, 0x40);
    EXPECT_DOUBLE_EQ(number_at<double>(position, 0), 40);
    EXPECT_DOUBLE_EQ(number_at<double>(position, 8), -105.25);
    EXPECT_DOUBLE_EQ(number_at<double>(position, 16), 1655);
    EXPECT_EQ(number_at<std::uint16_t>(position, 24), 1);
    EXPECT_EQ(number(velocity, 1), -40);
    EXPECT_EQ(number_at<std::uint16_t>(velocity, 12), 1);
    EXPECT_EQ(number_at<double>(ecef, 8), -4e6);
    EXPECT_EQ(number_at<std::uint16_t>(ecef, 24), 1);
    const Bytes nothing = sent(model, 0x82, {0x01, 0x02, 0x40}, Sample());
    EXPECT_EQ(field(nothing, 0x01), Bytes(26));
    EXPECT_EQ(field(nothing, 0x02), Bytes(14));
    EXPECT_EQ(field(nothing, 0x40), Bytes(26));
  }
}

TEST(MipNavigation, StateOfTheFilter) {
  const auto state = [](const char* model, const Sample& sample) {
    return field(sent(model, 0x82, {0x10}, sample), 0x10);
  };
  EXPECT_EQ(state("3dm-gx5-25", Sample()), (Bytes{0, 2, 0, 1, 0, 0}));
  EXPECT_EQ(state("3dm-gx5-45", Sample()), (Bytes{0, 1, 0, 1, 0x20, 0})) << "initializing, no position and velocity";
  EXPECT_EQ(state("3dm-gx5-45", known()), (Bytes{0, 2, 0, 1, 0, 0}));
  EXPECT_EQ(state("3dm-cv7-ahrs", known()), (Bytes{0, 3, 0, 1, 0, 1}));
  EXPECT_EQ(state("3dm-cv7-ins", Sample()), (Bytes{0, 3, 0, 1, 0, 1}));
  EXPECT_EQ(state("3dm-cv7-ins", known()), (Bytes{0, 4, 0, 1, 0, 1})) << "full navigation";
}

// Gravity at 45 deg of latitude, on the ellipsoid: 9.806199 m/s^2 (NGA.STND.0036, Eq. 4-1: 9.80620).
TEST(MipNavigation, AccelerationsOfTheFilter) {
  Sample sample = known();
  sample.navigation.latitude = 45 * units::degree;
  sample.navigation.height = 0;
  sample.q_LP = Quaternion(dcm_from_yaw_pitch_roll(1.0, 0, units::pi / 2).transpose());  // down is y
  sample.specific_force = {1, -9.8, 2};
  sample.rate = {0.1, 0.2, -0.3};
  const Bytes packet = sent("3dm-cv7-ahrs", 0x82, {0x0D, 0x0E, 0x13, 0x1C, 0x04}, sample);
  EXPECT_NEAR(number(field(packet, 0x13), 1), 9.80620, 1e-5);
  EXPECT_NEAR(number(field(packet, 0x13), 0), 0, 1e-6);
  EXPECT_NEAR(number(field(packet, 0x0D), 1), 0.00620, 1e-5);
  EXPECT_FLOAT_EQ(number(field(packet, 0x0D), 2), 2);
  EXPECT_FLOAT_EQ(number(field(packet, 0x0E), 2), -0.3F);
  EXPECT_FLOAT_EQ(number(field(packet, 0x1C), 1), -9.8F);
  EXPECT_FLOAT_EQ(number(field(packet, 0x04), 5), 1) << "v_P = M v_L, by rows: y of P is down";
  EXPECT_FLOAT_EQ(number(field(packet, 0x04), 0), std::cos(1.0F));
  EXPECT_FLOAT_EQ(number(field(packet, 0x04), 1), std::sin(1.0F));
  for (const std::uint8_t descriptor : Bytes{0x0D, 0x0E, 0x13, 0x1C}) EXPECT_EQ(field(packet, descriptor)[13], 1);
  Sample level;
  level.specific_force = {0, 0, -units::standard_gravity};
  EXPECT_EQ(number(field(sent("3dm-gx5-25", 0x82, {0x0D}, level), 0x0D), 2), 0) << "where the place is unknown";
}

TEST(MipNavigation, Receiver) {
  const Bytes packet = sent("3dm-gx5-45", 0x81, {0x03, 0x05, 0x07, 0x0B, 0x04, 0x0D}, known());
  const Bytes position = field(packet, 0x03), velocity = field(packet, 0x05);
  EXPECT_DOUBLE_EQ(number_at<double>(position, 0), 40);
  EXPECT_DOUBLE_EQ(number_at<double>(position, 8), -105.25);
  EXPECT_DOUBLE_EQ(number_at<double>(position, 16), 1655);
  EXPECT_EQ(number_at<std::uint16_t>(position, 40), 0x1B) << "but for the height above mean sea level";
  EXPECT_EQ(number_at<float>(position, 32), 1.2F) << "accuracies are those under an open sky, m";
  EXPECT_EQ(number_at<float>(position, 36), 1.8F);
  EXPECT_EQ(number(velocity, 0), 30);
  EXPECT_EQ(number(velocity, 2), -5);
  EXPECT_FLOAT_EQ(number(velocity, 3), 50.24938F) << "speed";
  EXPECT_EQ(number(velocity, 4), 50) << "over ground";
  EXPECT_FLOAT_EQ(number(velocity, 5), 306.8699F) << "course, deg";
  EXPECT_EQ(number(velocity, 6), 0.05F) << "m/s";
  EXPECT_EQ(number(velocity, 7), 0.5F) << "deg";
  EXPECT_EQ(number_at<std::uint16_t>(velocity, 32), 0x3F);
  const Bytes dop = field(packet, 0x07);
  EXPECT_NEAR(number(dop, 0) * number(dop, 0), number(dop, 1) * number(dop, 1) + number(dop, 4) * number(dop, 4),
              0.02);
  EXPECT_EQ(number_at<std::uint16_t>(dop, 28), 0x7F);
  EXPECT_EQ(field(packet, 0x0B), (Bytes{0, 12, 0, 0, 0, 7}));
  EXPECT_EQ(number_at<double>(field(packet, 0x04), 16), 4e6);
  EXPECT_EQ(number_at<float>(field(packet, 0x04), 24), 2.2F) << "m";
  EXPECT_EQ(number_at<std::uint16_t>(field(packet, 0x04), 28), 3);
  EXPECT_EQ(field(packet, 0x0D), (Bytes{1, 4, 1, 0, 7}));

  const Bytes lost = sent("3dm-gx5-45", 0x81, {0x03, 0x05, 0x07, 0x0B}, Sample());
  EXPECT_EQ(field(lost, 0x03), Bytes(42));
  EXPECT_EQ(field(lost, 0x05), Bytes(34));
  EXPECT_EQ(number_at<std::uint16_t>(field(lost, 0x07), 28), 0);
  EXPECT_EQ(field(lost, 0x0B), (Bytes{3, 0, 0, 0, 0, 7})) << "no fix";
}

// ArduPilot takes the height from the receiver's position, also without a fix: from 0 it would climb for its life.
TEST(MipNavigation, AReceiverWithoutAFixReportsItsLastPlace) {
  for (const std::string model : {"3dm-gx5-45", "3dm-gq7"}) {
    const std::uint8_t set = model == "3dm-gq7" ? 0x91 : 0x81;
    Unit unit({{"model", model}});
    ASSERT_EQ(unit.code(command(0x0C, 0x0F, {1, set, 4, 0x03, 0, 1, 0x04, 0, 1, 0x05, 0, 1, 0x0B, 0, 1})), 0);
    const auto fields = [&](const Navigation& fix) {
      unit.sample = known();
      unit.sample.solution = Solution{.state = Solution::State::coasting, .receiver = fix};
      Bytes newest;
      for (const Bytes& packet : unit.run(1000))
        if (packet[2] == set) newest = packet;
      return newest;
    };
    const Bytes before = fields({}), fixed = fields(known().navigation), lost = fields({});
    ASSERT_FALSE(before.empty() || fixed.empty() || lost.empty());
    EXPECT_EQ(field(before, 0x03), Bytes(42)) << "there was none yet";
    EXPECT_EQ(number_at<std::uint16_t>(field(fixed, 0x03), 40), 0x1B);
    const Bytes place = field(lost, 0x03), ecef = field(lost, 0x04);
    EXPECT_DOUBLE_EQ(number_at<double>(place, 0), 40);
    EXPECT_DOUBLE_EQ(number_at<double>(place, 8), -105.25);
    EXPECT_DOUBLE_EQ(number_at<double>(place, 16), 1655);
    EXPECT_DOUBLE_EQ(number_at<double>(place, 24), 1655);
    EXPECT_EQ(number_at<std::uint16_t>(place, 40), 0) << "not valid";
    EXPECT_EQ(number_at<double>(ecef, 16), 4e6);
    EXPECT_EQ(number_at<std::uint16_t>(ecef, 28), 0);
    EXPECT_EQ(field(lost, 0x05), Bytes(34)) << "velocity";
    EXPECT_EQ(field(lost, 0x0B), (Bytes{3, 0, 0, 0, 0, 7}));
  }
}

// A place of 0, 0 would be one to ArduPilot, which does not look at the flags.
TEST(MipNavigation, AFilterThatAlignsReportsTheReceiversPlace) {
  for (const char* model : {"3dm-gx5-45", "3dm-cv7-ins", "3dm-gq7"}) {
    Sample sample = known();
    sample.solution = Solution{.receiver = sample.navigation};
    sample.navigation = {};
    const Bytes packet = sent(model, 0x82, {0x01, 0x02, 0x40}, sample);
    const Bytes position = field(packet, 0x01), velocity = field(packet, 0x02), ecef = field(packet, 0x40);
    EXPECT_DOUBLE_EQ(number_at<double>(position, 0), 40) << model;
    EXPECT_EQ(number_at<std::uint16_t>(position, 24), 0) << "not valid";
    EXPECT_EQ(number(velocity, 1), -40);
    EXPECT_EQ(number_at<std::uint16_t>(velocity, 12), 0);
    EXPECT_EQ(number_at<double>(ecef, 8), -4e6);
    EXPECT_EQ(number_at<std::uint16_t>(ecef, 24), 0);
  }
}

// The figures of the solution's own errors, in place of those of a unit under an open sky.
TEST(MipNavigation, AccuraciesAreThoseOfTheErrors) {
  OwnFigures figures;
  figures.position = {3, 4, 12};
  figures.velocity = {0.3, 0.4, 1.2};
  figures.attitude = units::degree * Vector3(1, 2, 2);
  const Bytes gnss = sent("3dm-gx5-45", 0x81, {0x03, 0x04, 0x05}, known(), figures);
  EXPECT_EQ(number_at<float>(field(gnss, 0x03), 32), 5.0F) << "horizontal";
  EXPECT_EQ(number_at<float>(field(gnss, 0x03), 36), 12.0F) << "vertical";
  EXPECT_EQ(number_at<float>(field(gnss, 0x04), 24), 13.0F);
  EXPECT_FLOAT_EQ(number(field(gnss, 0x05), 6), 1.3F) << "speed";
  EXPECT_NEAR(number(field(gnss, 0x05), 7), 0.572939, 1e-6) << "course at 50 m/s, deg";
  const Bytes filter = sent("3dm-gx5-45", 0x82, {0x08, 0x09, 0x0A, 0x12}, known(), figures);
  const auto three = [&](std::uint8_t descriptor) {
    const Bytes f = field(filter, descriptor);
    return Vector3(number(f, 0), number(f, 1), number(f, 2));
  };
  EXPECT_LT((three(0x08) - figures.position).norm(), 1e-6);
  EXPECT_LT((three(0x09) - figures.velocity).norm(), 1e-6);
  EXPECT_LT((three(0x0A) - figures.attitude).norm(), 1e-6);
  EXPECT_NEAR(number(field(filter, 0x12), 0), 0.5 * 3 * units::degree / std::sqrt(3.0), 1e-6);
  const Bytes lost = sent("3dm-gx5-45", 0x81, {0x03}, Sample(), figures);
  EXPECT_EQ(field(lost, 0x03), Bytes(42)) << "without a fix";
}

// GNSS data are configured, stopped and polled by the commands of the 5 series.
TEST(MipNavigation, TheReceiversStream) {
  Unit unit({{"model", std::string("3dm-gx5-45")}, {"gnss_fields", std::vector<std::string>{"gnss_fix"}}});
  const auto packets = [&] {
    const auto sent = unit.run(1000);
    return std::count_if(sent.begin(), sent.end(), [](const Bytes& packet) { return packet[2] == 0x81; });
  };
  EXPECT_EQ(packets(), 4);
  EXPECT_EQ(field(unit.send(command(0x0C, 0x07))[0], 0x84), (Bytes{0, 4}));
  EXPECT_EQ(unit.code(command(0x0C, 0x09, {1, 1, 0x0B, 0, 2})), 0);
  EXPECT_EQ(field(unit.send(command(0x0C, 0x09, {2}))[0], 0x81), (Bytes{1, 0x0B, 0, 2}));
  EXPECT_EQ(packets(), 2);
  EXPECT_EQ(unit.code(command(0x0C, 0x11, {1, 2, 0})), 0) << "off";
  EXPECT_EQ(packets(), 0);
  EXPECT_EQ(unit.send(command(0x0C, 0x02, {0, 1, 0x0B, 0, 0})).size(), 2U) << "but it can be polled";
}

TEST(MipNavigation, SettingsThatTheModelHasNot) {
  const Protocol& protocol = *find_protocol("mip");
  const auto refusal = [&](std::initializer_list<std::pair<const char*, const char*>> texts) -> std::string {
    Settings settings(protocol.settings);
    for (const auto& [key, text] : texts) settings.set_text(key, text);
    try {
      protocol.make(settings);
    } catch (const std::invalid_argument& fault) {
      return fault.what();
    }
    return "";
  };
  EXPECT_EQ(refusal({{"gnss_fields", "gnss_fix"}}), "gnss_fields: a 3DM-GX5-25 has none; leave it out");
  EXPECT_NE(refusal({{"filter_fields", "filter_position"}}).find("known: filter_quaternion"), std::string::npos);
  EXPECT_EQ(refusal({{"model", "3dm-cv7-ins"}, {"filter_fields", "filter_position"}}), "");
  EXPECT_EQ(refusal({{"model", "3dm-gx5-45"}, {"gnss_rate_hz", "3"}}), "gnss_rate_hz: give a divisor of 4");
}

TEST(MipNavigation, ProductHasMagnetometerAndBarometer) {
  const Product product = find_protocol("mip")->product(Settings(find_protocol("mip")->settings));
  EXPECT_DOUBLE_EQ(product.magnetometer.max, 8e-4);
  EXPECT_NEAR(product.magnetometer.walk_sqrt_cov(0, 0), 4e-8 * std::sqrt(1000.0), 1e-12);
  EXPECT_EQ(product.barometer.noise, 1);
}

}  // namespace
}  // namespace imud::mip_test
