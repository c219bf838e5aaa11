// The magnetic field against published values.
#include "core/magnetic_field.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/earth.hpp"
#include "core/units.hpp"
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

}  // namespace
}  // namespace imud
