#include "emulator/campaign/cases/draws.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <numeric>
#include <utility>

#include "core/numbers/random.hpp"

namespace imud {
namespace {

double uniform_of(const DrawPlan& plan, std::uint32_t stream, Process process, std::uint64_t draw) noexcept {
  return Normals(plan.seed, stream).uniform(Quantity::rate, process, draw);
}

// Returns a random permutation of 0 to count - 1: the rank of each draw's own random number among the numbers of all.
std::vector<std::uint32_t> random_ranks(const DrawPlan& plan, std::uint32_t stream) {
  std::vector<double> numbers(plan.count);
  for (std::uint64_t i = 0; i < plan.count; ++i) numbers[i] = uniform_of(plan, stream, Process::campaign_order, i);
  std::vector<std::uint32_t> order(plan.count), ranks(plan.count);
  std::iota(order.begin(), order.end(), 0U);
  std::ranges::stable_sort(order, {}, [&](std::uint32_t i) { return numbers[i]; });
  for (std::uint32_t rank = 0; rank < order.size(); ++rank) ranks[order[rank]] = rank;
  return ranks;
}

}  // namespace

DrawnKey::DrawnKey(std::string key, Distribution distribution, const DrawPlan& plan)
    : key_(std::move(key)), distribution_(std::move(distribution)), plan_(plan) {
  const std::size_t components = distribution_.components();
  for (std::size_t i = 0; i < std::max<std::size_t>(1, components); ++i) {
    streams_.push_back(stream_id(components == 0 ? key_ : fmt::format("{}[{}]", key_, i)));
    if (plan.method == DrawMethod::latin_hypercube)
      strata_.push_back(std::make_shared<const std::vector<std::uint32_t>>(random_ranks(plan, streams_.back())));
  }
}

double DrawnKey::share(std::uint64_t draw, std::size_t component) const noexcept {
  const double within = uniform_of(plan_, streams_[component], Process::campaign_draw, draw);
  if (strata_.empty()) return within;
  constexpr double edge = 0x1p-30;  // so that no sum is rounded into the next stratum
  return ((*strata_[component])[draw] + std::clamp(within, edge, 1 - edge)) / static_cast<double>(plan_.count);
}

std::string DrawnKey::text(std::uint64_t draw) const {
  if (distribution_.components() == 0) return distribution_.text(share(draw, 0));
  std::vector<std::string> all;
  for (std::size_t i = 0; i < streams_.size(); ++i) all.push_back(distribution_.text(share(draw, i)));
  return fmt::format("[{}]", fmt::join(all, ", "));
}

}  // namespace imud
