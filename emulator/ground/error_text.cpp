#include "emulator/ground/error_text.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>
#include <iterator>
#include <string_view>

#include "core/units.hpp"

namespace imud {
namespace {

constexpr double hour = 3600, root_hour = 60, deg = units::degree, mg = 1e-3 * units::standard_gravity;

constexpr AllanWords rows[] = {
    {'N', "random walk", &AllanTerms::N, {deg / root_hour, "deg/sqrt(h)"}, {1 / root_hour, "m/s/sqrt(h)"}},
    {'B', "bias instability", &AllanTerms::B, {deg / hour, "deg/h"}, {mg, "mg"}},
    {'K',
     "bias random walk",
     &AllanTerms::K,
     {deg / hour / root_hour, "deg/h/sqrt(h)"},
     {mg / root_hour, "mg/sqrt(h)"}},
    {'Q', "quantization noise", &AllanTerms::Q, {deg / hour, "arcsec"}, {1, "m/s"}},
    {'R', "bias ramp", &AllanTerms::R, {deg / hour / hour, "deg/h/h"}, {mg / hour, "mg/h"}}};
static_assert(std::size(rows) * sizeof(double) == sizeof(AllanTerms), "a term has no row");
constexpr const AllanWords& bias_instability = rows[1];

}  // namespace

std::span<const AllanWords> allan_words() noexcept { return rows; }

std::string TriadTerms::text() const {
  std::vector<std::string> parts;
  const auto add = [&](const std::string& name, const AllanUnit& unit, auto&& value) {
    const double x = value(axes[0]) / unit.si, y = value(axes[1]) / unit.si, z = value(axes[2]) / unit.si;
    if (x == 0 && y == 0 && z == 0) return;
    if (x == y && x == z)
      parts.push_back(fmt::format("{} {:.4g} {}", name, x, unit.name));
    else
      parts.push_back(fmt::format("{} [{:.4g}, {:.4g}, {:.4g}] {}", name, x, y, z, unit.name));
  };
  for (const AllanWords& term : rows)
    add(fmt::format("{} {}", term.name, term.letter), term.*units, std::mem_fn(term.value));
  if (std::ranges::any_of(axes, [](const AllanTerms& axis) { return axis.B > 0; }))
    add("minimum", bias_instability.*units, std::mem_fn(&AllanTerms::minimum));
  return fmt::format("{}", fmt::join(parts, ", "));
}

std::string TriadTerms::bias_text() const {
  const AllanUnit& B = bias_instability.*units;
  std::vector<std::string> parts;
  if (!turn_on_bias.isZero(0.0))
    parts.push_back(fmt::format("turn-on bias {:.4g} {}", turn_on_bias.maxCoeff() / B.si, B.name));
  const double per_g = g_sensitivity.cwiseAbs().maxCoeff() * units::standard_gravity / B.si;
  if (per_g > 0) parts.push_back(fmt::format("{:.4g} {}/g by acceleration", per_g, B.name));
  const auto add_drawn = [&](std::string_view when, const ConstantErrors& sigma) {
    std::vector<std::string> drawn;
    const auto add = [&](std::string_view name, double largest, double unit, std::string_view unit_name) {
      if (largest > 0) drawn.push_back(fmt::format("{} {:.4g}{}", name, largest / unit, unit_name));
    };
    add("bias", sigma.bias.maxCoeff(), B.si, fmt::format(" {}", B.name));
    add("scale factor", sigma.scale_factor.maxCoeff(), 1e-6, " ppm");
    add("asymmetry", sigma.scale_factor_asymmetry.maxCoeff(), 1e-6, " ppm");
    if (!sigma.quadratic.isZero(0.0) || !sigma.cubic.isZero(0.0)) drawn.emplace_back("nonlinearity");
    add("misalignment", sigma.misalignment.maxCoeff(), 1e-3, " mrad");
    add("sensitivity", sigma.g_sensitivity.maxCoeff(), B.si / units::standard_gravity, fmt::format(" {}/g", B.name));
    if (!(sigma.temperature_bias.isZero(0.0) && sigma.temperature_scale.isZero(0.0) &&
          sigma.temperature_rate_bias.isZero(0.0) && sigma.temperature_hysteresis.isZero(0.0)))
      drawn.emplace_back("response to temperature");
    if (!sigma.cross_sensitivity.isZero(0.0)) drawn.emplace_back("response to products of accelerations");
    if (!sigma.vibration_rectification.isZero(0.0)) drawn.emplace_back("response to vibration");
    if (!drawn.empty()) parts.push_back(fmt::format("drawn {}: {}", when, fmt::join(drawn, ", ")));
  };
  add_drawn("for the unit", unit_sigma);
  add_drawn("at power on", turn_on_sigma);
  return fmt::format("{}", fmt::join(parts, ", "));
}

std::vector<TriadTerms> triad_terms(const ImuModel& model) {
  const double rate_hz = model.rate_hz * model.internal_samples;
  const auto terms = [rate_hz](const char* name, const TriadErrors& errors, AllanUnit AllanWords::*units) {
    return TriadTerms{name,
                      allan_terms(errors, rate_hz),
                      units,
                      errors.turn_on_bias,
                      errors.g_sensitivity,
                      errors.unit_sigma,
                      errors.turn_on_sigma};
  };
  std::vector<TriadTerms> all = {terms("gyro", model.gyro, &AllanWords::gyro),
                                 terms("accelerometer", model.accelerometer, &AllanWords::accelerometer)};
  if (model.inclinometer) all.push_back(terms("inclinometer", *model.inclinometer, &AllanWords::accelerometer));
  return all;
}

namespace {
std::string of_axes(const std::array<double, 3>& values) {
  const auto& [x, y, z] = values;
  return x == y && x == z ? fmt::format("{:.4g}", x) : fmt::format("[{:.4g}, {:.4g}, {:.4g}]", x, y, z);
}
}  // namespace

double TriadFilter::delay_s(int axis) const {
  return group_delay_s(filter, axis, rate_hz) + (taps ? group_delay_s(*taps, rate_hz) : 0);
}

std::string TriadFilter::text() const {
  std::vector<std::string> kinds;
  if (taps) kinds.push_back(fmt::format("{} taps", taps->size()));
  const Vector3& cut_off = filter.cut_off_hz;
  if (filter.stages > 1)
    kinds.push_back(fmt::format("CIC of order {} and length {}", filter.stages, filter.length));
  else if (filter.length > 1)
    kinds.push_back(fmt::format("mean of {} samples", filter.length));
  else if (filter.is_on())
    kinds.push_back(fmt::format("low-pass of order {}{} at {} Hz", filter.order,
                                filter.damping > 0 ? fmt::format(" and damping {:.4g}", filter.damping) : "",
                                of_axes({cut_off[0], cut_off[1], cut_off[2]})));
  if (kinds.empty()) return "none";
  return fmt::format("{}, group delay {} ms", fmt::join(kinds, ", then "),
                     of_axes({1e3 * delay_s(0), 1e3 * delay_s(1), 1e3 * delay_s(2)}));
}

std::vector<TriadFilter> triad_filters(const ImuModel& model) {
  const double rate_hz = model.rate_hz * model.internal_samples;
  std::vector<TriadFilter> all = {
      {"gyro", model.gyro.filter, model.gyro.fir_taps, rate_hz},
      {"accelerometer", model.accelerometer.filter, model.accelerometer.fir_taps, rate_hz},
      {"magnetometer", model.magnetometer.filter, model.magnetometer.fir_taps, model.rate_hz}};
  if (model.inclinometer)
    all.push_back({"inclinometer", model.inclinometer->filter, model.inclinometer->fir_taps, rate_hz});
  return all;
}

}  // namespace imud
