// A soup of faults: all kinds on all targets at random, in epochs. The last two seconds of an epoch have no faults.
#pragma once

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "emulator/faults/fault_kinds.hpp"
#include "tests/emulator/sampled_run.hpp"

namespace imud {

class FaultSoup {
 public:
  static constexpr double epoch_s = 10;
  static constexpr int per_epoch = 50;

  // An imu that may fail. It must start without a delay. If the imu has settings, the faults must not make it lose
  // them, because no host would restore them.
  struct Target {
    std::string imu, protocol;
    bool has_settings = false;
  };
  FaultSoup(std::uint64_t seed, std::vector<Target> targets) : random_(seed), targets_(std::move(targets)) {}

  // Returns the faults of so many epochs; the kinds take turns.
  std::string text(int epochs) {
    std::string text;
    for (int i = 0; i < per_epoch * epochs; ++i) {
      if (deck_.empty()) shuffle();
      const auto [kind, target] = deck_.back();
      deck_.pop_back();
      text += fault(*kind, target, epoch_s * (i / per_epoch));
    }
    return text;
  }

 private:
  double uniform(double from, double to) {
    return from + static_cast<double>(random_() >> 11U) * 0x1p-53 * (to - from);
  }
  std::string imus_of(const FaultKind& kind, std::string_view target) {
    std::vector<std::string> all;
    for (const Target& one : targets_) {
      const bool can_be =
          fault_objection(kind, target, *find_protocol(one.protocol), Settings(find_protocol(one.protocol)->settings))
              .empty() &&
          (kind.name != "settings_lost" || !one.has_settings);
      if (can_be) all.push_back("\"" + one.imu + "\"");
    }
    if (all.empty()) return {};
    if (random_() % 2 == 0) all = {all[random_() % all.size()]};
    return fmt::format("{}", fmt::join(all, ", "));
  }
  void shuffle() {
    for (const FaultKind* kind : fault_kinds())
      for (const std::string_view target : kind->targets) deck_.emplace_back(kind, target);
    for (std::size_t i = deck_.size(); i > 1; --i) std::swap(deck_[i - 1], deck_[random_() % i]);
  }
  std::string fault(const FaultKind& kind, std::string_view target, double from_s) {
    const bool is_truth = kind.seam == FaultSeam::truth;
    const std::string imus = is_truth ? std::string() : imus_of(kind, target);
    if (!is_truth && imus.empty()) return {};
    const double for_s = uniform(0.01, 1);
    std::string text = fmt::format("[[fault]]\ntarget = \"{}\"\nkind = \"{}\"\nat_s = {}\n", target, kind.name,
                                   from_s + uniform(0, epoch_s - 3));
    if (!is_truth) text += fmt::format("imu = [{}]\n", imus);
    if (!kind.is_event) text += fmt::format("for_s = {}\n", for_s);
    if (kind.is_ramped) text += fmt::format("ramp_in_s = {}\nramp_out_s = {}\n", uniform(0, 1), uniform(0, 1));
    for (const FaultParameter& parameter : kind.parameters) text += number(kind, parameter);
    return text;
  }
  std::string number(const FaultKind& kind, const FaultParameter& parameter) {
    const std::string_view key = parameter.key;
    const double most = key.ends_with("per_s") || key == "value_ppm" ? 1000
                        : key.ends_with("_ms")                       ? 200
                        : key == "baud" || key == "bitrate"          ? 1e6
                        : key == "percent"                           ? 100
                        : kind.name == "slow_start"                  ? 0.5
                                                                     : 20;
    const double drawn = uniform(std::max(parameter.min, -most), std::min(parameter.max, most));
    return fmt::format("{} = {}\n", key, parameter.is_whole ? std::round(drawn) : drawn);
  }

  std::mt19937_64 random_;
  const std::vector<Target> targets_;
  std::vector<std::pair<const FaultKind*, std::string_view>> deck_;
};

}  // namespace imud
