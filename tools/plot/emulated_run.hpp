// EmulatedRun: the sensor of a configuration on a captured truth, as its bytes have it, with and without its errors.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tools/allan/still_recording.hpp"

namespace imud {

// Runs imud, and decodes what one imu of the configuration sends.
class EmulatedRun {
 public:
  struct Options {
    std::string config;                  // path of the configuration
    std::string capture;                 // of the truth, as for `imud replay`
    std::string imu;                     // name; empty: the first
    std::vector<std::string> overrides;  // KEY=VALUE, for imud
    std::optional<double> rate_hz;       // in place of the rate of the samples' time, or of the settings
  };

  // Has imud resolve the configuration. Throws std::invalid_argument if it has faults, which imud has reported on
  // standard error, or no such imu.
  explicit EmulatedRun(Options options);

  const std::string& name() const noexcept { return name_; }
  std::uint64_t seed() const noexcept { return seed_; }

  // Return the output with this seed, and without any error: the truth at the sensor's place, in its axes, samples
  // and format. Throw std::runtime_error if imud fails or the output is no recording. The first run shows what imud
  // reports on standard error.
  StillRecording sent(std::uint64_t seed);
  StillRecording truth();

 private:
  StillRecording record(const std::string& config);

  Options options_;
  std::string name_, protocol_, resolved_;
  std::vector<std::string> settings_;
  std::uint64_t seed_ = 0;
  double frames_per_s_ = 0;  // that imud expects
  bool has_run_ = false;
};

}  // namespace imud
