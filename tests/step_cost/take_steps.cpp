// take_steps MODEL STEPS: pushes a truth and takes a sample at its time, STEPS times. MODEL is memo, tactical, or
// truths, which only makes these. Fails if a sample is saturated, or if steps allocate.
#include <cstdio>
#include <cstdlib>
#include <string_view>

#include "tests/support/allocations.hpp"
#include "tests/support/step_models.hpp"

namespace {

using namespace imud;

struct Taken {
  std::uint32_t status = 0;
  std::uint64_t allocated = 0;  // after the first step
};

Taken take(const ImuModel& model, Truths& truths, std::uint64_t steps) {
  Timeline timeline;
  Imu imu(model, 1, 1);
  Taken taken;
  std::uint64_t before = 0;
  for (std::uint64_t i = 0; i < steps; ++i) {
    const Truth& truth = truths.next();
    timeline.push(truth);
    const Sample sample = imu.sample(timeline, truth.time, DeviceTime{} + (truth.time - TruthTime{}));
    asm volatile("" : : "m"(sample));  // a reader of all of it
    taken.status |= sample.status;
    if (i == 0) before = allocations();
  }
  taken.allocated = allocations() - before;
  return taken;
}

Taken make_only(Truths& truths, std::uint64_t steps) {
  Taken taken;
  for (std::uint64_t i = 0; i < steps; ++i) asm volatile("" : : "m"(truths.next()));
  return taken;
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 3) {
    std::fputs("usage: take_steps memo|tactical|truths STEPS\n", stderr);
    return 2;
  }
  const std::string_view name = arguments[1];
  const std::uint64_t steps = std::strtoull(arguments[2], nullptr, 10);
  const bool is_tactical = name == "tactical";
  const ImuModel model =
      is_tactical ? tactical_model() : memo_model(Coupling::full, DeltaVelocity::memo, DeltaAngle::rotation_vector);
  Truths truths(is_tactical ? std::chrono::microseconds(500) : std::chrono::milliseconds(5));
  const Taken taken = name == "truths" ? make_only(truths, steps) : take(model, truths, steps);
  if (taken.allocated > 0)
    std::fprintf(stderr, "%llu allocations\n", static_cast<unsigned long long>(taken.allocated));
  if (taken.status != 0) std::fprintf(stderr, "status %x\n", taken.status);
  return taken.allocated > 0 || taken.status != 0 ? 1 : 0;
}
