#include "core/effects/drawn_errors.hpp"

#include <array>
#include <cstdint>
#include <utility>

namespace imud {
namespace {

// The numbers of a member's draws: a matrix has one for each column. They never change and are never reused, as the
// values of Process.
struct MemberDraws {
  template <class Term>
  constexpr MemberDraws(Term ConstantErrors::*, std::uint64_t number)
      : first(number), count(Term::ColsAtCompileTime) {}
  std::uint64_t first, count;
};
// These have the order in which for_each_constant() calls its function.
constexpr std::array<MemberDraws, constant_error_names.size()> member_draws = {{
    {&ConstantErrors::bias, 0},
    {&ConstantErrors::scale_factor, 1},
    {&ConstantErrors::scale_factor_asymmetry, 2},
    {&ConstantErrors::quadratic, 3},
    {&ConstantErrors::cubic, 4},
    {&ConstantErrors::misalignment, 5},
    {&ConstantErrors::g_sensitivity, 8},
    {&ConstantErrors::temperature_scale, 11},
    {&ConstantErrors::temperature_bias, 14},
    {&ConstantErrors::temperature_rate_bias, 17},
    {&ConstantErrors::temperature_hysteresis, 18},
    {&ConstantErrors::cross_sensitivity, 19},
    {&ConstantErrors::vibration_rectification, 22},
}};
constexpr std::uint64_t draws_of_a_power_on = 32;

constexpr bool draws_are_distinct() {
  std::array<bool, draws_of_a_power_on> is_taken{};
  is_taken[current_field_draw] = true;
  for (const MemberDraws& member : member_draws)
    for (std::uint64_t i = 0; i < member.count; ++i)
      if (std::exchange(is_taken.at(member.first + i), true)) return false;
  return true;
}
static_assert(draws_are_distinct(), "two draws have the same number");

// The deviates of one layer for one power on.
struct Draws {
  const Normals& normals;
  Quantity quantity;
  Process process;
  std::uint64_t first = 0;

  Vector3 of(std::uint64_t draw, const Vector3& sigma, std::uint64_t column = 0) const noexcept {
    if (sigma.isZero(0.0)) return Vector3::Zero();
    return sigma.cwiseProduct(normals(quantity, process, first + draw + column));
  }
  Matrix3 of(std::uint64_t draw, const Matrix3& sigma) const noexcept {
    Matrix3 drawn;
    for (int j = 0; j < 3; ++j) drawn.col(j) = of(draw, Vector3(sigma.col(j)), static_cast<std::uint64_t>(j));
    return drawn;
  }
  ConstantErrors all(const ConstantErrors& sigma) const noexcept {
    ConstantErrors drawn;
    const MemberDraws* member = member_draws.data();
    for_each_constant([&](auto& term, const auto& deviation) { term = of((member++)->first, deviation); }, drawn,
                      sigma);
    return drawn;
  }
};

// The factor of an element's own deviate, by the sum of its squared loads.
template <class Squares>
auto own_part(const Squares& squares) noexcept {
  return (1 - squares.array()).max(0.0).sqrt();
}

// The sums over the causes of a layer.
struct Shares {
  ConstantErrors squares;  // of the loads
  ConstantErrors sums;     // of load times deviate

  Shares(std::span<const Cause> causes, DrawnLayer layer, Quantity quantity, const Normals& normals,
         std::uint64_t number) noexcept {
    for (const Cause& cause : causes) {
      if (cause.layer != layer) continue;
      const Vector3 drawn = cause.drawn(normals, number);
      const auto add = [&](auto& square, auto& sum, const auto& load) {
        square += load.cwiseAbs2();
        sum += drawn.asDiagonal() * load;
      };
      for_each_constant(add, squares, sums, cause.loads(quantity));
    }
  }
  // Turns errors that were drawn without causes into errors that causes have a part in.
  void apply(const ConstantErrors& sigma, ConstantErrors& drawn) const noexcept {
    const auto share = [](auto& term, const auto& deviation, const auto& square, const auto& sum) {
      term = (own_part(square) * term.array() + deviation.array() * sum.array()).matrix().eval();
    };
    for_each_constant(share, drawn, sigma, squares, sums);
  }
};

void add(const ConstantErrors& drawn, TriadErrors& errors) noexcept {
  for_each_constant([](auto& term, const auto& draw) { term += draw; }, errors, drawn);
}

}  // namespace

ConstantErrors drawn_for_unit(const TriadErrors& errors, Quantity quantity, const Normals& normals,
                              std::span<const Cause> causes) noexcept {
  ConstantErrors drawn = Draws{normals, quantity, Process::unit_draw}.all(errors.unit_sigma);
  if (!causes.empty()) Shares(causes, DrawnLayer::unit, quantity, normals, 0).apply(errors.unit_sigma, drawn);
  return drawn;
}

ConstantErrors drawn_at_power_on(const TriadErrors& errors, Quantity quantity, const Normals& normals,
                                 std::uint64_t number, std::span<const Cause> causes) noexcept {
  ConstantErrors drawn =
      Draws{normals, quantity, Process::turn_on_draw, number * draws_of_a_power_on}.all(errors.turn_on_sigma);
  if (causes.empty()) return drawn;
  ConstantErrors sigma = errors.turn_on_sigma;
  sigma.bias = errors.turn_on_bias;
  Shares(causes, DrawnLayer::turn_on, quantity, normals, number).apply(sigma, drawn);
  return drawn;
}

TriadErrors drawn_errors(const TriadErrors& errors, Quantity quantity, const Normals& of_unit,
                         const Normals& of_power_on, std::uint64_t number, std::span<const Cause> causes) noexcept {
  TriadErrors drawn = errors;
  if (errors.unit_sigma.is_on()) add(drawn_for_unit(errors, quantity, of_unit, causes), drawn);
  if (errors.turn_on_sigma.is_on() || !causes.empty())
    add(drawn_at_power_on(errors, quantity, of_power_on, number, causes), drawn);
  Vector3 squares = Vector3::Zero();
  for (const Cause& cause : causes)
    if (cause.layer == DrawnLayer::turn_on) squares += cause.loads(quantity).bias.cwiseAbs2();
  if (!squares.isZero(0.0)) drawn.turn_on_bias = own_part(squares).matrix().cwiseProduct(errors.turn_on_bias);
  return drawn;
}

}  // namespace imud
