#include "protocols/stim300/settings.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "core/units.hpp"

namespace imud::stim300 {
namespace {

template <std::size_t N>
unsigned index_of(const std::array<unsigned, N>& known, std::int64_t wanted, const char* what) {
  const auto at = std::find(known.begin(), known.end(), static_cast<unsigned>(wanted));
  if (at == known.end()) throw std::invalid_argument(what);
  return static_cast<unsigned>(at - known.begin());
}

unsigned word_of(std::span<const std::string_view> words, const std::string& word) {
  return static_cast<unsigned>(std::find(words.begin(), words.end(), word) - words.begin());
}

}  // namespace

Configuration configuration(const Settings& settings) {
  Configuration c;
  c.sample_rate = external_trigger;
  if (const std::int64_t rate = settings.integer("sample_rate"); rate != 0)
    c.sample_rate =
        index_of(sample_rates, rate, "sample_rate: give 125, 250, 500, 1000 or 2000, or 0: external trigger");
  c.content = (settings.flag("acceleration") ? 1U : 0U) | (settings.flag("inclination") ? 2U : 0U) |
              (settings.flag("temperature") ? 4U : 0U) | (settings.flag("pps") ? 8U : 0U);
  c.has_aux = settings.flag("aux_input");
  c.cr_lf = settings.flag("cr_lf");
  c.units = {word_of(gyro_units, settings.text("gyro_unit")),
             word_of(force_units, settings.text("accelerometer_unit")),
             word_of(force_units, settings.text("inclinometer_unit"))};
  const std::int64_t range = settings.integer("accelerometer_range_g");
  c.accelerometer_range = 15;
  for (const AccelerometerRange& known : accelerometer_ranges)
    if (known.g == range) c.accelerometer_range = known.code;
  if (c.accelerometer_range == 15) throw std::invalid_argument("accelerometer_range_g: give 5, 10, 30 or 80");
  c.bit_rate = index_of(bit_rates, settings.integer("bit_rate"), "bit_rate: give 374400, 460800, 921600 or 1843200");
  c.parity = static_cast<Parity>(word_of(parities, settings.text("parity")));
  c.stop_bits = static_cast<unsigned>(settings.integer("stop_bits"));
  return c;
}

void check(const Settings& settings) {
  if (!can_transmit(configuration(settings)))
    throw std::invalid_argument(
        "sample_rate: the line cannot carry as many datagrams of this content, so that the unit would send fewer; "
        "give a lower rate, less content, or a faster bit_rate");
}

// Angular random walk 0.15 deg/sqrt(h), velocity random walk 0.06 m/s/sqrt(h) (10 g; Table 5-3, 5-5). An
// accelerometer saturates at its overload limit; the datasheet states this for 80 g (Tables 5-4 to 5-7, note 1). An
// inclinometer measures beyond its overload limit, to the end of its format, as frames of real units show; its
// velocity random walk is 0.08 m/s/sqrt(h) at 0 g (Table 5-8).
Product product(const Settings& settings) {
  const auto white = [](double per_root_hour) { return per_root_hour / 60 * std::sqrt(internal_hz); };
  Product product;
  product.rate_hz = internal_hz;
  product.gyro.max = 480 * units::degree;
  product.gyro.walk_transition.setZero();
  product.gyro.walk_sqrt_cov = white(0.15 * units::degree) * Matrix3::Identity();
  product.accelerometer.max = range_of(configuration(settings)).overload_g * units::standard_gravity;
  product.accelerometer.walk_transition.setZero();
  product.accelerometer.walk_sqrt_cov = white(0.06) * Matrix3::Identity();
  TriadErrors& inclinometer = product.inclinometer.emplace();
  inclinometer.max = inclinometer_end_g * units::standard_gravity;
  inclinometer.walk_transition.setZero();
  inclinometer.walk_sqrt_cov = white(0.08) * Matrix3::Identity();
  return product;
}

}  // namespace imud::stim300
