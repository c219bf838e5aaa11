// The magnetic field against published values of two models, and its bits.
#include "core/magnetic_field.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/earth.hpp"
#include "core/igrf.hpp"
#include "core/units.hpp"
#include "tests/core/hash.hpp"
#include "tests/core/wmm2025.hpp"

namespace imud {
namespace {

Earth earth_at(double latitude_deg, double longitude_deg, double height) {
  EarthModel model;
  model.frame = EarthModel::Frame::local;
  model.latitude = latitude_deg * units::degree;
  model.longitude = longitude_deg * units::degree;
  model.height = height;
  return Earth(model);
}
Navigation origin(const Earth& earth) { return earth.navigation({true, {}, Vector3::Zero(), Vector3::Zero()}); }

MagneticField wmm2025_at(double year) {
  std::vector<GaussCoefficients> all;
  for (const WmmLine& line : wmm2025)
    all.push_back({line.degree, line.order, line.g + (year - 2025.0) * line.yearly_g,
                   line.h + (year - 2025.0) * line.yearly_h});
  return MagneticField(all);
}

// Returns the largest difference of a component, nT.
double difference(const WmmTestValue& value) {
  const Navigation there = origin(earth_at(value.latitude_deg, value.longitude_deg, 1e3 * value.height_km));
  const Vector3 field_L = dcm_EL(there.latitude, there.longitude).transpose() * wmm2025_at(value.year).at(there.r_E);
  return (1e9 * field_L - Vector3(value.north, value.east, value.down)).cwiseAbs().maxCoeff();
}

TEST(MagneticField, GivesTheTestValuesOfTheWorldMagneticModel) {
  static_assert(std::size(wmm2025) == 90 && std::size(wmm2025_report) == 12 && std::size(wmm2025_software) == 100);
  for (const WmmTestValue& value : wmm2025_report)
    EXPECT_LT(difference(value), 0.0505) << value.year << ' ' << value.latitude_deg;
  for (const WmmTestValue& value : wmm2025_software)
    EXPECT_LT(difference(value), 0.001) << value.year << ' ' << value.latitude_deg;
}

// The coefficients of each epoch are the table's; between two epochs, and after the last, they change linearly.
TEST(MagneticField, Igrf14IsLinearBetweenItsEpochs) {
  const auto g10 = [](double year) { return igrf14(year).front().g; };
  EXPECT_EQ(igrf14(2020).size(), 104U);
  EXPECT_EQ(g10(2000), -29619.4);
  EXPECT_EQ(g10(2015), -29441.46);
  EXPECT_EQ(g10(2020), -29403.41);
  EXPECT_EQ(g10(2025), -29350.0);
  EXPECT_NEAR(g10(2002), -29619.4 + 2 * (-29554.63 + 29619.4) / 5, 1e-9);
  EXPECT_NEAR(g10(2024.5), -29403.41 + 4.5 * (-29350.0 + 29403.41) / 5, 1e-9);
  EXPECT_NEAR(g10(igrf14_end), -29350.0 + 5 * 12.6, 1e-9);
  EXPECT_NEAR(g10(2035), -29350.0 + 10 * 12.6, 1e-9) << "extrapolated";
  EXPECT_NEAR(g10(1999), -29619.4 - (-29554.63 + 29619.4) / 5, 1e-9) << "extrapolated";
  EXPECT_EQ(igrf14(2025).back().degree, 13);
  EXPECT_EQ(igrf14(2025).back().order, 13);
  EXPECT_EQ(igrf14(2025).back().g, -0.4);
  EXPECT_EQ(igrf14(2025).back().h, -0.5);
}

// The gradient of the field is some 0.02 nT/m at most: no component leaps at the axis of rotation.
TEST(MagneticField, IsSmoothAtThePoles) {
  const MagneticField field(igrf14(2025));
  for (const double z : {6.3568e6, -6.3568e6, 7e6, -4.2e7}) {
    const Vector3 pole = 1e9 * field.at({0, 0, z});
    EXPECT_TRUE(pole.allFinite());
    EXPECT_GT(pole.norm(), 100);
    for (const Vector3& aside : {Vector3(1, 0, z), Vector3(-1, 0, z), Vector3(0, 1, z), Vector3(0, -1, z)})
      EXPECT_LT((1e9 * field.at(aside) - pole).norm(), 0.05);
  }
}

// The same bits on every machine: any compiler, any level of optimisation, any processor.
TEST(MagneticField, PinnedBits) {
  Hash hash;
  for (const double year : {2000.0, 2017.25, 2026.5}) {
    const MagneticField field(igrf14(year));
    for (int i = 0; i < 1000; ++i) hash.add(field.at({6.4e6 - 3333.0 * i, 17'777.0 * i - 9e6, 5e6 - 12'345.0 * i}));
  }
  EXPECT_EQ(hash.value(), 5272239287940743443U);
}

}  // namespace
}  // namespace imud
