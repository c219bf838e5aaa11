// Sky: the satellites that a receiver sees, by an almanac, and what their geometry makes of its errors.
#pragma once

#include <cstdint>
#include <vector>

#include "core/gnss/almanac.hpp"
#include "core/numbers/random.hpp"
#include "core/sample.hpp"
#include "core/units.hpp"

namespace imud {

// The sky and the search of a GNSS receiver. The default of every member switches its effect off.
struct GnssModel {
  // Empty: the number of satellites is Navigation's, whatever place and time. The orbits of a satellite, one after
  // the other, hold each where it is the nearest in time.
  std::vector<AlmanacOrbit> almanac;
  double mask = 5 * units::degree;  // rad, 0 to below pi/2: the lowest elevation of a satellite that is used
  // The errors of ranges by reflections: m, standard deviation at the horizon, not negative. It falls with the
  // elevation E as exp(-E/10 deg). Each satellite has a constant one for `multipath_s`, above 0.
  double multipath = 0, multipath_s = 30;
  double first_fix_s = 0;  // from power on, under an open sky, to the first fix; not negative
  double reacquire_s = 0;  // from the end of an outage to the next fix; not negative
  // The dilution of position for which the accuracies of a receiver hold: Navigation::accuracy_factor is 1 there.
  static constexpr double nominal_dilution = double{open_sky.position};
};

// Elevations and dilutions follow from straight lines to where the satellites are at the begin of the second of the
// GPS time: neither the travel of the signal nor refraction counts. The dilutions are the roots of the diagonal of
// (H'H)^-1, the rows of H being the directions from the satellites and 1 (as dops() of RTKLIB 71db0ff, src/rtkcmn.c).
// Reflections displace the place by the least squares of the ranges' errors b, (H'H)^-1 H' b: in steps, as these
// change and as satellites cross the mask. Their decrease with the elevation is RTCA DO-229D's for aircraft, as in
// MAAST of Stanford's GPS laboratory (init_cnmp_mops.m).
//
// The results depend only on place, time and seed, and have the same bits on every machine. Nothing here allocates
// after construction, locks or throws; not thread-safe.
class Sky {
 public:
  explicit Sky(const GnssModel& model);

  // Returns whether there is an almanac.
  bool is_on() const noexcept { return !orbits_.empty(); }
  // Writes the satellites, the dilutions and the factor of the accuracy to a known place. Returns false, and leaves
  // `navigation` unchanged, if fewer than four satellites are seen, or all in one cone.
  bool look(Navigation& navigation) noexcept;
  // Returns the displacement, by reflections, of the place of the last look() that returned true: m, north, east,
  // down.
  Vector3 displacement(const Normals& normals) const noexcept;

 private:
  struct Placed {
    int prn;
    Vector3 r_E;  // m
  };
  struct Seen {
    int prn;
    Vector3 line_L;  // unit, to the satellite
  };
  struct Root {  // the lower triangle L of L L' = H'H
    double at[4][4];
  };

  // Writes where the healthy satellites are.
  void place_satellites(std::int64_t gps_ns) noexcept;

  std::vector<AlmanacOrbit> orbits_;
  double sine_of_mask_, multipath_;
  std::int64_t multipath_ns_;
  std::int64_t second_ = -1;        // of satellites_
  std::vector<Placed> satellites_;  // the healthy ones
  std::vector<Seen> seen_;          // at the last look()
  Root root_ = {};
  std::int64_t gps_ns_ = 0;
};

}  // namespace imud
