// The magnetic field against published values of two models, and its bits.
#include "core/earth/magnetic_field.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/earth/earth.hpp"
#include "core/earth/igrf.hpp"
#include "core/gps_time.hpp"
#include "core/units.hpp"
#include "tests/core/earth/wmm2025.hpp"
#include "tests/core/hash.hpp"

namespace imud {
namespace {

constexpr std::int64_t in_2017 = 1'491'112'800;  // 2017-04-02T06:00:00Z, s since 1970
constexpr std::int64_t in_2026 = 1'782'993'600;  // 2026-07-02T12:00:00Z

Earth earth_at(double latitude_deg, double longitude_deg, double height, std::int64_t start = in_2026) {
  EarthModel model;
  model.frame = EarthModel::Frame::local;
  model.latitude = latitude_deg * units::degree;
  model.longitude = longitude_deg * units::degree;
  model.height = height;
  model.start_gps_ns = gps_ns_from_unix(start);
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

struct IgrfValue {
  double year, height_km, latitude_deg, longitude_deg, north, east, down;  // nT
};

// Computed with igrf_value() of pyIGRF 1.0.0 (zzyztyy/pyIGRF, 89d2f50), a translation of IAGA's igrf12syn with the
// coefficients of IGRF-14. Its ellipsoid's polar axis is 0.3 m shorter, which is 0.01 nT.
constexpr IgrfValue igrf_values[] = {
    {2017.25, 0, 90, 0, 1863.1, -49.0, 56672.1},
    {2017.25, 2.835, -90, 0, 14432.2, -8442.8, -52132.9},
    {2017.25, 0, 0, 0, 27544.0, -2452.5, -15890.1},
    {2017.25, 0.584, -35.363261, 149.16523, 23130.2, 5094.8, -53119.8},
    {2017.25, 0.5, 47, 11, 21646.8, 1102.2, 42815.7},
    {2017.25, -10, 64.8, -147.7, 12029.7, 3907.2, 55538.1},
    {2017.25, 12, -25, -50, 17153.7, -5938.9, -13291.8},
    {2017.25, 400, 30, 78, 27475.9, 467.7, 28910.5},
    {2017.25, 800, -60, 135, 2767.8, 327.0, -45410.8},
    {2017.25, 35786, 81, -110, 4.3, 7.5, 207.6},
    {2026.5, 0, 90, 0, 1711.2, 536.1, 56885.4},
    {2026.5, 2.835, -90, 0, 14281.0, -8831.8, -51533.8},
    {2026.5, 0, 0, 0, 27420.5, -1836.7, -15983.5},
    {2026.5, 0.584, -35.363261, 149.16523, 23010.4, 5172.9, -53054.5},
    {2026.5, 0.5, 47, 11, 21682.6, 1564.5, 43268.7},
    {2026.5, -10, 64.8, -147.7, 12370.7, 3289.3, 54923.9},
    {2026.5, 12, -25, -50, 16253.7, -5950.6, -14145.4},
    {2026.5, 400, 30, 78, 27520.9, 551.6, 29530.1},
    {2026.5, 800, -60, 135, 2665.9, 530.4, -45341.3},
    {2026.5, 35786, 81, -110, 5.1, 6.9, 206.9},
};

TEST(MagneticField, OfTheEarthIsThatOfIgrf14AtTheStart) {
  static_assert(std::size(igrf_values) == 20);
  EXPECT_EQ(decimal_year(gps_ns_from_unix(in_2017)), 2017.25);
  EXPECT_EQ(decimal_year(gps_ns_from_unix(in_2026)), 2026.5);
  for (const IgrfValue& value : igrf_values) {
    const Earth earth = earth_at(value.latitude_deg, value.longitude_deg, 1e3 * value.height_km,
                                 value.year == 2017.25 ? in_2017 : in_2026);
    const Vector3 field_nT = 1e9 * earth.magnetic_field_L(origin(earth));
    EXPECT_LT((field_nT - Vector3(value.north, value.east, value.down)).cwiseAbs().maxCoeff(), 0.1)
        << value.year << ' ' << value.latitude_deg;
  }
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

// Sums over the table of igrf14coeffs.txt, with weights of 20 degree + order, and 1/2 more for h: no number of any
// epoch can change unnoticed.
TEST(MagneticField, Igrf14HasThePublishedNumbersOfEachEpoch) {
  const auto sum = [](double year) {
    double all = 0;
    for (const GaussCoefficients& one : igrf14(year)) {
      const double weight = 20.0 * one.degree + one.order;
      all += weight * one.g + (one.order > 0 ? (weight + 0.5) * one.h : 0.0);
    }
    return all;
  };
  EXPECT_NEAR(sum(2000), -355548.55, 1e-3);
  EXPECT_NEAR(sum(2005), -369233.425, 1e-3);
  EXPECT_NEAR(sum(2010), -379909.85, 1e-3);
  EXPECT_NEAR(sum(2015), -391374.695, 1e-3);
  EXPECT_NEAR(sum(2020), -405435.04, 1e-3);
  EXPECT_NEAR(sum(2025), -422143.4, 1e-3);
  EXPECT_NEAR(sum(2026) - sum(2025), -3335.6, 1e-3);
}

// ArduPilot's simulated vehicles start at its field near Canberra (Tools/autotest/locations.txt, CMAC), where its own
// field model has a declination of 12.6 deg and 0.58 G.
TEST(MagneticField, HasArduPilotsDeclinationAtItsField) {
  const Earth earth = earth_at(-35.363261, 149.165230, 584);
  const Vector3 field_L = earth.magnetic_field_L(origin(earth));
  EXPECT_NEAR(std::atan2(field_L.y(), field_L.x()) / units::degree, 12.6, 0.2);
  EXPECT_NEAR(1e4 * field_L.norm(), 0.58, 0.005);
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
