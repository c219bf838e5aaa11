#include "tools/campaign/campaign_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>

#include "core/numbers/number_text.hpp"
#include "emulator/campaign/shards/wilson.hpp"

namespace imud {
namespace {

using Table = std::vector<std::vector<std::string>>;
using Figure = CaseStatistics::Figure;

constexpr struct {
  const char* name;
  double share;
} percentiles[] = {{"p5", 0.05}, {"p25", 0.25}, {"p50", 0.5}, {"p75", 0.75}, {"p95", 0.95}};

// Returns the table with aligned columns; all but the first one to the right.
std::string aligned(const Table& table) {
  std::vector<std::size_t> widths;
  for (const auto& row : table)
    for (std::size_t i = 0; i < row.size(); ++i) {
      if (widths.size() <= i) widths.push_back(0);
      widths[i] = std::max(widths[i], row[i].size());
    }
  std::string text;
  for (const auto& row : table) {
    for (std::size_t i = 0; i < row.size(); ++i)
      text += i == 0 ? fmt::format("{:<{}}", row[i], widths[i]) : fmt::format("  {:>{}}", row[i], widths[i]);
    text += '\n';
  }
  return text;
}

std::string number_text(double number) { return std::isnan(number) ? "-" : fmt::format("{:.5g}", number); }

std::string percent(double share) { return fmt::format("{:.2f} %", 100 * share); }

double rate_of(const Moments& moments) noexcept {
  return static_cast<double>(moments.passes) / static_cast<double>(moments.runs);
}

std::vector<std::string> pass_row(const std::string& name, const Moments& moments) {
  if (moments.runs == 0) return {name, "0", "-", "-"};
  const Interval interval = wilson_interval(moments.passes, moments.runs);
  return {name, fmt::to_string(moments.runs), percent(rate_of(moments)),
          fmt::format("{:.2f} to {:.2f} %", 100 * interval.low, 100 * interval.high)};
}

std::vector<std::string> figure_row(const std::string& name, const Moments& moments,
                                    const std::vector<double>& sorted) {
  if (moments.runs == 0) return {name, "0"};
  std::vector<std::string> row = {name, fmt::to_string(moments.runs), number_text(moments.mean),
                                  number_text(moments.deviation()), number_text(moments.min)};
  for (const auto& one : percentiles) row.push_back(number_text(percentile(sorted, one.share)));
  row.push_back(number_text(moments.max));
  return row;
}

std::vector<std::string> header_of(const std::string& title, bool is_expectation) {
  if (is_expectation) return {title, "runs", "passed", "95 % interval"};
  std::vector<std::string> header = {title, "runs", "mean", "deviation", "min"};
  for (const auto& one : percentiles) header.emplace_back(one.name);
  header.emplace_back("max");
  return header;
}

// Returns the moments of the cases with that value of an axis.
Moments moments_at(const Figure& figure, std::size_t axis, std::size_t value) {
  const auto& by_value = figure.by_axis[axis];
  return value < by_value.size() ? by_value[value] : Moments();
}

std::vector<std::size_t> expectations_of(const CaseStatistics& statistics) {
  std::vector<std::size_t> all;
  for (std::size_t i = 0; i < statistics.figures().size(); ++i)
    if (statistics.figures()[i].is_expectation) all.push_back(i);
  return all;
}

std::string counts_text(const std::map<std::string, std::uint64_t>& counts) {
  std::string text;
  for (const auto& [name, count] : counts) text += fmt::format("{}{}: {}", text.empty() ? "" : ", ", name, count);
  return text;
}

std::string by_axis_text(const CaseStatistics& statistics, std::size_t number, std::size_t axis_number) {
  const CaseStatistics::Axis& axis = statistics.axes()[axis_number];
  const Figure& figure = statistics.figures()[number];
  if (!axis.is_divided())
    return fmt::format("\n{} by {}: more than {} values\n", figure.name, axis.name, CaseStatistics::most_values);
  Table table = {header_of("value", figure.is_expectation)};
  const auto sorted =
      figure.is_expectation ? std::vector<std::vector<double>>() : statistics.sorted_by(number, axis_number);
  for (const std::size_t value : order_of(axis)) {
    const Moments moments = moments_at(figure, axis_number, value);
    table.push_back(figure.is_expectation ? pass_row(axis.values[value], moments)
                                          : figure_row(axis.values[value], moments, sorted[value]));
  }
  return fmt::format("\n{} by {}\n{}", figure.name, axis.name, aligned(table));
}

std::string noted_text(const CampaignRows& rows, const CaseStatistics::Noted& noted, bool has_number) {
  return fmt::format("case {}{}: {}\n  {}\n", noted.index, has_number ? ", " + number_text(noted.number) : "",
                     noted.description, rows.repeat_command(noted.index));
}

// A number that is not finite becomes null.
nlohmann::ordered_json json_of(const Figure& figure, const Moments& moments, const std::vector<double>& sorted) {
  nlohmann::ordered_json json = {{"runs", moments.runs}};
  if (figure.is_expectation) {
    const Interval interval = wilson_interval(moments.passes, moments.runs);
    json["passes"] = moments.passes;
    json["rate"] = moments.runs == 0 ? NAN : rate_of(moments);
    json["wilson_95"] = {interval.low, interval.high};
    return json;
  }
  json["mean"] = moments.runs == 0 ? NAN : moments.mean;
  json["standard_deviation"] = moments.deviation();
  json["min"] = moments.min;
  for (const auto& one : percentiles) json[one.name] = percentile(sorted, one.share);
  json["max"] = moments.max;
  return json;
}

nlohmann::ordered_json json_of(const CampaignRows& rows, const CaseStatistics::Noted& noted) {
  return {{"case", noted.index}, {"description", noted.description}, {"repeat", rows.repeat_command(noted.index)}};
}

}  // namespace

std::vector<std::size_t> figures_to_show(const CaseStatistics& statistics, bool is_asked) {
  std::vector<std::size_t> metrics, varying, all;
  for (std::size_t i = 0; i < statistics.figures().size(); ++i) {
    const Figure& figure = statistics.figures()[i];
    if (figure.is_expectation || figure.all.runs == 0) continue;
    all.push_back(i);
    if (figure.name.find('@') != figure.name.npos) continue;
    if (figure.name.starts_with("test.") && figure.name != "test.exit_code") metrics.push_back(i);
    if (figure.all.min < figure.all.max) varying.push_back(i);
  }
  return is_asked ? all : metrics.empty() ? varying : metrics;
}

std::vector<std::size_t> order_of(const CaseStatistics::Axis& axis) {
  std::vector<std::size_t> order(axis.values.size());
  std::iota(order.begin(), order.end(), 0U);
  std::vector<double> numbers;
  for (const std::string& value : axis.values)
    if (const auto number = finite_number_in(value)) numbers.push_back(*number);
  if (numbers.size() == order.size()) std::ranges::stable_sort(order, {}, [&](std::size_t i) { return numbers[i]; });
  return order;
}

std::string campaign_text(const CaseStatistics& statistics, const CampaignRows& rows, const ReportChoice& choice) {
  std::string text = fmt::format("campaign   {} of {} cases; imud {}, plan {}\n", statistics.cases(), rows.cases(),
                                 rows.campaign().version, rows.campaign().plan_sha256.substr(0, 12));
  if (const std::string until = rows.until(); !until.empty()) text += fmt::format("until      {}\n", until);
  text += fmt::format("exit code  {}\nended by   {}\n", counts_text(statistics.exit_codes()),
                      counts_text(statistics.ends()));
  const Interval failed = wilson_interval(statistics.failures(), statistics.cases());
  if (statistics.cases() > 0)
    text += fmt::format("failed     {} cases, {} ({:.2f} to {:.2f} %)\n", statistics.failures(),
                        percent(static_cast<double>(statistics.failures()) / static_cast<double>(statistics.cases())),
                        100 * failed.low, 100 * failed.high);
  const std::vector<std::size_t> expectations = expectations_of(statistics);
  if (!expectations.empty()) {
    Table table = {header_of("expectation", true)};
    for (const std::size_t i : expectations)
      table.push_back(pass_row(statistics.figures()[i].name, statistics.figures()[i].all));
    text += "\n" + aligned(table);
  }
  if (!choice.figures.empty()) {
    Table table = {header_of("figure", false)};
    for (const std::size_t i : choice.figures)
      table.push_back(figure_row(statistics.figures()[i].name, statistics.figures()[i].all, statistics.sorted(i)));
    text += "\n" + aligned(table);
    if (statistics.sample().size() < statistics.runs())
      text += fmt::format("percentiles (p5 to p95) of {} cases, chosen at random\n", statistics.sample().size());
  }
  std::vector<std::size_t> divided = expectations;
  divided.insert(divided.end(), choice.figures.begin(), choice.figures.end());
  for (const std::size_t figure : divided)
    for (const std::size_t axis : choice.axes) text += by_axis_text(statistics, figure, axis);
  for (const CaseStatistics::Worst& worst : statistics.worst()) {
    text += fmt::format("\nworst by {}\n", worst.figure);
    for (const CaseStatistics::Noted& noted : worst.cases) text += noted_text(rows, noted, true);
  }
  if (!statistics.failed().empty()) {
    text += fmt::format("\nfailed{}\n",
                        statistics.failed().size() < statistics.failures()
                            ? fmt::format(", the first {} of {}", statistics.failed().size(), statistics.failures())
                            : "");
    for (const CaseStatistics::Noted& noted : statistics.failed()) text += noted_text(rows, noted, false);
  }
  return text;
}

std::string campaign_json(const CaseStatistics& statistics, const CampaignRows& rows, const ReportChoice& choice) {
  nlohmann::ordered_json json = {{"cases", rows.cases()},
                                 {"until", rows.until()},
                                 {"found", statistics.cases()},
                                 {"failed", statistics.failures()},
                                 {"not_run", statistics.not_run()},
                                 {"plan", rows.campaign().plan_sha256},
                                 {"version", rows.campaign().version},
                                 {"exit_codes", statistics.exit_codes()},
                                 {"ended_by", statistics.ends()},
                                 {"cases_of_percentiles", statistics.sample().size()}};
  std::vector<std::size_t> shown = expectations_of(statistics);
  shown.insert(shown.end(), choice.figures.begin(), choice.figures.end());
  json["figures"] = nlohmann::ordered_json::object();
  for (const std::size_t i : shown) {
    const Figure& figure = statistics.figures()[i];
    nlohmann::ordered_json& object = json["figures"][figure.name] = json_of(figure, figure.all, statistics.sorted(i));
    object["by"] = nlohmann::ordered_json::object();
    for (const std::size_t axis_number : choice.axes) {
      const CaseStatistics::Axis& axis = statistics.axes()[axis_number];
      if (!axis.is_divided()) continue;
      const auto sorted = statistics.sorted_by(i, axis_number);
      nlohmann::ordered_json& by = object["by"][axis.name] = nlohmann::ordered_json::object();
      for (const std::size_t value : order_of(axis))
        by[axis.values[value]] = json_of(figure, moments_at(figure, axis_number, value), sorted[value]);
    }
  }
  json["worst"] = nlohmann::ordered_json::object();
  for (const CaseStatistics::Worst& worst : statistics.worst()) {
    nlohmann::ordered_json& list = json["worst"][worst.figure] = nlohmann::ordered_json::array();
    for (const CaseStatistics::Noted& noted : worst.cases) {
      list.push_back(json_of(rows, noted));
      list.back()["value"] = noted.number;
    }
  }
  json["failures"] = nlohmann::ordered_json::array();
  for (const CaseStatistics::Noted& noted : statistics.failed()) json["failures"].push_back(json_of(rows, noted));
  return json.dump(2) + "\n";
}

}  // namespace imud
