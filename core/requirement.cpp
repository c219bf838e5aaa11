#include "core/requirement.hpp"

#include <utility>

#include "core/numbers/number_text.hpp"

namespace imud {
namespace {

[[noreturn]] void refuse(std::string_view text, std::string_view fault) {
  throw RequirementError("\"" + std::string(text) + "\": " + std::string(fault) +
                         "; right would be FIGURE>=NUMBER, such as samples>=1000 or truth.refused<=1%");
}

std::string_view trimmed(std::string_view text) noexcept {
  const std::size_t begin = text.find_first_not_of(' ');
  if (begin == text.npos) return {};
  return text.substr(begin, text.find_last_not_of(' ') - begin + 1);
}

Requirement parse_one(std::string_view text) {
  using Relation = Requirement::Relation;
  constexpr std::pair<std::string_view, Relation> relations[] = {
      {">=", Relation::at_least}, {"<=", Relation::at_most}, {"==", Relation::equal},
      {">", Relation::more},      {"<", Relation::less},     {"=", Relation::equal},
  };
  const std::size_t at = text.find_first_of("<>=");
  if (at == text.npos) refuse(text, "it has no relation");
  Requirement requirement;
  requirement.text = text;
  requirement.figure = trimmed(text.substr(0, at));
  if (requirement.figure.empty()) refuse(text, "it names no figure");
  std::string_view number;
  for (const auto& [word, relation] : relations)
    if (text.substr(at).starts_with(word)) {
      requirement.relation = relation;
      number = trimmed(text.substr(at + word.size()));
      break;
    }
  requirement.percent = number.ends_with('%');
  if (requirement.percent) number = trimmed(number.substr(0, number.size() - 1));
  const auto limit = finite_number_in(number);
  if (!limit) refuse(text, "no number follows the relation");
  requirement.limit = *limit;
  return requirement;
}

}  // namespace

bool Requirement::holds(double value, double whole) const noexcept {
  if (percent) value = whole > 0 ? 100.0 * value / whole : 0.0;
  switch (relation) {
    case Relation::at_least:
      return value >= limit;
    case Relation::at_most:
      return value <= limit;
    case Relation::equal:
      return value == limit;
    case Relation::more:
      return value > limit;
    case Relation::less:
      break;
  }
  return value < limit;
}

std::vector<Requirement> parse_requirements(std::string_view text) {
  std::vector<Requirement> all;
  while (true) {
    const std::size_t comma = text.find(',');
    all.push_back(parse_one(trimmed(text.substr(0, comma))));
    if (comma == text.npos) return all;
    text.remove_prefix(comma + 1);
  }
}

}  // namespace imud
