#include "tools/fit/dwell_plan.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <boost/algorithm/string/classification.hpp>
#include <boost/algorithm/string/split.hpp>
#include <boost/algorithm/string/trim.hpp>
#include <cmath>
#include <functional>
#include <istream>
#include <stdexcept>
#include <string_view>

#include "core/numbers/number_text.hpp"
#include "core/units.hpp"

namespace imud {
namespace {

// The limits of a cell: more than any turntable or chamber, and little enough that the sums of squares of the fit
// stay finite.
constexpr double longest_s = 1e9, largest = 1e6;

struct Column {
  std::string name;
  std::string quantity;  // without its unit
  double most = largest;
  std::function<void(Dwell&, double)> set;
};

void set_axis(std::optional<Vector3>& vector, int axis, double value) {
  if (!vector) vector = Vector3::Zero();
  (*vector)[axis] = value;
}

// All columns that a table may have.
std::vector<Column> known_columns() {
  std::vector<Column> all = {
      {"begin_s", "begin", longest_s, [](Dwell& dwell, double value) { dwell.begin_s = value; }},
      {"end_s", "end", longest_s, [](Dwell& dwell, double value) { dwell.end_s = value; }},
      {"temperature_c", "temperature", largest, [](Dwell& dwell, double value) { dwell.temperature_c = value; }}};
  for (int axis = 0; axis < 3; ++axis) {
    const auto add = [&](std::string_view stem, std::string_view unit, std::optional<Vector3> Dwell::*member,
                         double si) {
      const std::string quantity = fmt::format("{}_{}", stem, "xyz"[axis]);
      all.push_back({fmt::format("{}_{}", quantity, unit), quantity, largest,
                     [member, axis, si](Dwell& dwell, double value) { set_axis(dwell.*member, axis, si * value); }});
    };
    add("rate", "deg_per_s", &Dwell::rate, units::degree);
    add("rate", "rad_per_s", &Dwell::rate, 1);
    add("force", "g", &Dwell::force, units::standard_gravity);
    add("force", "m_per_s2", &Dwell::force, 1);
  }
  return all;
}

std::vector<std::string> fields_of(const std::string& line) {
  std::vector<std::string> fields;
  boost::split(fields, line, boost::is_any_of(","));
  for (std::string& field : fields) boost::trim(field);
  return fields;
}

}  // namespace

std::vector<Dwell> read_dwells(std::istream& text, const std::string& name) {
  const std::vector<Column> known = known_columns();
  std::vector<const Column*> columns;
  std::vector<Dwell> dwells;
  std::size_t number = 0;
  const auto refuse = [&](const std::string& fault) {
    throw std::runtime_error(fmt::format("{}:{}: {}", name, number, fault));
  };
  const auto add_column = [&](const Column& column) {
    for (const Column* other : columns)
      if (other->quantity == column.quantity)
        refuse(other->name == column.name
                   ? fmt::format("the column {} is given twice; right would be once", column.name)
                   : fmt::format("{} is given twice, by {} and by {}; right would be one of them", column.quantity,
                                 other->name, column.name));
    columns.push_back(&column);
  };
  for (std::string line; std::getline(text, line);) {
    if (++number == 1 && line.starts_with("\xEF\xBB\xBF")) line.erase(0, 3);  // a byte order mark
    boost::trim(line);
    if (line.empty() || line.starts_with('#')) continue;
    const std::vector<std::string> fields = fields_of(line);
    if (columns.empty()) {
      for (const std::string& field : fields) {
        for (const Column& column : known)
          if (column.name == field) add_column(column);
        if (columns.empty() || columns.back()->name != field) {
          std::vector<std::string> names;
          for (const Column& column : known) names.push_back(column.name);
          refuse(fmt::format("there is no column \"{}\"; right would be {}", field, fmt::join(names, ", ")));
        }
      }
      for (const std::string_view needed : {"begin_s", "end_s"})
        if (std::ranges::count(fields, needed) != 1) refuse(fmt::format("the header needs one column {}", needed));
      continue;
    }
    if (fields.size() != columns.size())
      refuse(fmt::format("{} fields; right would be {}, as in the header", fields.size(), columns.size()));
    Dwell& dwell = dwells.emplace_back();
    for (std::size_t i = 0; i < fields.size(); ++i) {
      if (fields[i].empty()) continue;
      const auto value = number_in<double>(fields[i]);
      const double most = columns[i]->most;
      if (!value || !(std::abs(*value) <= most))
        refuse(fmt::format("\"{}\"; right would be a number from {} to {}", fields[i], -most, most));
      columns[i]->set(dwell, *value);
    }
    if (!(dwell.begin_s >= 0 && dwell.end_s > dwell.begin_s))
      refuse("begin_s must be at least 0, and end_s after it");
    if (dwells.size() > 1 && dwell.begin_s < dwells[dwells.size() - 2].end_s)
      refuse("the dwell begins before the one above it ends");
  }
  if (dwells.empty()) throw std::runtime_error(name + ": no dwell; right would be a header and a row for each dwell");
  return dwells;
}

}  // namespace imud
