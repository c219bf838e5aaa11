// The cost of the model of a configuration, over a captured flight: `seeds_benchmark.py` compares whole runs with it.
#include <benchmark/benchmark.h>

#include <cstdlib>
#include <vector>

#include "core/imu.hpp"
#include "core/numbers/random.hpp"
#include "emulator/config/load_config.hpp"
#include "emulator/drive/stored_truths.hpp"
#include "emulator/plan/config.hpp"

namespace {

using namespace imud;

std::vector<Truth> truths_of(const Config& config) {
  const auto stored = StoredTruths::read(config.truth, 1'000'000).value();
  const auto port = stored.open();
  const auto decoder = stored.format().make(config.truth.settings);
  std::vector<Truth> all;
  while (const auto received = port->receive()) {
    decoder->feed(received->frame.bytes, TruthInput::datagram, received->time);
    Truth truth;
    while (const auto result = decoder->next(truth))
      if (*result == TruthResult::ok) all.push_back(truth);
  }
  return all;
}

// One iteration is one sample of the first imu of IMUD_CONFIG, whose truth is the capture IMUD_CAPTURE. It pushes the
// truths into a timeline, too. The seed is another one in each flight.
void config_model(benchmark::State& state) {
  const char *file = std::getenv("IMUD_CONFIG"), *capture = std::getenv("IMUD_CAPTURE");
  if (file == nullptr || capture == nullptr) return state.SkipWithError("set IMUD_CONFIG and IMUD_CAPTURE");
  const Config config = load_config(file, {}, capture);
  const ImuConfig& imu_config = config.imus.front();
  const std::vector<Truth> truths = truths_of(config);
  const auto instant = [&](benchmark::IterationCount k) {
    return truths.front().time + imu_config.grid.offset(static_cast<std::uint64_t>(k));
  };
  benchmark::IterationCount samples = 0;
  while (instant(samples) <= truths.back().time) ++samples;
  for (std::uint64_t seed = 1; state.KeepRunningBatch(samples); ++seed) {
    Timeline timeline(config.truth.limits);
    Imu imu(imu_config.model, seed, stream_id(imu_config.name));
    benchmark::IterationCount k = 0;
    for (const Truth& truth : truths) {
      timeline.push(truth);
      for (TruthTime time; k < samples && (time = instant(k)) <= truth.time; ++k) {
        Sample sample = imu.sample(timeline, time, {});
        benchmark::DoNotOptimize(sample);
      }
    }
  }
}
BENCHMARK(config_model);

}  // namespace
