// TruthMap: maps a simulator's names to quantities of truth.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/quantities/truth_assembly.hpp"

namespace imud {

// A quantity and the simulator's name for the quantity.
struct MappedQuantity {
  std::string ours;  // with its unit
  std::string theirs;
  TruthField field;
};
using TruthMap = std::vector<MappedQuantity>;

// The setting `columns` of a format that maps names.
inline constexpr Setting map_setting = list_setting(
    "columns", "the quantities and the names that the simulator gives them: {time_s = \"t\", q_NB_w = \"qw\", ...}");

// Returns true if `texts` is a map, "our_name=their_name", rather than a list of names.
bool is_truth_map(std::span<const std::string> texts) noexcept;
// Returns the field with the imud name `ours`. A minus before the name changes the sign: "-height_m" is a depth.
// Returns nullopt if there is no such quantity.
std::optional<TruthField> find_signed_field(std::string_view ours) noexcept;
// parse_truth_map() parses a map. parse_truth_order() parses a list of imud's names in the order of the columns,
// in which "_" is an unused column; the number of the column then takes the place of the simulator's name. Both
// throw std::invalid_argument, "columns: ..." with the fault and the remedy, for a quantity that is unknown or
// named twice, and parse_truth_order() also for a map.
TruthMap parse_truth_map(std::span<const std::string> texts);
TruthMap parse_truth_order(std::span<const std::string> names);
// Does the same as parse_truth_order() for a table in a source file.
TruthMap truth_order(std::span<const std::string_view> names);

// Returns the set of quantities in `map`.
QuantitySet quantities_of(const TruthMap& map);
// Returns the TruthAssembly for the quantities in `map`. Throws std::invalid_argument, "columns: ...", if a
// quantity is missing, or two quantities exclude one another.
TruthAssembly assembly_of(const TruthMap& map, const TruthAssembly::Axes& axes);

}  // namespace imud
