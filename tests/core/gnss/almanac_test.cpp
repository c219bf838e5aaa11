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

}  // namespace
}  // namespace imud
