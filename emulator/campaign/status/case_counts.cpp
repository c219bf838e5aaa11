#include "emulator/campaign/status/case_counts.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <utility>

#include "core/numbers/number_text.hpp"

namespace imud {

namespace {

using Json = nlohmann::ordered_json;

// Returns the object that begins behind `begin` and ends before `end`; nullopt if the row has other members there.
// Quotes within texts have a backslash before them, so that neither can stand within one.
std::optional<Json> object_between(std::string_view row, std::string_view begin, std::string_view end) {
  const std::size_t at = row.find(begin);
  if (at == row.npos) return std::nullopt;
  const std::size_t from = at + begin.size() - 1, to = row.find(end, from);
  if (to == row.npos) return std::nullopt;
  Json object = Json::parse(row.substr(from, to + 1 - from), nullptr, false);
  return object.is_object() ? std::optional(std::move(object)) : std::nullopt;
}

std::string shown(const Json& value) { return value.is_string() ? value.get<std::string>() : value.dump(); }

void count(CaseRate& rate, bool passed) noexcept {
  ++rate.runs;
  rate.passes += passed ? 1 : 0;
}

}  // namespace

// The members of a row that are counted.
struct CaseCounts::Row {
  std::uint64_t index;
  RowResult result;
  Json axes, expect;
  Json all = {};  // the whole row, of a case that has not passed

  Row(std::uint64_t number, std::string_view text) : index(number), result(text) {
    // Reading the whole of each row takes ten times as long.
    std::optional<Json> axes_there, expect_there;
    if (result.exit_code == 0) {
      axes_there = object_between(text, "\"axes\":{", "},\"seed\":");
      expect_there = object_between(text, ",\"expect\":{", "},\"shortfalls\":");
    }
    if (!axes_there || !expect_there) all = Json::parse(text);
    axes = axes_there ? std::move(*axes_there) : all.value("axes", Json::object());
    expect = expect_there ? std::move(*expect_there) : all.value("expect", Json::object());
  }

  Failed failed() const {
    Failed one;
    one.seed = all.value("seed", std::uint64_t{0});
    std::vector<std::string> values, why;
    for (const auto& [name, value] : axes.items())
      values.push_back(fmt::format("{} {}", name, value == "" ? "none" : shown(value)));
    if (result.could_not_be_run) why.push_back(result.error);
    for (const auto& [name, holds] : expect.items())
      if (holds == false) why.push_back(fmt::format("{} does not hold", name));
    for (const Json& shortfall : all.value("shortfalls", Json::array())) why.push_back(shown(shortfall));
    if (why.empty()) why.push_back(fmt::format("exit code {}", result.exit_code));
    one.axes = fmt::format("{}", fmt::join(values, ", "));
    one.why = fmt::format("{}", fmt::join(why, "; "));
    return one;
  }
};

void CaseCounts::add(const Shard& shard) {
  for (std::size_t i = 0; i < shard.rows.size(); ++i) try {
      add(Row(shard.head.cases.first + i, shard.rows[i]));
    } catch (const nlohmann::json::exception&) {
      throw std::runtime_error(no_result_in_row_of(shard.head.cases.first + i));
    }
}

void CaseCounts::keep(std::uint64_t index, Failed one) {
  failed_.emplace(index, std::move(one));
  if (failed_.size() > most_failed) failed_.erase(std::prev(failed_.end()));
}

CaseCounts::Value* CaseCounts::value_of(Axis& axis, const std::string& text, std::uint64_t first_case) {
  if (!axis.is_divided) return nullptr;
  auto known = std::ranges::find(axis.values, text, &Value::text);
  if (known == axis.values.end()) {
    if (axis.values.size() == most_values) {
      axis.is_divided = false;
      axis.values.clear();
      return nullptr;
    }
    axis.values.push_back({.text = text, .first_case = first_case, .rates = {}});
    known = axis.values.end() - 1;
  }
  known->first_case = std::min(known->first_case, first_case);
  return &*known;
}

void CaseCounts::add(const CaseCounts& other) {
  done += other.done;
  tally.add(other.tally);
  for (const auto& [index, one] : other.failed_) keep(index, one);
  std::vector<std::size_t> rates = {0};  // the numbers here
  for (std::size_t i = 1; i < other.names_.size(); ++i) rates.push_back(rate_of(other.names_[i]));
  const auto add_rates = [&](std::vector<CaseRate>& to, const std::vector<CaseRate>& from) {
    for (std::size_t i = 0; i < from.size(); ++i) {
      if (to.size() <= rates[i]) to.resize(rates[i] + 1);
      to[rates[i]].runs += from[i].runs;
      to[rates[i]].passes += from[i].passes;
    }
  };
  add_rates(rates_, other.rates_);
  for (std::size_t i = 0; i < other.axes_.size(); ++i) {
    const Axis& from = other.axes_[i];
    if (i == axes_.size()) axes_.push_back({.name = from.name, .values = {}});
    if (!from.is_divided) {
      axes_[i].is_divided = false;
      axes_[i].values.clear();
    }
    for (const Value& value : from.values)
      if (Value* const to = value_of(axes_[i], value.text, value.first_case)) add_rates(to->rates, value.rates);
  }
}

std::size_t CaseCounts::rate_of(const std::string& expectation) {
  const auto known = std::find(names_.begin() + 1, names_.end(), expectation);
  if (known != names_.end()) return static_cast<std::size_t>(known - names_.begin());
  names_.push_back(expectation);
  rates_.emplace_back();
  return names_.size() - 1;
}

void CaseCounts::add(const Row& row) {
  const bool passed = row.result.exit_code == 0;
  tally.add(row.result);
  if (!passed && (failed_.size() < most_failed || row.index < failed_.rbegin()->first)) keep(row.index, row.failed());
  std::vector<Passed> all;
  if (!row.result.could_not_be_run) {
    ++done;
    all.push_back({0, passed});
    for (const auto& [name, holds] : row.expect.items()) all.push_back({rate_of(name), holds == true});
  }
  for (const Passed& one : all) count(rates_[one.rate], one.passed);
  divide(row, all);
}

void CaseCounts::divide(const Row& row, const std::vector<Passed>& all) {
  std::size_t number = 0;
  for (const auto& [name, value] : row.axes.items()) {
    if (number == axes_.size()) axes_.push_back({.name = name, .values = {}});
    Axis& axis = axes_[number++];
    Value* const known = value_of(axis, shown(value), row.index);
    if (known == nullptr) continue;
    for (const Passed& one : all) {
      if (known->rates.size() <= one.rate) known->rates.resize(one.rate + 1);
      count(known->rates[one.rate], one.passed);
    }
  }
}

std::vector<CaseCounts::Axis> CaseCounts::axes() const {
  std::vector<Axis> sorted = axes_;
  for (Axis& axis : sorted) {
    const auto number = [](const Value& value) { return number_in<double>(value.text).value_or(NAN); };
    if (std::ranges::all_of(axis.values, [&](const Value& value) { return std::isfinite(number(value)); }))
      std::ranges::sort(axis.values, {}, number);
    else
      std::ranges::sort(axis.values, {}, &Value::first_case);
  }
  return sorted;
}

}  // namespace imud
