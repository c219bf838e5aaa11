#include "emulator/campaign/cases/case_figures.hpp"

#include <fmt/format.h>

#include <string_view>

namespace imud {

namespace {

using Figures = nlohmann::ordered_json;

template <class Group>
void add_group(Figures& figures, std::string_view prefix, const Snapshot<Group>& snapshot) {
  const auto& declared = snapshot.declared().counters;
  for (std::size_t i = 0; i < declared.size(); ++i)
    if (const CounterInfo& info = declared[i]->info; snapshot.counts[i] > 0 || info.summary == Show::always)
      figures[fmt::format("{}{}", prefix, info.key)] = snapshot.counts[i];
}

// Names the numbers of a term: one, the three of a vector, or the nine of a matrix, row by row.
std::string name_of(std::string_view term, std::size_t number, std::size_t numbers) {
  constexpr std::string_view axes = "xyz";
  if (numbers == axes.size()) return fmt::format("{}_{}", term, axes[number]);
  if (numbers == axes.size() * axes.size()) return fmt::format("{}_{}{}", term, axes[number / 3], axes[number % 3]);
  return numbers == 1 ? std::string(term) : fmt::format("{}_{}", term, number);
}

}  // namespace

nlohmann::ordered_json case_figures(const Summary& summary) {
  Figures figures = {{"simulated_s", summary.simulated_s}};
  add_group(figures, "truth.", summary.truth.counters);
  figures["truth.refused"] = summary.truth.refused.total();
  add_group(figures, "truth.refused.", summary.truth.refused);
  add_group(figures, "truth.", summary.truth.quality);
  for (const Summary::Imu& imu : summary.imus) {
    const std::string prefix = imu.name + ".";
    add_group(figures, prefix, imu.counters);
    for (const DeviceCount& figure : imu.device) figures[prefix + std::string(figure.key)] = figure.count;
    if (const DurationHistogram& lateness = imu.counters[&ImuCounters::lateness]; lateness.count() > 0) {
      constexpr double percent = 99, us_per_s = 1e6;
      figures[prefix + "lateness_us.p99"] = us_per_s * lateness.percentile(percent);
      figures[prefix + "lateness_us.max"] = us_per_s * lateness.max();
    }
    for (const DrawnTerms& drawn : imu.drawn)
      for (const auto& [term, values] : drawn.terms)
        for (std::size_t i = 0; i < values.size(); ++i)
          figures[fmt::format("{}{}.{}.{}", prefix, drawn.sensor, drawn.layer, name_of(term, i, values.size()))] =
              values[i];
  }
  return figures;
}

}  // namespace imud
