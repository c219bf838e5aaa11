// The cost of an Allan deviation over all octaves. `passes` is its time in plain sums over the same samples, which no
// load of the machine changes much.
#include <benchmark/benchmark.h>

#include <chrono>
#include <random>
#include <vector>

#include "tools/allan/allan_curve.hpp"
#include "tools/allan/allan_fit.hpp"

namespace {

using namespace imud;

std::vector<double> samples(std::size_t count) {
  std::mt19937_64 random(1);
  std::vector<double> rates(count);
  for (double& rate : rates) rate = static_cast<double>(random()) * 0x1p-64;
  return rates;
}

double seconds_of_a_sum(const std::vector<double>& rates) {
  const auto begin = std::chrono::steady_clock::now();
  double sum = 0;
  for (const double rate : rates) sum += rate;
  benchmark::DoNotOptimize(sum);
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

void allan(benchmark::State& state) {
  const AllanKind kind = allan_kinds[static_cast<std::size_t>(state.range(0))];
  const auto rates = samples(10'000'000);
  double curve_s = 0, sum_s = 0;
  for (auto _ : state) {
    sum_s += seconds_of_a_sum(rates);
    const auto begin = std::chrono::steady_clock::now();
    const AllanCurve curve = allan_curve(kind, rates, 200, 0, 0.68);
    benchmark::DoNotOptimize(fit_allan_terms(curve, 0, 1e9));
    curve_s += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    state.counters["averaging_times"] = static_cast<double>(curve.points.size());
  }
  state.SetLabel(std::string(name_of(kind)));
  state.counters["million_per_minute"] =
      60e-6 * static_cast<double>(rates.size()) * static_cast<double>(state.iterations()) / curve_s;
  state.counters["passes"] = curve_s / sum_s;
}
BENCHMARK(allan)->DenseRange(0, std::size(allan_kinds) - 1)->Unit(benchmark::kMillisecond)->Iterations(2);

}  // namespace
