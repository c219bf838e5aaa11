// A preset's sensor shows a slow rate in the mean over ten minutes at rest on the Earth.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include "core/allan_terms.hpp"
#include "core/attitude.hpp"
#include "core/units.hpp"
#include "emulator/config/load_config.hpp"
#include "emulator/plan/config.hpp"
#include "tests/core/drive.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

constexpr double deg_per_hr = units::degree / 3600;
constexpr double seconds_of_mean = 600;

// The variance of the mean over a time of an exponentially correlated process of variance 1.
double variance_of_mean(double seconds, double correlation_time) {
  const double x = seconds / correlation_time;
  return 2 * (x - 1 + std::exp(-x)) / (x * x);
}

// The variance of the mean of white noise and flicker noise over a time.
double variance_of_mean(const TriadErrors& errors, const AllanTerms& terms, double seconds) {
  const std::size_t count = Flicker::octaves(errors.flicker_from_s, errors.flicker_to_s);
  double flicker = 0, time = Flicker::first_correlation_time(errors.flicker_from_s);
  for (std::size_t i = 0; i < count; ++i, time *= 2)
    flicker +=
        (i == 0 || i + 1 == count ? 2 : 1) * std::numbers::ln2 / std::numbers::pi * variance_of_mean(seconds, time);
  return terms.N * terms.N / seconds + terms.B * terms.B * flicker;
}

// An LSB of the HG4930 is 118 deg/h, its noise at 50 Hz 0.2 LSB and less. Its control messages carry the remainder of
// the rounding on to the next: otherwise 15 deg/h become some 4, which all 18 means of a kind would show.
TEST(PresetMeans, AnHG4930ShowsTheEarthsRate) {
  constexpr double rate_hz = 50;
  constexpr int seeds = 20;
  const Vector3 earth = deg_per_hr * Vector3(15.041, -9.67, 2.5);
  const ScratchFolder folder;
  const std::string path = folder / "config.toml";
  int compared = 0;
  for (const std::string grade : {"aa51", "ba51", "ca51"}) {
    std::ofstream(path)
        << "[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nprotocol = \"native\"\nport = \"pty:imu1\"\n"
        << "rate_hz = " << rate_hz << "\nmodel = \"hg4930-" << grade << "\"\n";
    const ImuModel model = load_config(path).imus.at(0).model;
    const double sigma =
        std::sqrt(variance_of_mean(model.gyro, allan_terms(model.gyro, rate_hz)[0], seconds_of_mean));
    ASSERT_LT(sigma, 1.2 * deg_per_hr);
    const auto times = instants(rate_hz, std::chrono::seconds(600));
    const auto at_rest = [&](TruthTime time) {
      Truth truth;
      truth.time = time;
      truth.q_NB = exp(earth * seconds(time - TruthTime{}));
      truth.omega_BN_B = earth;
      return truth;
    };
    const std::vector<TruthTime> truths = instants(0.1, std::chrono::seconds(600));
    Vector3 values = Vector3::Zero(), increments = Vector3::Zero();
    for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
      Vector3 value = Vector3::Zero(), increment = Vector3::Zero();
      for (const Sample& sample : drive(model, at_rest, truths, times, seed)) {
        value += sample.rate / static_cast<double>(times.size());
        increment += sample.delta_angle / seconds_of_mean;
      }
      // 5.5 sigma: one of the 360 means is beyond it with a probability of 1.4e-5.
      EXPECT_LT((value - earth).cwiseAbs().maxCoeff(), 5.5 * sigma) << grade << " " << seed;
      EXPECT_LT((increment - earth).cwiseAbs().maxCoeff(), 5.5 * sigma) << grade << " " << seed;
      values += value / seeds;
      increments += increment / seeds;
    }
    // 4.5 sigma: one of the 18 means over the seeds is beyond it with a probability of 1.2e-4.
    const double bound = 4.5 * sigma / std::sqrt(seeds);
    for (int axis = 0; axis < 3; ++axis)
      for (const double mean : {values[axis], increments[axis]}) {
        EXPECT_NEAR(mean / deg_per_hr, earth[axis] / deg_per_hr, bound / deg_per_hr) << grade << " " << axis;
        ++compared;
      }
  }
  EXPECT_EQ(compared, 18);
}

}  // namespace
}  // namespace imud
