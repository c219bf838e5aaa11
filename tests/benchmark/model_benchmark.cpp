// The cost of the model. Every figure is per step on one core; `allocations` must be 0.
#include <benchmark/benchmark.h>

#include <chrono>
#include <cstdint>
#include <vector>

#include "core/earth/igrf.hpp"
#include "core/imu.hpp"
#include "tests/support/allocations.hpp"
#include "tests/support/step_models.hpp"

namespace {

using namespace imud;
using Clock = std::chrono::steady_clock;

// One iteration is one sample. Truths are pushed in batches of `truths`, and the samples up to the newest truth
// follow; both are timed, and no sample is saturated. With truth_step equal to sensor_step, the model gets the same
// input as the reference module.
void steps(benchmark::State& state, const ImuModel& model, Nanoseconds truth_step, Nanoseconds sensor_step,
           int truths) {
  Truths stream(truth_step);
  Timeline timeline;
  Imu imu(model, 1, 1);
  TruthTime time = {};
  const auto batch = truths * truth_step / sensor_step;
  timeline.push(stream.next());
  Sample sample = imu.sample(timeline, time, {});
  const std::uint64_t before = allocations();
  while (state.KeepRunningBatch(batch)) {
    const auto begin = Clock::now();
    for (int i = 0; i < truths; ++i) timeline.push(stream.next());
    for (std::int64_t i = 0; i < batch; ++i) {
      time = time + sensor_step;
      sample = imu.sample(timeline, time, {});
      benchmark::DoNotOptimize(sample);
    }
    state.SetIterationTime(std::chrono::duration<double>(Clock::now() - begin).count());
  }
  state.counters["allocations"] = static_cast<double>(allocations() - before);
}

constexpr Nanoseconds operator""_ms(unsigned long long ms) { return std::chrono::milliseconds(ms); }
constexpr Nanoseconds operator""_us(unsigned long long us) { return std::chrono::microseconds(us); }

// Truth at each sample.
void at_truth(benchmark::State& state, const ImuModel& model) { steps(state, model, 5_ms, 5_ms, 8); }
// Ten samples per truth interval, all but the last between truths.
void between_truths(benchmark::State& state, const ImuModel& model) { steps(state, model, 50_ms, 5_ms, 1); }
// Four truths per sample.
void over_truths(benchmark::State& state, const ImuModel& model) { steps(state, model, 5_ms, 20_ms, 8); }

#define STEP(how, coupling, velocity, angle)                                                    \
  BENCHMARK_CAPTURE(how, coupling##_##velocity##_##angle,                                       \
                    memo_model(Coupling::coupling, DeltaVelocity::velocity, DeltaAngle::angle)) \
      ->UseManualTime()
STEP(at_truth, diagonal, end_frame, rotation_vector);
STEP(at_truth, diagonal, memo, rotation_vector);
STEP(at_truth, diagonal, integral, rotation_vector);
STEP(at_truth, diagonal, integral, integral);
STEP(at_truth, full, end_frame, rotation_vector);
STEP(at_truth, full, integral, rotation_vector);
STEP(at_truth, full, memo, rotation_vector);
STEP(between_truths, full, end_frame, rotation_vector);
STEP(between_truths, full, memo, rotation_vector);
STEP(between_truths, full, integral, rotation_vector);
STEP(over_truths, full, end_frame, rotation_vector);
STEP(over_truths, full, memo, rotation_vector);
STEP(over_truths, full, integral, rotation_vector);
// The tactical sensor, with a truth at each of its 2000 samples a second.
void at_truth_2_khz(benchmark::State& state, const ImuModel& model) { steps(state, model, 500_us, 500_us, 8); }
BENCHMARK_CAPTURE(at_truth_2_khz, tactical, tactical_model())->UseManualTime();

void three_normals(benchmark::State& state) {
  const Normals normals(1, 1);
  std::uint64_t k = 0;
  for (auto _ : state) {
    Vector3 n = normals(Quantity::rate, Process::gauss_markov, k++);
    benchmark::DoNotOptimize(n);
  }
}
BENCHMARK(three_normals);

void gauss_markov(benchmark::State& state, Coupling coupling) {
  const Normals normals(1, 1);
  GaussMarkov walk(every_error(1e-3, coupling), Quantity::rate);
  std::uint64_t k = 0;
  for (auto _ : state) benchmark::DoNotOptimize(walk.next(normals, k++));
}
BENCHMARK_CAPTURE(gauss_markov, diagonal, Coupling::diagonal);
BENCHMARK_CAPTURE(gauss_markov, full, Coupling::full);

// At a time `back` truths before the newest.
void timeline_at(benchmark::State& state, int back) {
  Truths stream(5_ms);
  Timeline timeline;
  for (int i = 0; i < 1000; ++i) timeline.push(stream.next());
  const TruthTime begin = timeline.newest() - (back + 1) * Nanoseconds(5_ms);
  std::int64_t k = 0;
  for (auto _ : state) {
    MotionState at = timeline.at(begin + Nanoseconds{1'000'000 + (k++ & 1023)});
    benchmark::DoNotOptimize(at);
  }
}
BENCHMARK_CAPTURE(timeline_at, newest interval, 0);
BENCHMARK_CAPTURE(timeline_at, 3 intervals back, 3);
BENCHMARK_CAPTURE(timeline_at, 500 intervals back, 500);

void magnetic_field(benchmark::State& state) {
  const MagneticField field(igrf14(2025));
  Vector3 r_E = {4e6, 1e6, -5e6};  // m
  for (auto _ : state) {
    r_E.x() += 1;
    Vector3 at = field.at(r_E);
    benchmark::DoNotOptimize(at);
  }
}
BENCHMARK(magnetic_field);

void timeline_push(benchmark::State& state, AccumulatedDv kind) {
  Truths stream(5_ms);
  Timeline timeline;
  const std::uint64_t before = allocations();
  for (auto _ : state) {
    Truth truth = stream.next();
    truth.accumulated_dv = kind;
    benchmark::DoNotOptimize(timeline.push(truth));
  }
  state.counters["allocations"] = static_cast<double>(allocations() - before);
}
BENCHMARK_CAPTURE(timeline_push, inertial, AccumulatedDv::inertial);
BENCHMARK_CAPTURE(timeline_push, none, AccumulatedDv::none);

}  // namespace
