#include "emulator/campaign/campaign_bisect.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <utility>
#include <vector>

#include "core/numbers/number_text.hpp"
#include "emulator/campaign/campaign_run.hpp"
#include "emulator/campaign/case_runner.hpp"
#include "emulator/ground/host.hpp"
#include "emulator/ground/progress_line.hpp"
#include "emulator/ground/shell_word.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/seeds/worker_processes.hpp"

namespace imud {

namespace {

// A case that could not be run.
struct NoRun : std::runtime_error {
  using std::runtime_error::runtime_error;
};
// A signal has ended a case.
struct WasEnded {};

struct AxisPoint {
  double value = 0;
  std::string text;
  bool passes = false;
};

bool is_whole_number(double value) noexcept { return value == std::floor(value); }

// The search along the axis; all other values are the values of case `index`.
class AxisSearch {
 public:
  // `campaign` must outlive this.
  AxisSearch(const Campaign& campaign, std::string axis, std::uint64_t index)
      : campaign_(campaign), axis_(std::move(axis)), index_(index) {}

  // Returns a few lines for people, with '\r' between them. `plan` is the plan's name in the printed command that
  // repeats a case.
  std::string run(const std::vector<AxisPoint>& values, double tolerance, const std::string& plan) {
    std::vector<AxisPoint> points;
    for (const AxisPoint& value : values) points.push_back(tried(value.value, value.text));
    const auto differ = [](const AxisPoint& a, const AxisPoint& b) { return a.passes != b.passes; };
    const auto first = std::ranges::adjacent_find(points, differ);
    if (first == points.end())
      return fmt::format("case {}: {} at all {} values from {} to {}", index_,
                         points.front().passes ? "passes" : "fails", points.size(), points.front().text,
                         points.back().text);
    AxisPoint low = *first, high = *(first + 1);
    halve(low, high, tolerance > 0 ? tolerance : (high.value - low.value) / default_parts);
    std::string text = low.passes ? fmt::format("case {}: passes at {}, fails at {}", index_, low.text, high.text)
                                  : fmt::format("case {}: fails at {}, passes at {}", index_, low.text, high.text);
    text += fmt::format(" ({} runs)", runs_);
    std::vector<std::string> others;
    for (auto one = std::adjacent_find(first + 1, points.end(), differ); one != points.end();
         one = std::adjacent_find(one + 1, points.end(), differ))
      others.push_back(fmt::format("{} again at {}", (one + 1)->passes ? "passes" : "fails", (one + 1)->text));
    if (!others.empty()) text += fmt::format("\r  not monotone: it {}", fmt::join(others, ", "));
    return text + fmt::format("\r  imud campaign repeat {} {} --axis {} --record case_{}.pcapng", path_word(plan),
                              index_, shell_word(axis_ + "=" + (low.passes ? high : low).text), index_);
  }

 private:
  static constexpr double default_parts = 1000;

  AxisPoint tried(double value, const std::string& text) {
    const Campaign campaign = with_axis_value(campaign_, index_, axis_, text);
    const auto result = CaseRunner(campaign).run(index_, workers_stop(), {});
    if (!result) throw WasEnded();
    const RowResult row(result->row);
    if (row.could_not_be_run) throw NoRun(fmt::format("case {} with {} = {}: {}", index_, axis_, text, row.error));
    ++runs_;
    return {value, text, result->exit_code == 0};
  }

  // Moves the two points, of which one passes and one fails, to a distance of at most `tolerance`. Tries whole
  // numbers only once the key has refused a fraction between two whole numbers.
  void halve(AxisPoint& low, AxisPoint& high, double tolerance) {
    const bool may_be_whole = is_whole_number(low.value) && is_whole_number(high.value);
    bool is_whole = false;
    while (high.value - low.value > tolerance) {
      const double half = low.value + (high.value - low.value) / 2;
      const std::string text = fmt::format("{:.12g}", is_whole ? std::floor(half) : half);
      const double value = number_in<double>(text).value_or(half);
      if (value <= low.value || value >= high.value) return;
      try {
        AxisPoint middle = tried(value, text);
        (middle.passes == low.passes ? low : high) = std::move(middle);
      } catch (const NoRun&) {
        if (is_whole || !may_be_whole || is_whole_number(value)) throw;
        is_whole = true;
      }
    }
  }

  const Campaign& campaign_;
  const std::string axis_;
  const std::uint64_t index_;
  std::uint64_t runs_ = 0;
};

// Returns the values of an axis in ascending order. Throws OpenError unless the axis has at least two values, all of
// them numbers.
std::vector<AxisPoint> ordered_values(const Campaign& campaign, const std::string& name) {
  const auto axis = std::ranges::find(campaign.axes, name, &CampaignAxis::name);
  if (axis == campaign.axes.end()) {
    std::vector<std::string> names;
    for (const CampaignAxis& one : campaign.axes) names.push_back(one.name);
    throw OpenError(fmt::format("--axis {}: the plan has no such axis, but {}", name,
                                names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "))));
  }
  std::vector<AxisPoint> values;
  for (const CampaignAxis::Value& value : axis->values)
    if (const auto number = number_in<double>(value.text)) values.push_back({*number, value.text});
  if (values.size() != axis->values.size() || values.size() < 2)
    throw OpenError(fmt::format("--axis {}: give an axis of two numbers or more", name));
  std::ranges::sort(values, {}, &AxisPoint::value);
  return values;
}

// Returns the cases with the first value of an axis: one case for each combination of the other values.
std::vector<std::uint64_t> combinations(const Campaign& campaign, const std::string& name) {
  constexpr std::uint64_t most = 100'000;
  const auto axis = std::ranges::find(campaign.axes, name, &CampaignAxis::name);
  const auto size = static_cast<std::uint64_t>(axis->values.size());
  if (campaign.cases() / size > most)
    throw OpenError(fmt::format("{}: there are {} combinations beside the axis; give one of them by --case",
                                campaign.file, campaign.cases() / size));
  std::uint64_t stride = campaign.cases();
  for (auto one = campaign.axes.begin(); one <= axis; ++one) stride /= one->values.size();
  std::vector<std::uint64_t> all;
  for (std::uint64_t i = 0; i < campaign.cases() / size; ++i) all.push_back(i / stride * stride * size + i % stride);
  return all;
}

}  // namespace

int bisect_campaign(const std::string& plan_or_folder, const CampaignBisectOptions& options) {
  const Campaign campaign =
      ResultFolder::is_at(plan_or_folder) ? campaign_of(ResultFolder(plan_or_folder)) : read_campaign(plan_or_folder);
  const std::vector<AxisPoint> values = ordered_values(campaign, options.axis);
  if (options.index && *options.index >= campaign.cases())
    throw OpenError(fmt::format("{}: there is no case {}: they are 0 to {}", plan_or_folder, *options.index,
                                campaign.cases() - 1));
  const std::vector<std::uint64_t> cases =
      options.index ? std::vector{*options.index} : combinations(campaign, options.axis);
  std::map<std::size_t, std::string> waiting;  // texts of items after `next`, which is not done
  std::size_t next = 0;
  TextFile output("-");
  ProgressLine progress(true);
  const auto work = [&](std::size_t item) {
    try {
      return AxisSearch(campaign, options.axis, cases[item]).run(values, options.tolerance, plan_or_folder);
    } catch (const WasEnded&) {
      return std::string();
    }
  };
  const auto take = [&](std::size_t item, std::string text) {
    if (text.empty()) return;
    std::ranges::replace(text, '\r', '\n');
    waiting.emplace(item, std::move(text));
    progress.clear();
    for (auto one = waiting.begin(); one != waiting.end() && one->first == next; one = waiting.erase(one), ++next)
      output.write(one->second + "\n");
  };
  const unsigned jobs = options.jobs > 0 ? options.jobs : usable_processors();
  const bool is_whole = run_workers(
      {.jobs = jobs, .work = work, .take = take, .tick = [&] { progress.show(next, cases.size(), "combinations"); }},
      cases.size());
  progress.clear();
  return is_whole ? 0 : 3;
}

}  // namespace imud
