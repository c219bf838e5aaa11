// Labels have the largest errors that faults caused in the solution that a unit computes itself.
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "emulator/config/load_config.hpp"
#include "tests/emulator/faults/faulty_run.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class FaultEffectsTest : public FaultyRunTest {
 protected:
  // Labels of a run at 10 Hz of `samples` samples, at each of which `errors(k)` are judged.
  template <class Errors>
  std::vector<FaultLabel> judged(const std::string& faults, int samples, const Errors& errors, int runs = 1) {
    config_ = load_config(write("effects.toml", config_text(faults, "native", 1,
                                                            "rate_hz = 10\nmodel = \"ideal\"\ngyro.max_rad_per_s = "
                                                            "10\naccelerometer.max_m_per_s2 = 100\n")));
    FaultLog log;
    const std::vector<Normals> normals = fault_normals("imu1", 1, config_.faults.size());
    FaultSchedule schedule(config_.faults, normals, "imu1", 0, 10, log);
    for (int k = 0; k < samples * runs; ++k) {
      if (k % samples == 0) schedule.begin_run();
      schedule.take(Sample{}, std::chrono::milliseconds(100 * (k % samples)));
      schedule.judge(errors(k));
    }
    schedule.finish();
    return fault_labels(config_.faults, std::vector<std::string>{"imu1"}, log);
  }
  static std::string fault(const std::string& keys) {
    return "[[fault]]\ntarget = \"gyro\"\nkind = \"dead\"\n" + keys;
  }

  Config config_;
};

SolutionErrors position_error(double metres) { return {.attitude = 1e-3, .position = metres}; }

// From the first sample of the fault to 60 s after the last: samples 10 to 29, and to 629.
TEST_F(FaultEffectsTest, LastAMinute) {
  for (const auto& [peak, size] : {std::pair{9, 1.0}, {10, 7.0}, {29, 7.0}, {400, 7.0}, {629, 7.0}, {630, 1.0}}) {
    const auto labels =
        judged(fault("at_s = 1\nfor_s = 2\n"), 1000, [at = peak](int k) { return position_error(k == at ? 7 : 1); });
    ASSERT_EQ(labels.size(), 1U);
    EXPECT_EQ(labels[0].last.sample, 29U);
    EXPECT_DOUBLE_EQ(labels[0].effect.position, size) << peak;
    EXPECT_DOUBLE_EQ(labels[0].effect.attitude, 1e-3);
    EXPECT_LT(labels[0].effect.velocity, 0);  // it has had none
  }
}

// The next occurrence is the cause of what follows; so is the next run. What has not ended is judged to the end.
TEST_F(FaultEffectsTest, EndWithTheNextOccurrence) {
  const auto rising = [](int k) { return position_error(k); };
  const auto repeated = judged(fault("at_s = 1\nfor_s = 2\nevery_s = 10\ntimes = 2\n"), 1000, rising);
  ASSERT_EQ(repeated.size(), 2U);
  EXPECT_DOUBLE_EQ(repeated[0].effect.position, 109);
  EXPECT_DOUBLE_EQ(repeated[1].effect.position, 729);
  const auto runs = judged(fault("at_s = 1\nfor_s = 2\n"), 100, rising, 2);
  ASSERT_EQ(runs.size(), 2U);
  EXPECT_DOUBLE_EQ(runs[0].effect.position, 99);
  EXPECT_DOUBLE_EQ(runs[1].effect.position, 199);
  const auto endless = judged(fault("at_s = 1\n"), 100, rising);
  ASSERT_EQ(endless.size(), 1U);
  EXPECT_DOUBLE_EQ(endless[0].effect.position, 99);
}

TEST_F(FaultEffectsTest, AreInTheLabels) {
  const auto labels = judged(fault("name = \"off\"\nat_s = 1\nfor_s = 2\n"), 100,
                             [](int) { return SolutionErrors{.attitude = 0.25, .position = 12.5}; });
  const std::vector<std::string> rows = lines_of(labels_csv(labels));
  EXPECT_TRUE(rows[0].ends_with(",state,attitude_error_rad,velocity_error_m_per_s,position_error_m")) << rows[0];
  EXPECT_TRUE(rows[1].ends_with(",0,acted,0.25,,12.5")) << rows[1];
  const std::string json = labels_json(labels);
  EXPECT_TRUE(contains(json, "\"position_error_m\": 12.5")) << json;
  EXPECT_FALSE(contains(json, "velocity_error_m_per_s")) << json;
}

// A receiver that jumps by 30 m, and a filter that accepts it after a second: its position is 30 m off, its velocity
// and its attitude are not. Without a filter the labels have no errors.
TEST_F(FaultEffectsTest, AreThoseOfTheFilter) {
  const auto jump = [&](const char* solution) {
    return run(
        "[earth]\nframe = \"inertial\"\n[[fault]]\ntarget = \"gnss\"\nkind = \"jump\"\nnorth_m = 30\nat_s = "
        "5\nfor_s = 4\n",
        "vectornav", 1,
        std::string("model = \"vn-100\"\n[imu.device]\nmodel = \"vn-200\"\n[imu.navigation]\nposition_noise_m = "
                    "0.5\nvelocity_noise_m_per_s = 0.02\n") +
            solution);
  };
  const Result filtered = jump("solution = \"filter\"\naccept_after_s = 1\n"),
               true_place = jump("solution = \"truth\"\n");
  ASSERT_EQ(filtered.labels.size(), 1U);
  const SolutionErrors& effect = filtered.labels[0].effect;
  EXPECT_NEAR(effect.position, 30, 3);
  EXPECT_GE(effect.velocity, 0.005);
  EXPECT_LT(effect.velocity, 1);
  EXPECT_GE(effect.attitude, 1e-4);
  EXPECT_LT(effect.attitude, 0.1);
  ASSERT_EQ(true_place.labels.size(), 1U);
  EXPECT_LT(true_place.labels[0].effect.attitude, 0);
  EXPECT_LT(true_place.labels[0].effect.position, 0);
}

}  // namespace
}  // namespace imud
