// The satellites of an almanac that a receiver sees, and the dilutions of precision that follow.
#include "core/gnss/sky.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <set>
#include <vector>

#include "core/earth/earth.hpp"
#include "tests/core/gnss/constellation.hpp"
#include "tests/support/allocations.hpp"

namespace imud {
namespace {

std::int64_t constellation_after(double time_s) { return constellation_ns + static_cast<std::int64_t>(1e9 * time_s); }

Navigation place_under_sky(double latitude_deg, double longitude_deg, double height, double time_s) {
  Navigation place;
  place.is_known = true;
  place.latitude = units::degree * latitude_deg;
  place.longitude = units::degree * longitude_deg;
  place.height = height;
  place.r_E = r_E_of({place.latitude, place.longitude, height});
  place.gps_ns = constellation_after(time_s);
  return place;
}

GnssModel model_with_mask(double mask_deg) {
  GnssModel model;
  model.almanac = constellation();
  model.mask = units::degree * mask_deg;
  return model;
}

// By NumPy: the inverse of H'H.
TEST(Sky, DilutionsAreThoseOfAnotherImplementation) {
  struct Known {
    double latitude_deg, longitude_deg, height, mask_deg, time_s;
    int satellites;
    double of[7];  // geometric, position, horizontal, vertical, time, north, east
  };
  const Known all[] = {
      {45, 0, 100, 5, 0, 9, {2.392847, 2.212081, 0.870619, 2.033549, 0.912370, 0.727929, 0.477596}},
      {-33.9, 151.2, 50, 5, 20000, 7, {2.278457, 2.040061, 1.510775, 1.370916, 1.014650, 1.369034, 0.638894}},
      {78, 15, 0, 15, 7000, 8, {3.451967, 3.040805, 1.478261, 2.657299, 1.633887, 1.324356, 0.656763}}};
  for (const Known& known : all) {
    SCOPED_TRACE(known.latitude_deg);
    Sky sky(model_with_mask(known.mask_deg));
    Navigation place = place_under_sky(known.latitude_deg, known.longitude_deg, known.height, known.time_s);
    const std::uint64_t allocated = allocations();
    ASSERT_TRUE(sky.look(place));
    EXPECT_EQ(allocations(), allocated);
    EXPECT_EQ(place.satellites, known.satellites);
    const Dilution& of = place.dilution;
    const float dilutions[] = {of.geometric, of.position, of.horizontal, of.vertical, of.time, of.north, of.east};
    for (int i = 0; i < 7; ++i) EXPECT_NEAR(dilutions[i], known.of[i], 2e-6 * known.of[i]) << i;
    EXPECT_NEAR(place.accuracy_factor, known.of[1] / 1.44, 1e-5);
  }
}

// Three satellites are above 40 degrees there.
TEST(Sky, ThreeSatellitesAreNoFix) {
  Sky sky(model_with_mask(40));
  Navigation place = place_under_sky(0, 0, 0, 3600);
  EXPECT_FALSE(sky.look(place));
  EXPECT_EQ(place.satellites, 12);
  EXPECT_EQ(place.accuracy_factor, 1);
  EXPECT_FLOAT_EQ(place.dilution.position, 0);
}

// The number of satellites is one of time alone: of a sky that has seen other times, too.
TEST(Sky, HasNoMemory) {
  GnssModel model = model_with_mask(5);
  model.multipath = 10;
  Sky one(model), other(model);
  const Normals normals(3, 1);
  for (const double time_s : {0.0, 5000.25, 5000.75, 100.0, 5000.75}) {
    Navigation place = place_under_sky(45, 0, 100, time_s), same = place_under_sky(45, 0, 100, 5000.75);
    ASSERT_TRUE(one.look(place) && other.look(same));
    if (time_s != 5000.75) continue;
    EXPECT_EQ(place.dilution.position, same.dilution.position);
    EXPECT_EQ(one.displacement(normals), other.displacement(normals));
  }
}

// The orbit that is nearest in time holds if a satellite has several. It hides the satellite if it is not healthy.
TEST(Sky, TheNearestOrbitHolds) {
  constexpr std::int64_t hours_2 = 7'200'000'000'000;
  GnssModel model = model_with_mask(5), of_two = model;
  of_two.almanac.clear();
  for (const AlmanacOrbit& orbit : model.almanac) {
    AlmanacOrbit later = orbit;
    later.reference_ns += hours_2;
    later.mean_anomaly += 1;
    later.is_healthy = orbit.prn % 2 == 0;
    of_two.almanac.push_back(orbit);
    of_two.almanac.push_back(later);
  }
  GnssModel of_later = model;
  of_later.almanac.clear();
  for (const AlmanacOrbit& orbit : of_two.almanac)
    if (orbit.reference_ns != constellation_ns && orbit.is_healthy) of_later.almanac.push_back(orbit);
  Sky sky(of_two), first(model), later(of_later);
  for (const double time_s : {0.0, 3599.0, 3601.0, 9000.0}) {
    Navigation place = place_under_sky(45, 0, 100, time_s), same = place;
    ASSERT_TRUE(sky.look(place) && (time_s < 3600 ? first : later).look(same)) << time_s;
    EXPECT_EQ(place.satellites, same.satellites);
    EXPECT_EQ(place.dilution.geometric, same.dilution.geometric);
  }
}

// Reflections: steps, each as one satellite's error changes; the more of the horizon is seen, the larger. The
// standard deviation of each component is within 15 % of the one by the geometry (400 draws are 3.5 % each).
TEST(Sky, ReflectionsDisplaceInSteps) {
  const auto deviation = [](double mask_deg, std::set<double>* values = nullptr) {
    GnssModel model = model_with_mask(mask_deg);
    model.multipath = 5;
    double sum2 = 0;
    int count = 0;
    for (std::uint64_t seed = 1; seed <= 400; ++seed) {
      Sky sky(model);
      Navigation place = place_under_sky(45, 0, 100, 0);
      if (!sky.look(place)) return 0.0;
      sum2 += sky.displacement(Normals(seed, 1)).squaredNorm();
      ++count;
    }
    Sky sky(model);
    for (double time_s = 0; values != nullptr && time_s < 30; time_s += 0.1) {
      Navigation place = place_under_sky(45, 0, 100, 0);
      place.gps_ns = constellation_after(0) + static_cast<std::int64_t>(1e8 * std::floor(time_s * 10 + 0.5));
      if (sky.look(place)) values->insert(std::floor(100 * sky.displacement(Normals(1, 1)).x() + 0.5));
    }
    return std::sqrt(sum2 / count);
  };
  std::set<double> values;
  // By NumPy: the root of the trace of (H'H)^-1 H' S H (H'H)^-1.
  EXPECT_NEAR(deviation(5, &values), 1.438, 0.15 * 1.438);
  EXPECT_NEAR(deviation(14, nullptr), 1.545, 0.15 * 1.545);
  // Nine satellites change once in 30 s; they move by centimetres meanwhile.
  EXPECT_GE(values.size(), 6U);
  EXPECT_LE(values.size(), 40U);
}

}  // namespace
}  // namespace imud
