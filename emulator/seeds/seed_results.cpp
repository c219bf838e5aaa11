#include "emulator/seeds/seed_results.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "emulator/faults/fault_labels.hpp"
#include "emulator/ground/exit_code.hpp"

namespace imud {

using Json = nlohmann::ordered_json;

bool SeedResults::add(const std::string& text) {
  bool are_whole = true;
  for (Json& summary : Json::parse(text)) are_whole = add_run(std::move(summary)) && are_whole;
  return are_whole;
}

// Adds the faults that have begun in no part of a run to the summary of the run's last part.
void SeedResults::judge_faults(std::uint64_t seed, Json& summary) {
  Begun& run = begun_[seed];
  run.occurrences.resize(faults_.size());
  const Json &ended_by = summary.at("ended_by"), &faults = summary.at("faults");
  run.is_whole = run.is_whole && (ended_by == "end_of_capture" || ended_by == "for");
  for (std::size_t i = 0; i < faults_.size(); ++i)
    run.occurrences[i] += faults.at(i).at("occurrences").get<std::uint64_t>();
  if (++run.parts < parts_) return;
  for (std::size_t i = 0; i < faults_.size() && run.is_whole; ++i) {
    const std::string text = FaultOutcome(faults_[i], run.occurrences[i]).shortfall();
    if (text.empty()) continue;
    summary["shortfalls"].push_back(text);
    summary["complete"] = false;
    summary["exit_code"] = worse_exit_code(summary["exit_code"], 3);
  }
  begun_.erase(seed);
}

bool SeedResults::add_run(Json summary) {
  constexpr std::uint64_t most_shortfalls = 10;  // more shortfalls are not logged
  const auto seed = summary.at("seed").get<std::uint64_t>();
  const bool is_whole = summary.at("ended_by") != "signal";
  if (!std::exchange(has_remarks_, true) && summary.at("truth").contains("remarks"))
    for (const Json& remark : summary["truth"]["remarks"]) spdlog::warn("truth: {}", remark.get<std::string>());
  if (const auto labels = summary.find("labels"); labels != summary.end()) {
    labels_[{seed, labels->at("part")}] = labels->at("text");
    summary.erase(labels);
  }
  if (parts_ > 1) judge_faults(seed, summary);
  exit_code_ = worse_exit_code(exit_code_, summary.at("exit_code"));
  for (const Json& imu : summary.at("imus")) samples_ += imu.at("samples").get<std::uint64_t>();
  for (const Json& shortfall : summary.at("shortfalls"))
    if (++shortfalls_ <= most_shortfalls)
      spdlog::error("seed {} is incomplete: {}", seed, shortfall.get<std::string>());
  for (const Json& limit : summary.at("required"))
    if (!limit.at("holds").get<bool>() && ++shortfalls_ <= most_shortfalls)
      spdlog::error("seed {}: required {}, but it is {}", seed, limit.at("limit").get<std::string>(),
                    limit.at("seen").get<std::uint64_t>());
  for (const Json& one : summary.at("expected"))
    if (!one.at("holds").get<bool>() && ++shortfalls_ <= most_shortfalls)
      spdlog::error("seed {}: expected {}: {}; {}", seed, one.at("name").get<std::string>(),
                    one.at("text").get<std::string>(), one.at("seen").get<std::string>());

  if (!keeps_) return is_whole;
  Json& whole = by_seed_[seed];
  if (whole.is_null()) {
    whole = std::move(summary);
    return is_whole;
  }
  whole["exit_code"] = worse_exit_code(whole["exit_code"], summary["exit_code"]);
  whole["complete"] = whole["complete"].get<bool>() && summary["complete"].get<bool>();
  for (Json& shortfall : summary["shortfalls"])
    if (std::find(whole["shortfalls"].begin(), whole["shortfalls"].end(), shortfall) == whole["shortfalls"].end())
      whole["shortfalls"].push_back(std::move(shortfall));
  for (std::size_t i = 0; i < faults_.size(); ++i) {
    Json &fault = whole["faults"][i], &of_part = summary["faults"][i];
    fault["occurrences"] = fault["occurrences"].get<std::uint64_t>() + of_part["occurrences"].get<std::uint64_t>();
    fault["began"] = fault["began"].get<bool>() || of_part["began"].get<bool>();
  }
  for (Json& imu : summary["imus"]) whole["imus"].push_back(std::move(imu));
  return is_whole;
}

std::string SeedResults::labels(bool as_json) const {
  if (as_json) {
    Json all = Json::array();
    for (const auto& [of, text] : labels_)
      for (Json& label : Json::parse(text)) all.push_back(std::move(label));
    return all.dump(1) + "\n";
  }
  std::string all;
  for (const auto& [of, text] : labels_) all += all.empty() ? text : text.substr(text.find('\n') + 1);
  return all;
}

}  // namespace imud
