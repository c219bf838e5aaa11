// AllanComparison: compares the noise of a recording with the noise of a model, term by term.
#pragma once

#include <array>
#include <span>
#include <string_view>

#include "tools/allan/allan_curve.hpp"
#include "tools/allan/allan_fit.hpp"
#include "tools/allan/allan_term_list.hpp"

namespace imud {

// A term differs if a deviation from the model of more than `tolerance` is beyond chance: with this probability it is
// found where there is none, and a tolerance of 0 would find it, too.
inline constexpr double false_difference = 1e-3;

struct TermVerdict {
  enum class Word { agrees, differs, undecided };
  double model = 0;  // SI; 0: the model has no such term
  Word word = Word::agrees;
  bool is_in_neither = false;  // neither the model nor the recording has the term
  bool is_by_curve = false;    // it agrees because the curves agree
};
std::string_view name_of(TermVerdict::Word word) noexcept;

// Compares the fitted terms with the model's, in the order of allan_term_list.
//   Both have the term: it differs if the confidence interval of the fitted one, at 1 - false_difference, does not
//   reach model * (1 -+ tolerance).
//   It is not seen: it differs if the model's, less the tolerance, is twice as large as the least that would be seen;
//   otherwise the recording is too short for it, and it is undecided.
//   The model has none: it differs if what is certain of it adds more than the tolerance to the model's deviation at
//   one of the averaging times.
// `has_curve_of_model`: filter, digits and decimation, of which the terms do not know, act at short averaging times.
// Where the curves agree, Q and N, which are the terms of these times, do not differ.
std::array<TermVerdict, allan_term_count> compare(const AllanCurve& curve, const AllanFit& fit,
                                                  const AllanTerms& model, double tolerance,
                                                  bool has_curve_of_model = false);

// Returns whether the confidence interval of each deviation of the curve, at 1 - false_difference for all of them
// together, reaches the model's deviation * (1 -+ tolerance). `model`: a deviation for each point.
bool has_deviations_of(const AllanCurve& curve, std::span<const double> model, double tolerance);

// Returns true if no term differs and at least one term of the model agrees. The latter is required because a
// recording that is too short to decide about any term proves nothing.
bool agrees(const std::array<TermVerdict, allan_term_count>& verdicts) noexcept;

}  // namespace imud
