#include "protocols/dronecan/gnss.hpp"

#include <chrono>
#include <limits>

#include "core/gps_time.hpp"
#include "core/units.hpp"
#include "protocols/measurements/receiver_accuracy.hpp"

namespace imud::dronecan {
namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

}  // namespace

PackedPayload<gnss_fix2_size> fix2_of(const Sample& sample, const OwnFigures& figures,
                                      std::uint64_t time_us) noexcept {
  // The definition counts leap seconds since 1972, 9 of them before 1980: UTC = GPS - number + 9.
  constexpr std::int64_t leaps_before_gps = 9;
  const Navigation& navigation = sample.fix();
  const bool is_fixed = navigation.is_known;
  const auto utc_us =
      std::chrono::floor<std::chrono::microseconds>(utc_from_gps(sample.fix_gps_ns())).time_since_epoch();
  PackedPayload<gnss_fix2_size> fix;
  fix.put(time_us, 56);
  fix.put(is_fixed ? static_cast<std::uint64_t>(utc_us.count()) : 0, 56);
  fix.put(is_fixed ? utc_gnss_time : no_gnss_time, 3);
  fix.put(0, 13);
  fix.put(is_fixed ? gps_leap_s + leaps_before_gps : 0, 8);
  fix.put_rounded(1e8 * navigation.longitude / units::degree, 37);
  fix.put_rounded(1e8 * navigation.latitude / units::degree, 37);
  fix.put_rounded(1e3 * navigation.height, 27);
  fix.put_rounded(1e3 * navigation.height, 27);
  for (int i = 0; i < 3; ++i) fix.put_float(navigation.v_L[i]);
  fix.put(is_fixed ? std::min<unsigned>(navigation.satellites, 63) : 0, 6);
  fix.put(is_fixed ? fix_3d : no_fix, 2);
  fix.put(0, 4);  // mode: single
  fix.put(0, 6);
  constexpr unsigned variances = 6;
  fix.put(variances, 6);
  const ReceiverAccuracy accuracy = receiver_accuracy(navigation, figures);
  for (const Vector3& deviation : {accuracy.position, accuracy.velocity})
    for (int i = 0; i < 3; ++i) fix.put_half(deviation[i] * deviation[i]);
  fix.put_half(is_fixed ? double{navigation.dilution.known_or(open_sky).position} : unknown);
  return fix;
}

PackedPayload<gnss_auxiliary_size> auxiliary_of(const Navigation& navigation) noexcept {
  PackedPayload<gnss_auxiliary_size> auxiliary;
  const Dilution& of = navigation.dilution.known_or(open_sky);
  for (const float dilution : {of.geometric, of.position, of.horizontal, of.vertical, of.time, of.north, of.east})
    auxiliary.put_half(navigation.is_known ? double{dilution} : unknown);
  const unsigned satellites = navigation.is_known ? navigation.satellites : 0;
  auxiliary.put(std::min(satellites, 127U), 7);
  auxiliary.put(std::min(satellites, 63U), 6);
  return auxiliary;
}

}  // namespace imud::dronecan
