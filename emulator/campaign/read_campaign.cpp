#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string_view>
#include <utility>

#include "emulator/campaign/axes.hpp"
#include "emulator/campaign/campaign.hpp"
#include "emulator/campaign/shards/program_build.hpp"
#include "emulator/campaign/shards/stop_rule.hpp"
#include "emulator/config/config_text.hpp"

namespace imud {
namespace {

// Reads a list of texts, or one text. Empty if absent.
std::vector<std::string> texts_in(TableReader& table, std::string_view key) {
  const toml::node* node = table.node(key);
  std::vector<std::string> all;
  if (node == nullptr) return all;
  if (const auto* text = node->as_string()) return {text->get()};
  const toml::array* list = node->as_array();
  if (list == nullptr || !(list->empty() || list->is_homogeneous<std::string>())) {
    table.fault(key, "give a list of texts in quotes");
    return all;
  }
  for (const toml::node& item : *list) all.push_back(item.as_string()->get());
  return all;
}

std::string file_in(TableReader& table, std::string_view key, const std::string& folder, const std::string& text) {
  if (text.empty()) return {};
  std::string path = path_from_plan(folder, text);
  if (const std::string missing = missing_file(path); !missing.empty()) table.fault(key, missing);
  return path;
}

bool is_utf8(const std::string& text) {
  try {
    static_cast<void>(nlohmann::json(text).dump());
    return true;
  } catch (const nlohmann::json::type_error&) {
    return false;
  }
}

SeedRange read_seeds(TableReader& table) {
  const toml::node* node = table.node("seeds");
  std::string text = "1";
  if (node != nullptr && node->is_integer())
    text = toml_value(*node);
  else
    text = table.text("seeds", text);
  const auto seeds = SeedRange::parse(text);
  if (!seeds) table.fault("seeds", "give a seed, or a range of at most ten million in quotes, such as \"1..1000\"");
  return seeds.value_or(SeedRange());
}

std::optional<CampaignDraws> read_draws(TableReader table, const toml::node* node, Faults& faults) {
  if (node == nullptr || !node->is_table()) return std::nullopt;
  CampaignDraws draws;
  draws.line = node->source().begin.line;
  require(table, "count", "the number of draws");
  draws.plan.count = table.unsigned_integer("count", 1, DrawPlan::most);
  if (draws.plan.count == 0) table.fault("count", fmt::format("give 1 to {} draws", DrawPlan::most));
  draws.plan.seed = table.unsigned_integer("seed", draws.plan.seed, ~std::uint64_t{0});
  draws.plan.method = table.choice<DrawMethod>("method", draw_method_words, DrawMethod::random);
  const toml::node* keys = table.node("keys");
  const auto is_distribution = [](const toml::table& one) {
    return one.contains("distribution") ||
           std::ranges::none_of(one, [](const auto& entry) { return entry.second.is_table(); });
  };
  if (keys == nullptr || !keys->is_table() || keys->as_table()->empty()) {
    table.fault("keys", "give a table, [draws.keys], of KEY = {distribution = .., ..}");
  } else {
    toml::table unused;
    for (const auto& [key, value, line] : entries_of(*keys->as_table(), is_distribution)) {
      const std::string path = "draws.keys." + key;
      std::string objection = name_objection(key);
      if (key == "capture" || key == "scenario") objection = "is no number; give it as an axis";
      if (!value->is_table()) objection = "give a table, such as {distribution = \"normal\", standard_deviation = 1}";
      if (!objection.empty()) {
        faults.add(line, path, objection);
        continue;
      }
      TableReader reader(value->as_table(), path + ".", line, faults, unused);
      const std::size_t before = faults.all().size();
      Distribution distribution(reader);
      if (faults.all().size() == before && draws.plan.count > 0)
        draws.keys.emplace_back(key, std::move(distribution), draws.plan);
    }
  }
  table.finish();
  return draws;
}

// Returns the names of the imus in the base configuration. Returns none if this file cannot be read: try_cases()
// reports it.
std::vector<std::string> names_of_imus(const Campaign& campaign) {
  std::vector<std::string> names;
  Faults unused("");
  try {
    const ConfigText base = read_config_text(campaign.base, campaign.overrides, unused);
    if (const toml::array* imus = base.root["imu"].as_array())
      for (const toml::node& imu : *imus) {
        const std::string by_number = fmt::format("imu{}", names.size() + 1);
        const toml::table* table = imu.as_table();
        names.push_back(table == nullptr ? by_number : (*table)["name"].value_or(by_number));
      }
  } catch (const ConfigError&) {
    return {};
  }
  return names;
}

// Returns a key with the number of the imu in place of its name, for each imu that it sets.
std::vector<std::string> keys_by_number(const std::string& key, const std::vector<std::string>& imus) {
  constexpr std::string_view prefix = "imu.";
  if (!key.starts_with(prefix)) return {key};
  const std::string_view path = std::string_view(key).substr(prefix.size());
  std::vector<std::string> all;
  for (std::size_t i = 0; i < imus.size(); ++i)
    for (const std::string& step : {std::string("*"), fmt::to_string(i), imus[i]})
      if (path.starts_with(step + ".")) {
        all.push_back(fmt::format("imu.{}.{}", i, path.substr(step.size() + 1)));
        break;
      }
  return all.empty() ? std::vector{key} : all;
}

// Adds a fault for each name that two axes share, and for each key that two axes set. A key may be spelt with the
// number or with the name of an imu.
void check_names(const Campaign& campaign, Faults& faults) {
  const std::vector<std::string> imus = names_of_imus(campaign);
  std::map<std::string, std::string> owners;  // by name or key: the axis
  const auto claim = [&](const std::string& name, const std::string& owner, std::uint32_t line) {
    bool is_said = false;
    for (const std::string& key : keys_by_number(name, imus)) {
      const auto [at, is_new] = owners.emplace(key, owner);
      if (!is_new && at->second != owner && !std::exchange(is_said, true))
        faults.add(line, owner, fmt::format("{} is varied by {}, too; give it once", name, at->second));
    }
  };
  for (const CampaignAxis& axis : campaign.axes) {
    const std::string owner = "axes." + axis.name;
    if (const auto same = std::ranges::find(campaign.axes, axis.name, &CampaignAxis::name); same->line != axis.line)
      faults.add(axis.line, owner, fmt::format("is given in line {}, too; give it once", same->line));
    std::set<std::string> keys = {axis.name};
    for (const CampaignAxis::Value& value : axis.values)
      for (const std::string& one : value.overrides) keys.insert(one.substr(0, one.find('=')));
    for (const std::string& key : keys) claim(key, owner, axis.line);
  }
  if (!campaign.draws) return;
  for (const DrawnKey& drawn : campaign.draws->keys) {
    const std::string owner = "draws.keys." + drawn.key(), assignment = override_of(drawn.key(), "");
    claim(assignment.substr(0, assignment.size() - 1), owner, campaign.draws->line);
  }
}

void check_size(const Campaign& campaign, Faults& faults) {
  double product = static_cast<double>(campaign.seeds.size());
  std::vector<std::string> factors;
  for (const CampaignAxis& axis : campaign.axes) {
    product *= static_cast<double>(axis.values.size());
    factors.push_back(fmt::format("{} {}", axis.values.size(), axis.name));
  }
  if (campaign.draws) {
    product *= static_cast<double>(campaign.draws->plan.count);
    factors.push_back(fmt::format("{} draws", campaign.draws->plan.count));
  }
  factors.push_back(fmt::format("{} seeds", campaign.seeds.size()));
  if (product > static_cast<double>(Campaign::most_cases))
    faults.add(0, "plan",
               fmt::format("has {:.3g} cases ({}), more than {}; divide it", product, fmt::join(factors, " x "),
                           Campaign::most_cases));
}

// Reads `until`. The interval of the rule holds only for cases that are drawn independently from one distribution: no
// axis may have several values, and several draws must have one seed each.
std::string read_until(TableReader& plan, const Campaign& campaign) {
  std::string text = plan.text("until", "");
  if (text.empty()) return text;
  if (!StopRule::parse(text))
    plan.fault("until",
               "give \"cases pass rate within 1 % at 95 %\", or the name of an expectation in place of cases; the "
               "half width is below 50 %");
  for (const CampaignAxis& axis : campaign.axes)
    if (axis.values.size() > 1)
      plan.fault("until",
                 fmt::format("the first cases have the first value of {} alone, which says nothing about the others; "
                             "give one value, and a plan for each other, or [draws]",
                             axis.name));
  if (campaign.draws && campaign.draws->plan.count > 1 && campaign.seeds.size() > 1)
    plan.fault("until", "cases with the same draw are not independent; give as many draws as cases, and one seed");
  return text;
}

constexpr auto test_clock_words =
    std::to_array<Word<ClockMode>>({{ClockMode::fast, "fast"}, {ClockMode::realtime, "realtime"}});

CampaignTest read_test(TableReader table) {
  CampaignTest test;
  require(table, "command", "the command that is started for each case, such as \"./estimator {port}\"");
  test.command = table.text("command", "");
  if (is_text(table, "command") && test.command.empty()) table.fault("command", "give a command");
  test.clock = table.choice<ClockMode>("clock", test_clock_words, test.clock);
  test.time_limit_s = table.real("time_limit_s", test.time_limit_s, 1e-3, 1e7);
  test.settle_s = table.real("settle_s", test.settle_s, 0, 3600);
  if (test.settle_s >= test.time_limit_s)
    table.fault("settle_s",
                fmt::format("give a time before time_limit_s, {:g}, which counts from the command's start",
                            test.time_limit_s));
  table.finish();
  return test;
}

CampaignSlurm read_slurm(TableReader table) {
  CampaignSlurm slurm;
  slurm.partition = table.text("partition", "");
  slurm.account = table.text("account", "");
  slurm.time_limit = table.text("time_limit", "");
  constexpr unsigned most = 1'000'000;
  slurm.max_running = static_cast<unsigned>(table.unsigned_integer("max_running", 0, most));
  slurm.options = texts_in(table, "options");
  table.finish();
  return slurm;
}

}  // namespace

Campaign read_campaign(const std::string& path) {
  if (path == "-") throw ConfigError({"-: each process of a campaign reads the plan; give a file"});
  Faults faults(path);
  const ConfigText text = read_config_text(path, {}, faults);
  toml::table unused;
  TableReader plan(&text.root, "", 0, faults, unused);
  Campaign campaign;
  campaign.file = std::filesystem::absolute(path).lexically_normal().string();
  campaign.sha256 = text.sha256;
  campaign.build = program_build();
  if (!is_utf8(campaign.file))
    throw ConfigError({fmt::format("{}: its path must be UTF-8, as the results have it; rename the folder", path)});
  const std::string folder = std::filesystem::path(campaign.file).parent_path().string();
  require(plan, "base", "the configuration of all cases, for example \"imud.toml\"");
  campaign.base = file_in(plan, "base", folder, plan.text("base", ""));
  campaign.capture = file_in(plan, "capture", folder, plan.text("capture", ""));
  for (const std::string& scenario : texts_in(plan, "scenario"))
    campaign.scenarios.push_back(file_in(plan, "scenario", folder, scenario));
  campaign.overrides = texts_in(plan, "set");
  campaign.seeds = read_seeds(plan);
  campaign.batch = plan.unsigned_integer("batch", 0, Campaign::most_cases);
  campaign.integrated_errors = plan.flag("integrated_errors", campaign.integrated_errors);
  campaign.errors_every_s = plan.real("integrated_errors_every_s", 0, 1e-3, 1e6);
  if (campaign.errors_every_s > 0 && !campaign.integrated_errors)
    plan.fault("integrated_errors_every_s", "needs integrated_errors = true");
  campaign.arrays = plan.unsigned_integer("arrays", 0, Campaign::most_array_rows);
  campaign.axes = read_axes(plan.node("axes"), folder, faults);
  campaign.draws = read_draws(plan.child("draws"), text.root.get("draws"), faults);
  if (plan.has("test")) campaign.test = read_test(plan.child("test"));
  campaign.slurm = read_slurm(plan.child("slurm"));
  campaign.until = read_until(plan, campaign);
  const bool varies_capture = std::ranges::any_of(campaign.axes, [](const CampaignAxis& axis) {
    return std::ranges::all_of(axis.values, [](const auto& value) { return !value.capture.empty(); });
  });
  if (campaign.capture.empty() && !plan.has("capture") && !varies_capture)
    plan.fault("capture", "missing; give the truth that all cases replay, for example \"flight.pcap\", or an axis");
  check_names(campaign, faults);
  check_size(campaign, faults);
  plan.finish();
  if (!faults.all().empty()) throw ConfigError(faults.all());
  return campaign;
}

}  // namespace imud
