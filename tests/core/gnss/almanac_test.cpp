// Where the satellites of an almanac are.
#include "core/gnss/almanac.hpp"

#include <gtest/gtest.h>

#include "tests/core/gnss/constellation.hpp"

namespace imud {
namespace {

// By NumPy, which rotates the perifocal vector by matrices and solves Kepler's equation by Newton's method; alm2pos()
// of RTKLIB 71db0ff gives the same to 0.1 mm.
TEST(Almanac, PositionsAreThoseOfOtherImplementations) {
  struct Known {
    int prn;
    double time_s;
    Vector3 r_E;
  };
  const Known all[] = {{1, 0, {16379667.4531, -17806118.7857, 11446046.7172}},
                       {1, 43200, {-16335747.9140, 17627522.1532, 11778147.0059}},
                       {7, -100000, {-10378001.6252, -22971475.9991, -8250366.7945}},
                       {24, 2592000, {-1686808.5535, -16481699.7405, 20928696.9640}}};
  for (const Known& known : all)
    EXPECT_LT((satellite_E(orbit_of(known.prn), constellation_ns + static_cast<std::int64_t>(1e9 * known.time_s)) -
               known.r_E)
                  .norm(),
              1e-3)
        << known.prn << ' ' << known.time_s;
}

// An ephemeris of 2010-07-01, of test/data/rinex/brdc1820.10n of RTKLIB 71db0ff, whose eph2pos() gives the same to
// 0.1 mm.
TEST(Almanac, AnEphemerisHasHarmonicTerms) {
  const AlmanacOrbit orbit = {.prn = 2,
                              .reference_ns = 1590 * gps_week_ns + 345'600'000'000'000,
                              .eccentricity = 0.960697804112e-02,
                              .inclination = 0.939349150611,
                              .node_rate = -0.838784952606e-08,
                              .root_axis = 0.515359739113e+04,
                              .node = -0.127458719764e+01,
                              .perigee = 0.309739903949e+01,
                              .mean_anomaly = 0.165772167412e+01,
                              .motion = 0.525557597442e-08,
                              .inclination_rate = -0.232152526369e-10,
                              .of_latitude = {0.232271850109e-05, 0.617466866970e-05},
                              .of_radius = {0.249937500000e+03, 0.414375000000e+02},
                              .of_inclination = {-0.558793544769e-08, 0.167638063431e-06}};
  const auto at = [&orbit](std::int64_t after_s) {
    return satellite_E(orbit, orbit.reference_ns + after_s * 1'000'000'000);
  };
  constexpr double rounding = 1e-3;
  EXPECT_LT((at(0) - Vector3(-14889160.5615, -5131952.9655, -21416801.5943)).norm(), rounding);
  EXPECT_LT((at(3600) - Vector3(-13666506.8459, -14242200.4258, -17991254.0044)).norm(), rounding);
  EXPECT_LT((at(-7200) - Vector3(-21289271.2414, 10372904.8250, -11556186.6902)).norm(), rounding);
}

}  // namespace
}  // namespace imud
