#include "core/effects/drawn_errors.hpp"

namespace imud {
namespace {

// The first number of a term's draws. The values never change and are never reused, as the values of Process.
enum class Draw : std::uint64_t {
  bias = 0,
  scale_factor = 1,
  scale_factor_asymmetry = 2,
  quadratic = 3,
  cubic = 4,
  misalignment = 5,        // of each column
  g_sensitivity = 8,       // of each column
  temperature_scale = 11,  // of each degree
  temperature_bias = 14,   // of each degree
  temperature_rate_bias = 17,
  temperature_hysteresis = 18,
  cross_sensitivity = 19,        // of each column
  vibration_rectification = 22,  // of each column
  // 25 of the magnetic field is drawn_current_field()
};
constexpr std::uint64_t draws_of_a_power_on = 32;

// The deviates of one layer for one power on.
struct Draws {
  const Normals& normals;
  Quantity quantity;
  Process process;
  std::uint64_t first = 0;

  Vector3 of(Draw draw, const Vector3& sigma, std::uint64_t column = 0) const noexcept {
    if (sigma.isZero(0.0)) return Vector3::Zero();
    return sigma.cwiseProduct(normals(quantity, process, first + static_cast<std::uint64_t>(draw) + column));
  }
  Matrix3 of(Draw draw, const Matrix3& sigma) const noexcept {
    Matrix3 drawn;
    for (int j = 0; j < 3; ++j) drawn.col(j) = of(draw, Vector3(sigma.col(j)), static_cast<std::uint64_t>(j));
    return drawn;
  }
  ConstantErrors all(const ConstantErrors& sigma) const noexcept {
    return {.bias = of(Draw::bias, sigma.bias),
            .scale_factor = of(Draw::scale_factor, sigma.scale_factor),
            .scale_factor_asymmetry = of(Draw::scale_factor_asymmetry, sigma.scale_factor_asymmetry),
            .quadratic = of(Draw::quadratic, sigma.quadratic),
            .cubic = of(Draw::cubic, sigma.cubic),
            .misalignment = of(Draw::misalignment, sigma.misalignment),
            .g_sensitivity = of(Draw::g_sensitivity, sigma.g_sensitivity),
            .temperature_scale = of(Draw::temperature_scale, sigma.temperature_scale),
            .temperature_bias = of(Draw::temperature_bias, sigma.temperature_bias),
            .temperature_rate_bias = of(Draw::temperature_rate_bias, sigma.temperature_rate_bias),
            .temperature_hysteresis = of(Draw::temperature_hysteresis, sigma.temperature_hysteresis),
            .cross_sensitivity = of(Draw::cross_sensitivity, sigma.cross_sensitivity),
            .vibration_rectification = of(Draw::vibration_rectification, sigma.vibration_rectification)};
  }
};

void add(const ConstantErrors& drawn, TriadErrors& errors) noexcept {
  errors.bias += drawn.bias;
  errors.scale_factor += drawn.scale_factor;
  errors.scale_factor_asymmetry += drawn.scale_factor_asymmetry;
  errors.quadratic += drawn.quadratic;
  errors.cubic += drawn.cubic;
  errors.misalignment += drawn.misalignment;
  errors.g_sensitivity += drawn.g_sensitivity;
  errors.temperature_scale += drawn.temperature_scale;
  errors.temperature_bias += drawn.temperature_bias;
  errors.temperature_rate_bias += drawn.temperature_rate_bias;
  errors.temperature_hysteresis += drawn.temperature_hysteresis;
  errors.cross_sensitivity += drawn.cross_sensitivity;
  errors.vibration_rectification += drawn.vibration_rectification;
}

}  // namespace

ConstantErrors drawn_for_unit(const TriadErrors& errors, Quantity quantity, const Normals& normals) noexcept {
  return Draws{normals, quantity, Process::unit_draw}.all(errors.unit_sigma);
}

ConstantErrors drawn_at_power_on(const TriadErrors& errors, Quantity quantity, const Normals& normals,
                                 std::uint64_t number) noexcept {
  return Draws{normals, quantity, Process::turn_on_draw, number * draws_of_a_power_on}.all(errors.turn_on_sigma);
}

TriadErrors drawn_errors(const TriadErrors& errors, Quantity quantity, const Normals& of_unit,
                         const Normals& of_power_on, std::uint64_t number) noexcept {
  TriadErrors drawn = errors;
  if (errors.unit_sigma.is_on()) add(drawn_for_unit(errors, quantity, of_unit), drawn);
  if (errors.turn_on_sigma.is_on()) add(drawn_at_power_on(errors, quantity, of_power_on, number), drawn);
  return drawn;
}

}  // namespace imud
