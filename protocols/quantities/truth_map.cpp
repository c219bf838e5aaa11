#include "protocols/quantities/truth_map.hpp"

#include <algorithm>
#include <stdexcept>

#include "protocols/quantities/columns.hpp"

namespace imud {
namespace {

void add(TruthMap& map, std::string_view ours, std::string_view theirs) {
  const auto field = find_signed_field(ours);
  if (!field) throw std::invalid_argument("columns: " + unknown_quantity(ours));
  for (const MappedQuantity& other : map)
    if (other.field.quantity == field->quantity)
      throw std::invalid_argument("columns: the quantity " + std::string(quantity_name(field->quantity)) +
                                  " is named twice, as " + other.ours + " and as " + std::string(ours) +
                                  "; give one of them");
  map.push_back({std::string(ours), std::string(theirs), *field});
}

}  // namespace

bool is_truth_map(std::span<const std::string> texts) noexcept {
  return std::ranges::any_of(texts, [](const std::string& text) { return text.find('=') != text.npos; });
}

std::optional<TruthField> find_signed_field(std::string_view ours) noexcept {
  const bool is_negative = ours.starts_with('-');
  auto field = find_truth_field(ours.substr(is_negative ? 1 : 0));
  if (!is_negative || !field) return field;
  if (field->kind == QuantityKind::time || field->kind == QuantityKind::text) return std::nullopt;
  field->factor = -field->factor;
  return field;
}

TruthMap parse_truth_map(std::span<const std::string> texts) {
  TruthMap map;
  for (const std::string& text : texts) {
    const std::size_t equals = text.find('=');
    const std::string_view ours = trim(std::string_view(text).substr(0, equals));
    const std::string_view theirs = equals == text.npos ? "" : trim(std::string_view(text).substr(equals + 1));
    if (theirs.empty())
      throw std::invalid_argument("columns: \"" + text +
                                  "\" lacks the name that the simulator has; give our name = \"their name\"");
    add(map, ours, theirs);
  }
  return map;
}

TruthMap parse_truth_order(std::span<const std::string> names) {
  if (is_truth_map(names))
    throw std::invalid_argument(
        "columns: this format has no names of columns, and takes no table; give the list of the quantities in the "
        "order of the columns, as in [\"time_s\", \"_\", \"q_NB_w\"], where _ is not used");
  const std::vector<std::string_view> views(names.begin(), names.end());
  return truth_order(views);
}

TruthMap truth_order(std::span<const std::string_view> names) {
  TruthMap map;
  for (std::size_t i = 0; i < names.size(); ++i)
    if (const std::string_view name = unquoted(names[i]); name != "_") add(map, name, std::to_string(i));
  return map;
}

QuantitySet quantities_of(const TruthMap& map) {
  QuantitySet set;
  for (const MappedQuantity& mapped : map) set.set(mapped.field.quantity);
  return set;
}

TruthAssembly assembly_of(const TruthMap& map, const TruthAssembly::Axes& axes) {
  try {
    return {quantities_of(map), axes};
  } catch (const std::invalid_argument& fault) {
    throw std::invalid_argument("columns: " + std::string(fault.what()));
  }
}

}  // namespace imud
