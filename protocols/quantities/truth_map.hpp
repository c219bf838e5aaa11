// TruthMap: which of a simulator's names mean which quantities of truth.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/quantities/truth_assembly.hpp"

namespace imud {

// A quantity, and the simulator's name of it.
struct MappedQuantity {
  std::string ours;  // with its unit
  std::string theirs;
  TruthField field;
};
using TruthMap = std::vector<MappedQuantity>;

// The setting `columns` of a format that maps names.
inline constexpr Setting map_setting = list_setting(
    "columns", "the quantities and the names that the simulator gives them: {time_s = \"t\", q_NB_w = \"qw\", ...}");

// Returns true if the texts are a map, "our_name=their_name", and no list of names.
bool is_truth_map(std::span<const std::string> texts) noexcept;
// Returns the field of one of our names. A minus before the name changes the sign: "-height_m" is a depth. Returns
// nullopt if there is no such quantity.
std::optional<TruthField> find_signed_field(std::string_view ours) noexcept;
// Parse a map, and a list of our names in the order of the columns, in which "_" is a column that is not used; the
// simulator's name is then the number of the column. Throw std::invalid_argument, "columns: ..." with the fault and
// the remedy, for an unknown quantity, and for one that is named twice.
TruthMap parse_truth_map(std::span<const std::string> texts);
TruthMap parse_truth_order(std::span<const std::string> names);
// As parse_truth_order(), of a table in a source file.
TruthMap truth_order(std::span<const std::string_view> names);

// Returns the set of the quantities.
QuantitySet quantities_of(const TruthMap& map);
// Returns the assembly of truths from them. Throws std::invalid_argument, "columns: ...", if one is missing, or two
// exclude one another.
TruthAssembly assembly_of(const TruthMap& map, const TruthAssembly::Axes& axes);

}  // namespace imud
