// SensorFaults: faults of the sensors themselves, which change a sample that is complete.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/imu.hpp"
#include "core/numbers/random.hpp"
#include "core/sample.hpp"
#include "emulator/plan/fault.hpp"

namespace imud {

// Applies the active faults to the samples of one imu, in order. A faulty value is limited to the sensor's range and
// rounded to its LSB, as every value is. Increments change by the value's change times the step; under vibration by
// its integral. A run's first sample has no increments. No allocation after construction; one thread.
class SensorFaults {
 public:
  // `normals`: by the faults' numbers, as many as faults may act; they must outlive this.
  SensorFaults(const ImuModel& model, std::span<const Normals> normals);

  // Exchanges the model of the sensor between two samples.
  void exchange_model(ImuModel& model) noexcept { std::swap(model_, model); }

  // Keeps the output of a sample on which no fault acts, for the next one.
  void remember(const Sample& sample) noexcept {
    has_last_ = true;
    last_ = {
        sample.rate,     sample.specific_force, sample.magnetic_field, sample.inclination.value_or(Vector3::Zero()),
        sample.pressure, sample.temperature_c,  sample.fix()};
  }
  // Changes a sample. `k`: its number in its run; `step_s`: since the sample before, 0 for the first of a run.
  void apply(std::span<const ActiveFault> faults, std::uint64_t k, double step_s, Sample& sample) noexcept;

 private:
  // The three sensors of a target.
  struct Triad {
    Vector3* value;
    Vector3* increment;  // nullptr: none
    const TriadErrors& errors;
    double white_sigma;       // of the sensor's own white noise in a sample, of the x axis
    std::uint32_t saturated;  // the bit of Sample::status for the x axis; y and z have the next two. 0: none
  };
  // The values of the targets in a sample; a stuck target repeats them.
  struct Output {
    Vector3 rate = Vector3::Zero(), specific_force = Vector3::Zero(), magnetic_field = Vector3::Zero(),
            inclination = Vector3::Zero();
    double pressure = 0, temperature_c = 0;
    Navigation navigation;
  };
  void apply_to_triad(const ActiveFault& fault, std::uint64_t k, double step_s, const Vector3& last, Triad& triad,
                      Sample& sample) noexcept;
  void apply_to_number(const ActiveFault& fault, std::uint64_t k, double last, double& value) noexcept;
  void apply_to_gnss(const ActiveFault& fault, Sample& sample) noexcept;
  static void limit(Triad& triad, unsigned axes, Sample& sample, double step_s) noexcept;

  ImuModel model_;
  const std::span<const Normals> normals_;
  Output last_;
  bool has_last_ = false;
  // By the faults' numbers: the last output before each began, or the output of the first sample.
  std::vector<Output> held_;
};

}  // namespace imud
