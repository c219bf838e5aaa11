#include "tools/allan/allan_comparison.hpp"

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>

namespace imud {
namespace {

using Verdict = TermVerdict::Word;

// Returns the largest share that a term of this size adds to the model's deviation at one of the averaging times.
double largest_share(std::size_t term, double size, const AllanCurve& curve, const AllanTerms& model) {
  double largest = 0;
  for (const auto& point : curve.points) {
    const double expected = expected_deviation(curve.kind, model, curve.time(point));
    const double variance = size * size * unit_variances(curve.kind, curve.time(point))[term];
    largest = std::max(largest, std::sqrt(1 + variance / (expected * expected)) - 1);
  }
  return largest;
}

}  // namespace

std::string_view name_of(Verdict word) noexcept {
  return word == Verdict::agrees ? "agrees" : word == Verdict::differs ? "differs" : "undecided";
}

std::array<TermVerdict, allan_term_count> compare(const AllanCurve& curve, const AllanFit& fit,
                                                  const AllanTerms& model, double tolerance,
                                                  bool has_curve_of_model) {
  const double errors = boost::math::quantile(boost::math::normal(), 1 - false_difference / 2);
  // A term of the least detectable size is detected half of the time; a term of twice this size practically
  // always.
  constexpr double surely_seen = 2;
  std::array<TermVerdict, allan_term_count> verdicts;
  for (std::size_t t = 0; t < allan_term_count; ++t) {
    const double wanted = model.*allan_term_list[t].value;
    const auto& [value, error, least_seen] = fit.terms[t];
    bool differs = false, undecided = false;
    if (wanted == 0) {
      const double certain = value.value_or(0) - errors * error;
      differs = value && certain > 0 && largest_share(t, certain, curve, model) > tolerance;
    } else if (value) {
      differs = std::abs(*value - wanted) > tolerance * wanted + errors * error;
    } else {
      differs = (1 - tolerance) * wanted > surely_seen * least_seen;
      undecided = !differs;
    }
    const char letter = allan_term_list[t].letter;
    const bool is_by_curve = differs && has_curve_of_model && (letter == 'Q' || letter == 'N');
    verdicts[t] = {wanted,
                   differs && !is_by_curve ? Verdict::differs
                   : undecided             ? Verdict::undecided
                                           : Verdict::agrees,
                   wanted == 0 && !value, is_by_curve};
  }
  return verdicts;
}

bool has_deviations_of(const AllanCurve& curve, std::span<const double> model, double tolerance) {
  const double confidence = 1 - false_difference / static_cast<double>(curve.points.size());
  for (std::size_t i = 0; i < curve.points.size(); ++i) {
    const AllanCurve::Point& point = curve.points[i];
    const DeviationBounds bounds = deviation_bounds(point.deviation, point.degrees, confidence);
    if (bounds.low > (1 + tolerance) * model[i] || bounds.high < (1 - tolerance) * model[i]) return false;
  }
  return true;
}

bool agrees(const std::array<TermVerdict, allan_term_count>& verdicts) noexcept {
  const auto is = [](Verdict word) { return [word](const TermVerdict& v) { return v.word == word; }; };
  const bool has_terms = std::ranges::any_of(verdicts, [](const TermVerdict& v) { return v.model > 0; });
  return std::ranges::none_of(verdicts, is(Verdict::differs)) &&
         (!has_terms || std::ranges::any_of(
                            verdicts, [](const TermVerdict& v) { return v.model > 0 && v.word == Verdict::agrees; }));
}

}  // namespace imud
