#include "emulator/campaign/campaign_check.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "emulator/campaign/case_cost.hpp"
#include "emulator/drive/assembly.hpp"
#include "emulator/ground/plural.hpp"

namespace imud {
namespace {

constexpr std::uint64_t most_values_tried = 1000, most_draws_tried = 32, most_combinations = 32;

// Returns numbers below `size` at equal distances, the first and the last among them: at most `most`, which is
// above 1.
std::vector<std::uint64_t> spread(std::uint64_t size, std::uint64_t most) {
  std::vector<std::uint64_t> all;
  const std::uint64_t count = std::min(size, most);
  for (std::uint64_t i = 0; i < count; ++i) all.push_back(count == 1 ? 0 : i * (size - 1) / (count - 1));
  return all;
}

// Returns the draws with the least and the greatest value of each key, and others at equal distances.
std::set<std::uint64_t> draws_to_try(const CampaignDraws& draws) {
  const std::vector<std::uint64_t> others = spread(draws.plan.count, most_draws_tried);
  std::set<std::uint64_t> all(others.begin(), others.end());
  for (const DrawnKey& drawn : draws.keys)
    for (std::size_t component = 0; component < drawn.size(); ++component) {
      std::pair<double, std::uint64_t> least{2, 0}, greatest{-1, 0};  // a share, and the draw that has it
      for (std::uint64_t i = 0; i < draws.plan.count; ++i) {
        const std::pair one(drawn.share(i, component), i);
        least = std::min(least, one);
        greatest = std::max(greatest, one);
      }
      all.insert({least.second, greatest.second});
    }
  return all;
}

class Trial {
 public:
  explicit Trial(const Campaign& campaign) : campaign_(campaign) {}

  // Loads the configuration of a case; `what` describes the values that it tries. Adds the faults that no earlier
  // case had.
  void attempt(std::uint64_t index, std::uint32_t line, const std::string& what) {
    if (!tried_.insert(index).second) return;
    try {
      Assembly(load_case(campaign_, case_of(campaign_, index)), no_ports);
    } catch (const ConfigError& error) {
      for (const std::string& fault : error.faults) add(index, line, what, fault);
    } catch (const std::exception& error) {
      add(index, line, what, error.what());
    }
  }
  void finish() const {
    if (!faults_.empty()) throw ConfigError(faults_);
  }

 private:
  void add(std::uint64_t index, std::uint32_t line, const std::string& what, const std::string& fault) {
    if (!reasons_.insert(fault).second) return;
    const std::string place = line == 0 ? campaign_.file : fmt::format("{}:{}", campaign_.file, line);
    faults_.push_back(fmt::format("{}: {} (case {}): {}", place, what, index, fault));
  }

  const Campaign& campaign_;
  std::set<std::uint64_t> tried_;
  std::set<std::string> reasons_;
  std::vector<std::string> faults_;
};

// Returns "NAME=TEXT NAME=TEXT" of the case.
std::string description(const Campaign& campaign, std::uint64_t index) {
  std::vector<std::string> parts;
  for (const auto& [name, text] : columns_of(campaign, case_of(campaign, index)))
    parts.push_back(fmt::format("{}={}", name, text));
  return parts.empty() ? "the configuration" : fmt::format("{}", fmt::join(parts, " "));
}

void print_axes(const Campaign& campaign) {
  std::vector<std::string> factors;
  for (const CampaignAxis& axis : campaign.axes) factors.push_back(fmt::to_string(axis.values.size()));
  if (campaign.draws) factors.push_back(fmt::format("{} draws", campaign.draws->plan.count));
  factors.push_back(plural(campaign.seeds.size(), "seed"));
  fmt::print("{:<8} {}: {}\n", "cases", campaign.cases(), fmt::join(factors, " x "));
  constexpr std::size_t most_shown = 6;
  for (const CampaignAxis& axis : campaign.axes) {
    std::vector<std::string> texts;
    for (const CampaignAxis::Value& value : axis.values)
      if (texts.size() < most_shown) texts.push_back(value.text.empty() ? "none" : value.text);
    if (axis.values.size() > most_shown) texts.push_back(fmt::format(".., {}", axis.values.back().text));
    fmt::print("{:<8} {}: {}\n", "axis", axis.name, fmt::join(texts, ", "));
  }
  if (campaign.draws) {
    const DrawPlan& plan = campaign.draws->plan;
    std::vector<std::string> keys;
    for (const DrawnKey& drawn : campaign.draws->keys) keys.push_back(drawn.key());
    fmt::print("{:<8} {}, {}, seed {}: {}\n", "draws", plan.count, word_of(draw_method_words, plan.method), plan.seed,
               fmt::join(keys, ", "));
  }
  if (!campaign.until.empty()) fmt::print("{:<8} {}; else all cases\n", "until", campaign.until);
  fmt::print("{:<8} {}..{}\n", "seeds", campaign.seeds.first, campaign.seeds.last);
}

// Returns "4.2 min".
std::string rough_time(double time_s) {
  constexpr double minute = 60, hour = 3600, day = 86400;
  if (time_s < 2 * minute) return fmt::format("{:.3g} s", time_s);
  if (time_s < 2 * hour) return fmt::format("{:.3g} min", time_s / minute);
  if (time_s < 2 * day) return fmt::format("{:.3g} h", time_s / hour);
  return fmt::format("{:.3g} days", time_s / day);
}

std::string rough_size(double bytes) {
  constexpr double k = 1e3;
  if (bytes < k) return fmt::format("{:.3g} bytes", bytes);
  if (bytes < k * k) return fmt::format("{:.3g} kB", bytes / k);
  if (bytes < k * k * k) return fmt::format("{:.3g} MB", bytes / k / k);
  return fmt::format("{:.3g} GB", bytes / k / k / k);
}

void print_cost(const Campaign& campaign) {
  const CampaignCost cost = measure_cases(campaign);
  const auto cases = static_cast<double>(campaign.cases());
  const bool is_paced = campaign.test && campaign.test->clock == ClockMode::realtime;
  const double rounds = cases / cost.processors;  // more processors do not shorten a case in real time
  const double all_s = cost.case_s * (is_paced ? std::ceil(rounds) : rounds);
  fmt::print("{:<8} {}{} a case ({}: case{} {}), {}{} for all {} the {} here{}\n", "time",
             cost.is_cut ? "more than " : "", rough_time(cost.case_s), is_paced ? "by the capture" : "measured",
             cost.cases.size() == 1 ? "" : "s", fmt::join(cost.cases, ", "), cost.is_cut ? "more than " : "",
             rough_time(all_s), is_paced ? "in as many processes as" : "on", plural(cost.processors, "processor"),
             campaign.test ? ", without [test]" : "");
  fmt::print("{:<8} {} a case, {} for all\n", "results", rough_size(cost.row_bytes),
             rough_size(cost.row_bytes * cases));
}

}  // namespace

TriedCases try_cases(const Campaign& campaign) {
  TriedCases tried;
  Trial trial(campaign);
  trial.attempt(0, 0, description(campaign, 0));
  const std::uint64_t of_draw = campaign.seeds.size();
  std::uint64_t stride = campaign.cases();
  for (const CampaignAxis& axis : campaign.axes) {
    stride /= axis.values.size();
    for (const std::uint64_t value : spread(axis.values.size(), most_values_tried)) {
      trial.attempt(value * stride, axis.line, fmt::format("axes.{}: {}", axis.name, axis.values[value].text));
      ++tried.values;
    }
    tried.all_values += axis.values.size();
  }
  if (campaign.draws)
    for (const std::uint64_t draw : draws_to_try(*campaign.draws)) {
      trial.attempt(draw * of_draw, campaign.draws->line, description(campaign, draw * of_draw));
      ++tried.draws;
    }
  for (const std::uint64_t i : spread(campaign.cases() / of_draw, most_combinations)) {
    trial.attempt(i * of_draw, 0, description(campaign, i * of_draw));
    ++tried.combinations;
  }
  trial.finish();
  return tried;
}

int campaign_check(const std::string& plan) {
  const Campaign campaign = read_campaign(plan);
  const TriedCases tried = try_cases(campaign);
  fmt::print("{}: good\n", plan);
  print_axes(campaign);
  fmt::print("{:<8} {} of {} values, each beside the first values of the other axes; {} draws; {} combinations\n",
             "tried", tried.values, tried.all_values, tried.draws, tried.combinations);
  print_cost(campaign);
  return 0;
}

}  // namespace imud
