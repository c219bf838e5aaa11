#include "tools/campaign/case_statistics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>
#include <utility>

#include "core/numbers/number_text.hpp"

namespace imud {
namespace {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

template <class Item>
std::optional<std::size_t> find_named(const std::vector<Item>& items, const std::string& name) {
  const auto at = std::ranges::find(items, name, &Item::name);
  if (at == items.end()) return std::nullopt;
  return static_cast<std::size_t>(at - items.begin());
}

// Returns the text of a cell for people.
std::string shown(const CaseCell& cell) {
  switch (cell.kind) {
    case CaseCell::Kind::integer:
    case CaseCell::Kind::truth:
      return fmt::to_string(cell.integer);
    case CaseCell::Kind::empty:
      return "none";
    default:
      return cell.text;
  }
}

}  // namespace

CaseStatistics::CaseStatistics(Options options) : options_(std::move(options)), sample_(options_.bytes) {
  for (const std::string& figure : options_.worst) worst_.push_back({figure, {}, false});
}

bool CaseStatistics::is_asked(const std::string& name) const {
  return options_.figures.empty() || std::ranges::any_of(options_.figures, [&](const std::string& figure) {
           return name == figure || (options_.over_time && name.starts_with(figure + "@"));
         });
}

void CaseStatistics::use_new_columns(const CaseRow& row) {
  for (std::size_t i = uses_.size(); i < row.columns().size(); ++i) {
    const CaseColumn& column = row.columns()[i];
    const std::string name = column.name();
    Use& use = uses_.emplace_back();
    if (column.group == CaseGroup::axis) {
      use.axis = axes_.size();
      axes_.push_back({name, {}, {}, {}});
      for (Figure& figure : figures_) figure.by_axis.emplace_back();
    }
    const bool is_expectation = column.group == CaseGroup::expectation;
    const bool is_figure = column.group == CaseGroup::figure || column.group == CaseGroup::test;
    if (!is_expectation && !is_figure) continue;
    if (is_expectation || is_asked(name)) {
      use.figure = figures_.size();
      Figure& figure = figures_.emplace_back();
      figure.name = name;
      figure.is_expectation = is_expectation;
      figure.by_axis.resize(axes_.size());
      figure.is_counter = column.kind == CaseColumn::Kind::counter;
      if (figure.is_counter) {  // the runs before had none
        figure.all = Moments::zeros(runs_);
        for (std::size_t axis = 0; axis < axes_.size(); ++axis)
          for (const std::uint64_t runs : axes_[axis].runs) figure.by_axis[axis].push_back(Moments::zeros(runs));
      }
    }
    for (std::size_t w = 0; w < worst_.size(); ++w)
      if (worst_[w].figure == name) {
        use.worst = w;
        worst_[w].is_known = true;
      }
  }
}

void CaseStatistics::add(const CaseRow& row) {
  use_new_columns(row);
  ++cases_;
  ++exit_codes_[shown(row[CaseRow::exit_code])];
  ++ends_[shown(row[CaseRow::ended_by])];
  if (row.has_failed()) note_failure(row);
  at_.resize(axes_.size());
  numbers_.assign(figures_.size(), not_a_number);
  for (std::size_t i = 0; i < uses_.size(); ++i) {
    if (!uses_[i].axis) continue;
    Axis& axis = axes_[*uses_[i].axis];
    std::uint32_t& at = at_[*uses_[i].axis];
    // Consecutive cases mostly have the same value.
    const std::string value = shown(row[i]);
    if (at < axis.values.size() && axis.values[at] == value) continue;
    const auto [known, is_new] = axis.numbers.try_emplace(value, static_cast<std::uint32_t>(axis.values.size()));
    if (is_new && axis.values.size() <= most_values) axis.values.push_back(value);
    at = known->second;
    if (!axis.is_divided()) axis.numbers.clear();
  }
  if (!row.has_run()) return;
  ++runs_;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    if (!axes_[i].is_divided()) continue;
    axes_[i].runs.resize(axes_[i].values.size());
    ++axes_[i].runs[at_[i]];
  }
  for (std::size_t i = 0; i < uses_.size(); ++i) {
    const std::optional<double> number = row[i].number();
    if (!number) continue;
    if (uses_[i].worst) note_worst(worst_[*uses_[i].worst], row, *number);
    if (!uses_[i].figure) continue;
    Figure& figure = figures_[*uses_[i].figure];
    numbers_[*uses_[i].figure] = *number;
    figure.all.add(*number);
    for (std::size_t axis = 0; axis < axes_.size(); ++axis) {
      if (!axes_[axis].is_divided()) continue;
      std::vector<Moments>& by_value = figure.by_axis[axis];
      if (by_value.size() <= at_[axis]) by_value.resize(at_[axis] + 1);
      by_value[at_[axis]].add(*number);
    }
  }
  if (sample_.wants(row.index())) sample_.add(row.index(), numbers_, at_);
}

std::string CaseStatistics::description(const CaseRow& row) const {
  std::string text = "seed " + shown(row[CaseRow::seed_column]);
  for (std::size_t i = 0; i < uses_.size(); ++i)
    if (uses_[i].axis) text += fmt::format(", {} {}", row.columns()[i].name(), shown(row[i]));
  return text;
}

void CaseStatistics::note_failure(const CaseRow& row) {
  if (++failures_ > options_.count) return;
  std::string text = fmt::format("{}: exit code {}", description(row), shown(row[CaseRow::exit_code]));
  for (std::size_t i = 0; i < row.columns().size(); ++i) {
    const CaseColumn& column = row.columns()[i];
    const std::optional<double> number = row[i].number();
    if (column.group == CaseGroup::expectation && number == 0.0) text += fmt::format(", {} failed", column.name());
    if (column.group == CaseGroup::test && column.key == "exit_code" && number && *number != 0)
      text += fmt::format(", test.exit_code {}", shown(row[i]));
  }
  for (const std::size_t column : {CaseRow::shortfalls, CaseRow::error})
    if (row[column].kind == CaseCell::Kind::text) text += ", " + row[column].text;
  failed_.push_back({row.index(), 0, text});
}

void CaseStatistics::note_worst(Worst& worst, const CaseRow& row, double number) const {
  const auto at = std::ranges::find_if(worst.cases,
                                       [&](const Noted& noted) { return std::abs(number) > std::abs(noted.number); });
  if (at == worst.cases.end() && worst.cases.size() >= options_.count) return;
  worst.cases.insert(at, {row.index(), number, description(row)});
  if (worst.cases.size() > options_.count) worst.cases.pop_back();
}

double CaseStatistics::number(std::size_t row, std::size_t figure) const noexcept {
  return sample_.number(row, figure, figures_[figure].is_counter ? 0 : not_a_number);
}

std::optional<std::size_t> CaseStatistics::find_figure(const std::string& name) const {
  return find_named(figures_, name);
}

std::optional<std::size_t> CaseStatistics::find_axis(const std::string& name) const {
  return find_named(axes_, name);
}

std::vector<std::pair<double, std::size_t>> CaseStatistics::find_over_time(const std::string& name) const {
  std::vector<std::pair<double, std::size_t>> all;
  for (std::size_t i = 0; i < figures_.size(); ++i)
    if (const std::string& one = figures_[i].name; one.starts_with(name + "@"))
      if (const auto time_s = finite_number_in(one.substr(name.size() + 1))) all.emplace_back(*time_s, i);
  std::ranges::sort(all);
  return all;
}

std::vector<double> CaseStatistics::sorted(std::size_t figure) const {
  std::vector<double> numbers;
  for (std::size_t row = 0; row < sample_.size(); ++row)
    if (const double one = number(row, figure); !std::isnan(one)) numbers.push_back(one);
  std::ranges::sort(numbers);
  return numbers;
}

std::vector<std::vector<double>> CaseStatistics::sorted_by(std::size_t figure, std::size_t axis) const {
  std::vector<std::vector<double>> numbers(axes_[axis].values.size());
  for (std::size_t row = 0; row < sample_.size(); ++row)
    if (const double one = number(row, figure); !std::isnan(one) && sample_.at(row, axis) < numbers.size())
      numbers[sample_.at(row, axis)].push_back(one);
  for (std::vector<double>& one : numbers) std::ranges::sort(one);
  return numbers;
}

}  // namespace imud
