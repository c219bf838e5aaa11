#include "tools/allan/preset_text.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "tools/text_output.hpp"

namespace imud {
namespace {

// Returns the line of a term; a comment if no axis has it.
std::string term_line(const std::array<const AllanReport::Axis*, channels_per_sensor>& axes, std::size_t t,
                      bool is_rate) {
  const TermUnit& unit = term_units(is_rate)[t];
  std::array<std::string, channels_per_sensor> values, errors;
  double largest = 0, least_seen = 0;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    values[i] = "0";
    errors[i] = "not seen";
    if (axes[i] == nullptr) continue;
    const AllanFit::Term& term = axes[i]->fit.terms[t];
    least_seen = std::max(least_seen, unit.factor * term.least_seen);
    if (!term.value) continue;
    largest = std::max(largest, *term.value);
    values[i] = fmt::format("{:.4g}", unit.factor * *term.value);
    errors[i] = fmt::format("{:.2g}", unit.factor * term.error);
  }
  if (largest == 0) {
    if (!std::isfinite(least_seen)) return fmt::format("# {}: not seen\n", unit.name);
    return fmt::format("# {}: not seen; from {:.3g} {} on it would be\n", unit.name, least_seen, unit.datasheet);
  }
  const std::string comment = fmt::format("# +- {}", fmt::join(errors, ", "));
  if (allan_term_list[t].letter != 'Q')
    return fmt::format("{} = [{}]  {}\n", unit.key, fmt::join(values, ", "), comment);
  // Quantization of the increments. All axes have the same LSB.
  return fmt::format("{} = {:.4g}  # the largest; quantization of {} {}\n",
                     is_rate ? "lsb_delta_angle_rad" : "lsb_delta_velocity_m_per_s", std::sqrt(12.0) * largest,
                     fmt::join(values, ", "), unit.datasheet);
}

// Returns the preset's lines with the averaging times between which imud's flicker is to be flat, if these are
// beyond imud's own range from 1 s to 1000 s. The first is the time at which white noise is ten times as large in
// each axis, or at which flicker begins; the last is the longest averaging time of the recording.
std::string flat_lines(const std::array<const AllanReport::Axis*, channels_per_sensor>& axes) {
  double from_s = 1, to_s = 1000;
  for (const AllanReport::Axis* axis : axes) {
    if (axis == nullptr) continue;
    const AllanTerms terms = axis->fit.seen();
    if (terms.B == 0) continue;
    constexpr double least_periods = 10;
    const double white = std::pow(terms.N / terms.B, 2) / (2 * std::numbers::ln2 / std::numbers::pi);
    from_s =
        std::min(from_s, std::max({white / 100, least_periods * axis->curve.period_s, axis->fit.flicker_from_s}));
    to_s = std::max(to_s, axis->curve.points.back().tau_s);
  }
  std::string text;
  if (from_s < 1) text += fmt::format("bias_instability_from_s = {:.4g}\n", from_s);
  if (to_s > 1000) text += fmt::format("bias_instability_to_s = {:.4g}\n", to_s);
  return text;
}

std::string sensor_text(const AllanReport& report, bool is_rate) {
  std::string text =
      fmt::format("\n[imu.{}]\n{} = 1e6  # a recording at rest does not show the range: give the data sheet's\n",
                  is_rate ? "gyro" : "accelerometer", is_rate ? "max_deg_per_s" : "max_g");
  std::array<const AllanReport::Axis*, channels_per_sensor> axes{};
  double misfit = 0;
  for (const AllanReport::Axis& axis : report.axes)
    if (axis.is_rate() == is_rate) {
      axes[axis.number % channels_per_sensor] = &axis;
      misfit = std::max(misfit, axis.fit.misfit);
    }
  if (std::ranges::count(axes, nullptr) == std::ssize(axes)) return text + "# was not recorded\n";
  if (misfit > 0)
    text += fmt::format("# the terms explain the variance only to {:.1f} %, as after a filter or with vibration\n",
                        100 * misfit);
  for (std::size_t t = 0; t < allan_term_count; ++t) text += term_line(axes, t, is_rate);
  return text + flat_lines(axes);
}

}  // namespace

std::string preset_text(const AllanReport& report) {
  return fmt::format("# {} at {}, by a recording at rest\n# imu-allan, {} deviation of {} samples in {:.1f} s\n",
                     on_one_line(report.protocol), on_one_line(report.port),
                     report.axes.empty() ? "" : name_of(report.axes.front().curve.kind), report.samples,
                     static_cast<double>(report.samples) / report.recording.rate_hz) +
         sensor_text(report, true) + sensor_text(report, false);
}

}  // namespace imud
