// The sample path allocates no memory.
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "core/imu.hpp"
#include "tests/support/allocations.hpp"
#include "tools/truth/motion.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

TEST(Allocations, AreCounted) {
  const std::uint64_t before = allocations();
  const auto held = std::make_unique<std::vector<int>>(10);
  EXPECT_EQ(allocations() - before, 2U);
}

TEST(Allocations, NoneAfterTheConstructors) {
  for (const auto angle : {DeltaAngle::rotation_vector, DeltaAngle::integral})
    for (const auto velocity : {DeltaVelocity::integral, DeltaVelocity::memo, DeltaVelocity::end_frame})
      for (const auto kind : {AccumulatedDv::none, AccumulatedDv::inertial, AccumulatedDv::body_sum}) {
        ImuModel model;
        model.delta_angle = angle;
        model.delta_velocity = velocity;
        model.gyro.walk_sqrt_cov = model.accelerometer.walk_sqrt_cov = 1e-3 * Matrix3::Identity();
        model.gyro.lsb = model.accelerometer.lsb = 1e-4;
        Timeline timeline;
        Imu imu(model, 1, 1);
        const Motion& motion = *find_motion("coning");
        const std::uint64_t before = allocations();
        for (std::int64_t ms = 0; ms < 3000; ++ms) {  // more than the timeline keeps
          if (ms % 500 > 400) continue;               // gaps force extrapolation
          Truth truth = motion.at({ms * 1'000'000}, {});
          truth.accumulated_dv = kind;
          truth.new_run = ms == 2000;
          if (truth.new_run) imu.begin_run();
          timeline.push(truth);
          timeline.push(truth);  // a duplicate, or a restart
          if (ms % 7 == 3) imu.advance(timeline, truth.time);
          if (ms % 7 == 0) imu.sample(timeline, truth.time + 3500us, {});
        }
        imu.seek(100);
        EXPECT_EQ(allocations() - before, 0U);
      }
}

}  // namespace
}  // namespace imud
