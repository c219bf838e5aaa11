#include "core/environment/vibration.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "core/numbers/dispatch.hpp"
#include "core/numbers/elementary.hpp"
#include "core/numbers/piecewise_linear.hpp"
#include "core/units.hpp"

namespace imud {
namespace {

// Returns the integral of the density from a to b, which lie between breakpoints: log-log linear between these, so
// that S = S_a (f/a)^m, and the integral of S is S_a a (r^(m + 1) - 1)/(m + 1) with r = b/a.
double power_within(std::span<const double> frequency, std::span<const double> density, std::size_t i, double a,
                    double b) noexcept {
  const double slope =
      elementary::log(density[i + 1] / density[i]) / elementary::log(frequency[i + 1] / frequency[i]);
  const double at_a = density[i] * elementary::exp(slope * elementary::log(a / frequency[i]));
  const double octaves = elementary::log(b / a);
  const double x = (slope + 1.0) * octaves;
  // (e^x - 1)/x, by its series where the difference would cancel.
  const double growth =
      std::abs(x) < 1e-3 ? 1.0 + x * (0.5 + x * (1.0 / 6.0 + x / 24.0)) : (elementary::exp(x) - 1.0) / x;
  return at_a * a * octaves * growth;
}

// Returns the power between two frequencies of the table.
double power(std::span<const double> frequency, std::span<const double> density, double from, double to) noexcept {
  double sum = 0;
  for (std::size_t i = 0; i + 1 < density.size(); ++i) {
    const double a = std::max(from, frequency[i]), b = std::min(to, frequency[i + 1]);
    if (a < b) sum += power_within(frequency, density, i, a, b);
  }
  return sum;
}

}  // namespace

Vibration::Vibration(const VibrationModel& model, const Normals& normals)
    : envelope_(model.envelope), has_harmonics_(!model.harmonics.empty()) {
  for (const VibrationModel::Harmonic& harmonic : model.harmonics) {
    Line added{
        .turns_per_ns = 0, .per_omega = 0, .order = harmonic.order, .phase = harmonic.phase / (2.0 * units::pi)};
    added.force_sin.add(lanes(harmonic.force));
    added.rate_sin.add(lanes(harmonic.rate));
    lines_.push_back(added);
  }
  for (const VibrationModel::Sine& sine : model.sines) {
    const auto [sin, cos] = elementary::sincos(sine.phase);
    Line& added = line(sine.frequency_hz);
    added.force_sin.add(lanes(cos * sine.force));
    added.force_cos.add(lanes(sin * sine.force));
    added.rate_sin.add(lanes(cos * sine.rate));
    added.rate_cos.add(lanes(sin * sine.rate));
  }
  if (model.spectrum.frequency_hz.size() > 1) add_spectrum(model.spectrum, normals);
}

// Returns the spectral line of that frequency. Adds the line if there is none.
Vibration::Line& Vibration::line(double frequency_hz) {
  const auto turns_per_ns = static_cast<std::uint64_t>(frequency_hz * (0x1p64 * 1e-9) + 0.5);
  const auto found = std::ranges::find_if(
      lines_, [turns_per_ns](const Line& one) { return one.order == 0 && one.turns_per_ns == turns_per_ns; });
  if (found != lines_.end()) return *found;
  const double omega = 2.0 * units::pi * 1e9 * 0x1p-64 * static_cast<double>(turns_per_ns);
  lines_.push_back({.turns_per_ns = turns_per_ns, .per_omega = 1.0 / omega});
  return lines_.back();
}

void Vibration::add_spectrum(const VibrationModel::Spectrum& spectrum, const Normals& normals) {
  const std::vector<double>& frequency = spectrum.frequency_hz;
  const double first = frequency.front(), last = frequency.back();
  const double width = elementary::log(last / first) / static_cast<double>(spectrum.lines);
  double begin = first;
  for (std::size_t j = 0; j < spectrum.lines; ++j) {
    const double end = j + 1 == spectrum.lines ? last : first * elementary::exp(width * static_cast<double>(j + 1));
    Line& added = line(std::sqrt(begin * end));
    const auto add = [&](const std::vector<double>& density, Quantity quantity, LaneVector& sin, LaneVector& cos) {
      const double amplitude = std::sqrt(2.0 * power(frequency, density, begin, end));
      // A point of the plane whose coordinates are independent and normal lies in a uniformly distributed direction.
      const Vector3 x = normals(quantity, Process::vibration, 2 * j),
                    y = normals(quantity, Process::vibration, 2 * j + 1);
      Vector3 scale;
      for (int i = 0; i < 3; ++i) scale[i] = amplitude * spectrum.axes[i] / std::sqrt(x[i] * x[i] + y[i] * y[i]);
      sin.add(lanes(scale.cwiseProduct(x)));
      cos.add(lanes(scale.cwiseProduct(y)));
    };
    add(spectrum.force, Quantity::specific_force, added.force_sin, added.force_cos);
    add(spectrum.rate, Quantity::rate, added.rate_sin, added.rate_cos);
    begin = end;
  }
}

void Vibration::follow(TruthTime time, std::optional<double> state, std::optional<double> rotor_speed) noexcept {
  rotor_hz_ = rotor_speed.value_or(0.0) / (2.0 * units::pi);
  if (envelope_.at.empty()) return;
  const double x = envelope_.of ? state.value_or(0.0) : 1e-9 * static_cast<double>(time.ns);
  factor_ = piecewise_linear(envelope_.at, envelope_.factor, x);
}

void Vibration::continue_from(const Vibration& before) noexcept {
  if (lines_.size() == before.lines_.size())
    for (std::size_t i = 0; i < lines_.size(); ++i)
      if (lines_[i].order == before.lines_[i].order) lines_[i].phase = before.lines_[i].phase;
  if (!envelope_.at.empty() && !before.envelope_.at.empty()) factor_ = last_factor_ = before.factor_;
  rotor_hz_ = before.rotor_hz_;
}

// Returns the phase of a spectral line at the end of a step of `dt` seconds, rad. Advances the phase of a rotor's
// harmonic.
double Vibration::angle_of(Line& line, TruthTime time, double dt) noexcept {
  if (line.order == 0) {
    const std::uint64_t turns = line.turns_per_ns * static_cast<std::uint64_t>(time.ns);
    return 2.0 * units::pi * 0x1p-64 * static_cast<double>(static_cast<std::int64_t>(turns));
  }
  const double hz = line.order * rotor_hz_;
  line.phase += hz * dt;
  line.phase -= std::floor(line.phase + 0.5);
  line.per_omega = hz != 0 ? 1.0 / (2.0 * units::pi * hz) : 0.0;
  return 2.0 * units::pi * line.phase;
}

IMUD_DISPATCHED void Vibration::add_to(const SensorInput& input, TruthTime time, double dt) noexcept {
  const double mean_factor = 0.5 * (factor_ + last_factor_);
  last_factor_ = factor_;
  Lanes rate = lanes(input.rate), specific_force = lanes(input.specific_force);
  Lanes delta_angle = lanes(input.delta_angle), delta_velocity = lanes(input.delta_velocity);
  for (std::size_t first = 0; first < lines_.size(); first += 4) {
    const std::size_t count = std::min<std::size_t>(4, lines_.size() - first);
    Lanes angles = {};
    for (std::size_t i = 0; i < count; ++i) angles[i] = angle_of(lines_[first + i], time, dt);
    const auto [sines, cosines] = elementary::sincos(angles);
    for (std::size_t i = 0; i < count; ++i) {
      Line& line = lines_[first + i];
      const double sin = sines[i], cos = cosines[i];
      const double now_sin = factor_ * sin, now_cos = factor_ * cos, per_omega = mean_factor * line.per_omega;
      rate += now_sin * line.rate_sin.lanes() + now_cos * line.rate_cos.lanes();
      specific_force += now_sin * line.force_sin.lanes() + now_cos * line.force_cos.lanes();
      double of_sin = (line.last_cos - cos) * per_omega;
      const double of_cos = (sin - line.last_sin) * per_omega;
      if (line.order > 0 && std::abs(line.order * rotor_hz_ * dt) < 1e-6) of_sin = now_sin * dt;  // it stands still
      delta_angle += of_sin * line.rate_sin.lanes() + of_cos * line.rate_cos.lanes();
      delta_velocity += of_sin * line.force_sin.lanes() + of_cos * line.force_cos.lanes();
      line.last_sin = sin;
      line.last_cos = cos;
    }
  }
  input.rate = vector_of(rate);
  input.specific_force = vector_of(specific_force);
  if (!(dt > 0.0)) return;
  input.delta_angle = vector_of(delta_angle);
  input.delta_velocity = vector_of(delta_velocity);
}

Vector3 Vibration::mean_square() const noexcept {
  Vector3 sum = Vector3::Zero();
  for (const Line& line : lines_)
    sum += 0.5 * (line.force_sin.vector().cwiseAbs2() + line.force_cos.vector().cwiseAbs2());
  return sum;
}

}  // namespace imud
