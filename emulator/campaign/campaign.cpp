#include "emulator/campaign/campaign.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "emulator/campaign/axes.hpp"
#include "emulator/campaign/shards/stop_rule.hpp"
#include "emulator/truth/capture_check.hpp"

namespace imud {

namespace {

// Throws ConfigError if the command of [test] has no line to read, or is killed before the capture ends.
void check_test(const Campaign& campaign, const Config& config) {
  if (std::ranges::none_of(config.imus, [](const ImuConfig& imu) { return imu.protocol->link == Link::bytes; }))
    throw ConfigError(
        {fmt::format("{}: test: {{port}} is a serial line, and the protocols of all imus are of CAN; give an imu the "
                     "protocol of a serial line, or test a driver of CAN by imud run on a bus, a run at a time",
                     campaign.file)});
  if (campaign.test->clock != ClockMode::realtime) return;
  const double capture_s = capture_length(config).length_s;
  if (const double least_s = campaign.test->settle_s + capture_s; campaign.test->time_limit_s <= least_s)
    throw ConfigError(
        {fmt::format("{}: test.time_limit_s: give more than {:.6g} s: by the clock \"realtime\" a case takes the "
                     "{:.6g} s of its capture, after settle_s, {:g}",
                     campaign.file, least_s, capture_s, campaign.test->settle_s)});
}

}  // namespace

std::uint64_t Campaign::cases() const noexcept {
  std::uint64_t product = seeds.size() * (draws ? draws->plan.count : 1);
  for (const CampaignAxis& axis : axes) product *= axis.values.size();
  return product;
}

std::size_t error_figures(const Campaign& campaign, const Config& config) {
  constexpr std::size_t of_imu = 6;
  if (!campaign.integrated_errors) return 0;
  const double instants =
      campaign.errors_every_s > 0 ? std::floor(capture_length(config).length_s / campaign.errors_every_s) : 0;
  return of_imu * config.imus.size() * (1 + static_cast<std::size_t>(instants));
}

ArrayShape arrays_of(const Campaign& campaign) {
  if (campaign.arrays == 0) return {};
  ArrayShape shape{.rows = campaign.arrays};
  for (const ImuConfig& imu : config_of(campaign, case_of(campaign, 0)).imus) shape.imus.push_back(imu.name);
  for (const CampaignAxis& axis : campaign.axes) {
    auto& dimension = shape.dimensions.emplace_back(ArrayShape::Dimension{.name = axis.name});
    for (const CampaignAxis::Value& value : axis.values) dimension.values.push_back(value.text);
  }
  if (campaign.draws) shape.dimensions.push_back({.name = "draw", .first = 0, .count = campaign.draws->plan.count});
  shape.dimensions.push_back({.name = "seed", .first = campaign.seeds.first, .count = campaign.seeds.size()});
  return shape;
}

std::uint64_t array_bytes(const Campaign& campaign, const Config& config) {
  return config.imus.size() * ArrayShape{.rows = campaign.arrays}.block_bytes();
}

CampaignCase case_of(const Campaign& campaign, std::uint64_t index) {
  if (index >= campaign.cases())
    throw std::out_of_range(
        fmt::format("{}: there is no case {}: they are 0 to {}", campaign.file, index, campaign.cases() - 1));
  CampaignCase c{.index = index,
                 .seed = campaign.seeds.first + index % campaign.seeds.size(),
                 .at = std::vector<std::size_t>(campaign.axes.size()),
                 .draw = std::nullopt,
                 .capture = campaign.capture,
                 .overrides = campaign.overrides,
                 .scenarios = campaign.scenarios};
  index /= campaign.seeds.size();
  if (campaign.draws) {
    c.draw = index % campaign.draws->plan.count;
    index /= campaign.draws->plan.count;
  }
  for (std::size_t i = campaign.axes.size(); i-- > 0;) {
    c.at[i] = index % campaign.axes[i].values.size();
    index /= campaign.axes[i].values.size();
  }
  for (std::size_t i = 0; i < campaign.axes.size(); ++i) {
    const CampaignAxis::Value& value = campaign.axes[i].values[c.at[i]];
    if (!value.capture.empty()) c.capture = value.capture;
    c.overrides.insert(c.overrides.end(), value.overrides.begin(), value.overrides.end());
    c.scenarios.insert(c.scenarios.end(), value.scenarios.begin(), value.scenarios.end());
  }
  if (campaign.draws)
    for (const DrawnKey& drawn : campaign.draws->keys)
      c.overrides.push_back(override_of(drawn.key(), drawn.text(*c.draw)));
  return c;
}

std::vector<std::pair<std::string, std::string>> columns_of(const Campaign& campaign, const CampaignCase& c) {
  std::vector<std::pair<std::string, std::string>> columns;
  for (std::size_t i = 0; i < campaign.axes.size(); ++i)
    columns.emplace_back(campaign.axes[i].name, campaign.axes[i].values.at(c.at.at(i)).text);
  if (!c.draw || !campaign.draws) return columns;
  columns.emplace_back("draw", fmt::to_string(*c.draw));
  for (const DrawnKey& drawn : campaign.draws->keys)
    columns.emplace_back(drawn.key(), plain_text(drawn.text(*c.draw)));
  return columns;
}

Campaign with_axis_value(const Campaign& campaign, std::uint64_t index, const std::string& axis,
                         const std::string& text) {
  const auto found = std::ranges::find(campaign.axes, axis, &CampaignAxis::name);
  if (found == campaign.axes.end()) throw OpenError(fmt::format("--axis {}: the plan has no such axis", axis));
  const auto number = static_cast<std::size_t>(found - campaign.axes.begin());
  Campaign other = campaign;
  CampaignAxis::Value& value = other.axes[number].values[case_of(campaign, index).at[number]];
  if (value.overrides.size() != 1 || !value.overrides.front().starts_with(axis + "="))
    throw OpenError(fmt::format("--axis {}: give an axis that has the name of a key", axis));
  value.text = text;
  value.overrides = {override_of(axis, text)};
  return other;
}

Config load_case(const Campaign& campaign, const CampaignCase& c) {
  std::vector<std::string> overrides = c.overrides;
  overrides.push_back(fmt::format("seed=\"{}\"", c.seed));
  overrides.push_back(
      fmt::format("clock={}", word_of(clock_words, campaign.test ? campaign.test->clock : ClockMode::fast)));
  Config config = load_replay(campaign.base, overrides, c.capture, c.scenarios).config;
  const auto until = StopRule::parse(campaign.until);
  if (until && until->name != StopRule::all_cases &&
      std::ranges::find(config.expectations, until->name, &ExpectConfig::name) == config.expectations.end())
    throw ConfigError({fmt::format("{}: until: there is no expectation {}; give the name of an [[expect]], or cases",
                                   campaign.file, until->name)});
  if (campaign.test) check_test(campaign, config);
  constexpr std::size_t most_error_figures = 1500;  // a table has 2000 columns
  if (const std::size_t figures = error_figures(campaign, config); figures > most_error_figures)
    throw ConfigError(
        {fmt::format("{}: integrated_errors_every_s: gives {} figures, and a table has room for "
                     "{}; give a longer time",
                     campaign.file, figures, most_error_figures)});
  return config;
}

Config config_of(const Campaign& campaign, const CampaignCase& c) {
  try {
    return load_case(campaign, c);
  } catch (const ConfigError& error) {
    std::vector<std::string> faults;
    for (const std::string& fault : error.faults) faults.push_back(fmt::format("case {}: {}", c.index, fault));
    throw ConfigError(faults);
  }
}

}  // namespace imud
