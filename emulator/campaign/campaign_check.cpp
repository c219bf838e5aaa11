#include "emulator/campaign/campaign_check.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>
#include <utility>

#include "emulator/drive/assembly.hpp"

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

  // Loads the configuration of a case; `what` varies in it. Adds a fault for each that no case before has had.
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

}  // namespace imud
