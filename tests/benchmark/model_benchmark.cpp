// The cost of the model. Every figure is per step on one core; `allocations` must be 0.
#include <benchmark/benchmark.h>

#include <chrono>
#include <cstdint>
#include <vector>

#include "core/igrf.hpp"
#include "core/imu.hpp"
#include "tests/support/allocations.hpp"
#include "tools/motion.hpp"

namespace {

using namespace imud;
using Clock = std::chrono::steady_clock;

enum class Coupling : std::uint8_t { diagonal, full };

TriadErrors every_error(double sigma, Coupling coupling) {
  TriadErrors errors;
  errors.scale_factor = {1.001, 0.999, 1.002};
  errors.bias = {0.01, -0.02, 0.005};
  errors.walk_transition = 0.99 * Matrix3::Identity();
  errors.walk_sqrt_cov = sigma * Matrix3::Identity();
  if (coupling == Coupling::full) {
    errors.walk_transition(0, 1) = errors.walk_transition(2, 0) = 0.001;
    errors.walk_sqrt_cov(1, 0) = errors.walk_sqrt_cov(2, 1) = 0.1 * sigma;
  }
  errors.walk_bound = Vector3::Constant(20.0 * sigma);
  errors.lsb = 0.1 * sigma;
  errors.carry = true;
  errors.max = 1000.0 * sigma;
  return errors;
}

ImuModel every_effect(Coupling coupling, DeltaVelocity delta_velocity, DeltaAngle delta_angle) {
  ImuModel model;
  model.r_SB_B = {0.3, -0.2, 0.5};
  model.dcm_PB << 0.36, 0.48, -0.8, -0.8, 0.6, 0.0, 0.48, 0.64, 0.6;
  model.gyro = every_error(1e-3, coupling);
  model.accelerometer = every_error(1e-2, coupling);
  model.delta_angle = delta_angle;
  model.delta_velocity = delta_velocity;
  return model;
}

// An endless truth stream: 200 truths of a coning motion (10 turns at 5 ms), repeated with later times.
class Truths {
 public:
  explicit Truths(Nanoseconds step) : length_(step * 200) {
    const Motion& coning = *find_motion("coning");
    for (std::int64_t k = 0; k < 200; ++k) cycle_.push_back(coning.at(TruthTime{} + k * step, MotionParameters{}));
  }
  const Truth& next() {
    Truth& truth = cycle_[i_];
    if (laps_ > 0) truth.time = truth.time + length_;
    if (++i_ == cycle_.size()) {
      i_ = 0;
      ++laps_;
    }
    return truth;
  }

 private:
  std::vector<Truth> cycle_;
  Nanoseconds length_;
  std::size_t i_ = 0;
  std::int64_t laps_ = 0;
};

enum class Push : std::uint8_t { free, counted };

// One iteration is one sample. Truths are pushed in batches of `truths`, and the samples up to the newest truth
// follow. With truth_step equal to sensor_step, the model gets the same input as the reference module.
void steps(benchmark::State& state, const ImuModel& model, Nanoseconds truth_step, Nanoseconds sensor_step,
           int truths, Push push) {
  Truths stream(truth_step);
  Timeline timeline;
  Imu imu(model, 1, 1);
  TruthTime time = {};
  const auto batch = truths * truth_step / sensor_step;
  timeline.push(stream.next());
  Sample sample = imu.sample(timeline, time, {});
  const std::uint64_t before = allocations();
  while (state.KeepRunningBatch(batch)) {
    auto begin = Clock::now();
    for (int i = 0; i < truths; ++i) timeline.push(stream.next());
    if (push == Push::free) begin = Clock::now();
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

// Truth at each sample.
void at_truth(benchmark::State& state, const ImuModel& model) { steps(state, model, 5_ms, 5_ms, 8, Push::free); }
void at_truth_with_push(benchmark::State& state, const ImuModel& model) {
  steps(state, model, 5_ms, 5_ms, 8, Push::counted);
}
// Ten samples per truth interval, all but the last between truths.
void between_truths(benchmark::State& state, const ImuModel& model) {
  steps(state, model, 50_ms, 5_ms, 1, Push::free);
}
// Four truths per sample.
void over_truths(benchmark::State& state, const ImuModel& model) { steps(state, model, 5_ms, 20_ms, 8, Push::free); }

#define STEP(how, coupling, velocity, angle)                                                      \
  BENCHMARK_CAPTURE(how, coupling##_##velocity##_##angle,                                         \
                    every_effect(Coupling::coupling, DeltaVelocity::velocity, DeltaAngle::angle)) \
      ->UseManualTime()
STEP(at_truth, diagonal, end_frame, rotation_vector);
STEP(at_truth, diagonal, memo, rotation_vector);
STEP(at_truth, diagonal, integral, rotation_vector);
STEP(at_truth, diagonal, integral, integral);
STEP(at_truth, full, end_frame, rotation_vector);
STEP(at_truth, full, integral, rotation_vector);
STEP(at_truth_with_push, full, end_frame, rotation_vector);
STEP(at_truth_with_push, full, integral, rotation_vector);
STEP(between_truths, full, end_frame, rotation_vector);
STEP(between_truths, full, memo, rotation_vector);
STEP(between_truths, full, integral, rotation_vector);
STEP(over_truths, full, end_frame, rotation_vector);
STEP(over_truths, full, memo, rotation_vector);
STEP(over_truths, full, integral, rotation_vector);

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
