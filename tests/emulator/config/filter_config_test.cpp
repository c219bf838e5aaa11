// The keys of filters and of the internal rate: what they give, what is impossible, and whose filter acts.
#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <vector>

#include "emulator/config/load_config.hpp"
#include "emulator/ground/error_text.hpp"
#include "emulator/plan/config.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

class FilterConfig : public testing::Test {
 protected:
  Config config(const std::string& protocol, const std::vector<std::string>& assignments) const {
    std::ofstream(path_) << "[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nprotocol = \"" << protocol
                         << "\"\nport = \"pty:imu1\"\n";
    std::vector<std::string> all;
    if (protocol == "native")
      all = {"imu.0.rate_hz=200", "imu.0.gyro.max_rad_per_s=10", "imu.0.accelerometer.max_m_per_s2=200"};
    for (const std::string& assignment : assignments) all.push_back("imu.0." + assignment);
    return load_config(path_, all);
  }
  ImuConfig imu(const std::string& protocol, const std::vector<std::string>& assignments) const {
    return config(protocol, assignments).imus.at(0);
  }
  std::string fault(const std::vector<std::string>& assignments, const std::string& protocol = "native") const {
    try {
      config(protocol, assignments);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "no fault";
  }
  // Reads what a configuration is resolved to.
  ImuModel again(const Config& config) const {
    std::ofstream(folder_ / "again.toml") << config.resolved();
    return load_config(folder_ / "again.toml", {}).imus.at(0).model;
  }

  ScratchFolder folder_;
  const std::string path_ = folder_ / "config.toml";
};

TEST_F(FilterConfig, EachKindIsRead) {
  const ImuModel none = imu("native", {}).model;
  EXPECT_FALSE(none.gyro.filter.is_on() || none.accelerometer.filter.is_on() || none.magnetometer.filter.is_on());
  EXPECT_EQ(none.internal_samples, 1);
  const Config all =
      config("native", {"internal_rate_hz=1500", "gyro.low_pass_hz=[50,0,600]", "gyro.low_pass_order=4",
                        "accelerometer.cic_order=3", "accelerometer.cic_length=8", "magnetometer.boxcar_samples=5"});
  const ImuModel model = all.imus.at(0).model;
  EXPECT_EQ(model.internal_samples, 8);  // 1600 Hz: a multiple of 200
  EXPECT_EQ(model.gyro.filter.cut_off_hz, Vector3(50, 0, 600));
  EXPECT_EQ(model.gyro.filter.order, 4);
  EXPECT_EQ(model.accelerometer.filter, (SensorFilter{.length = 8, .stages = 3}));
  EXPECT_EQ(model.magnetometer.filter, (SensorFilter{.length = 5}));
  const ImuModel same = again(all);
  EXPECT_EQ(same.internal_samples, 8);
  EXPECT_EQ(same.gyro.filter, model.gyro.filter);
  EXPECT_EQ(same.accelerometer.filter, model.accelerometer.filter);
  EXPECT_EQ(same.magnetometer.filter, model.magnetometer.filter);
  const std::vector<TriadFilter> filters = triad_filters(model);
  EXPECT_EQ(filters.at(1).text(), "CIC of order 3 and length 8, group delay 6.562 ms");
  EXPECT_EQ(filters.at(2).text(), "mean of 5 samples, group delay 10 ms");
  EXPECT_EQ(triad_filters(imu("native", {"internal_rate_hz=2000", "gyro.low_pass_hz=262"}).model).at(0).text(),
            "low-pass of order 2 at 262 Hz, group delay 0.81 ms");
  EXPECT_EQ(triad_filters(imu("native", {"internal_rate_hz=2000", "gyro.low_pass_hz=262", "gyro.low_pass_damping=0.7",
                                         "gyro.fir_taps=[1,1,1]"})
                              .model)
                .at(0)
                .text(),
            "3 taps, then low-pass of order 2 and damping 0.7 at 262 Hz, group delay 0.9009 ms");
}

TEST_F(FilterConfig, WhatIsImpossibleIsAFaultAtTheKey) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{"gyro.low_pass_hz=90"}, "imu.0.gyro.low_pass_hz: give less than 90, 0.45 of the sensor's internal rate"},
      {{"gyro.low_pass_hz=-1"}, "imu.0.gyro.low_pass_hz: give"},
      {{"magnetometer.low_pass_hz=95", "internal_rate_hz=1000"}, "imu.0.magnetometer.low_pass_hz: give less than 90"},
      {{"gyro.low_pass_order=3"}, "imu.0.gyro.low_pass_order: give 1, 2 or 4"},
      {{"gyro.low_pass_hz=50", "gyro.boxcar_samples=4"}, "imu.0.gyro.boxcar_samples: there is another filter"},
      {{"gyro.low_pass_hz=50", "gyro.cic_order=1", "gyro.cic_length=2"}, "imu.0.gyro.cic_order: there is another"},
      {{"gyro.cic_order=2"}, "imu.0.gyro.cic_length: a CIC needs"},
      {{"gyro.cic_length=2"}, "imu.0.gyro.cic_order: cic_length is that"},
      {{"internal_rate_hz=100"}, "imu.0.internal_rate_hz: give at least the sample rate, 200"},
      {{"device_filters=true"}, "imu.0.device_filters: the protocol has no filters"},
  };
  for (const auto& [assignments, expected] : cases)
    EXPECT_NE(fault(assignments).find(expected), std::string::npos) << expected << "\n" << fault(assignments);
  EXPECT_EQ(fault({"gyro.low_pass_hz=89.9"}), "no fault");
  EXPECT_EQ(fault({"gyro.low_pass_hz=400", "internal_rate_hz=1000"}), "no fault");
}

TEST_F(FilterConfig, APresetHasItsBandwidth) {
  const ImuConfig preset = imu("native", {"model=\"stim300\"", "rate_hz=1000"});
  EXPECT_EQ(preset.model.internal_samples, 2);
  EXPECT_EQ(preset.model.gyro.filter.cut_off_hz, Vector3::Constant(262));
  // At less than twice its bandwidth it would alias noise: only if that is wanted.
  const ImuConfig slow = imu("native", {"model=\"stim300\"", "rate_hz=500"});
  EXPECT_EQ(slow.model.internal_samples, 1);
  EXPECT_FALSE(slow.model.gyro.filter.is_on());
  const ImuConfig aliased = imu("native", {"model=\"stim300\"", "rate_hz=500", "internal_rate_hz=2000"});
  EXPECT_EQ(aliased.model.internal_samples, 4);
  EXPECT_EQ(aliased.model.accelerometer.filter.cut_off_hz, Vector3::Constant(262));
  EXPECT_EQ(imu("native", {"model=\"icm-42688-p\""}).model.internal_samples, 1);
  // Without a filter, each internal sample would have noise of the whole internal rate.
  EXPECT_EQ(imu("native", {"model=\"adis16488a\""}).model.internal_samples, 1);
  EXPECT_EQ(imu("native", {"model=\"mpu-9250\"", "rate_hz=500"}).model.internal_samples, 1);
  // At a higher rate the sensor has no internal samples.
  EXPECT_EQ(imu("native", {"model=\"stim300\"", "rate_hz=5000"}).model.internal_samples, 1);
  EXPECT_NE(fault({"model=\"stim300\"", "internal_rate_hz=400"}).find("imu.0.gyro.low_pass_hz: give less than 180"),
            std::string::npos);
  EXPECT_EQ(fault({"model=\"stim300\"", "internal_rate_hz=400", "gyro.low_pass_hz=0", "accelerometer.low_pass_hz=0"}),
            "no fault");
  EXPECT_FALSE(imu("native", {"model=\"white\""}).model.gyro.filter.is_on());
}

// If the low-pass filter of a preset does not act, the FIR taps of the preset do not act either. FIR taps that the
// configuration states always act.
TEST_F(FilterConfig, TheTapsOfAPresetGoWithItsFilter) {
  std::ofstream(folder_ / "taps.toml")
      << "[imu]\ninternal_rate_hz = 2000\n[imu.gyro]\nmax_deg_per_s = 400\nlow_pass_hz = 300\nfir_taps = [0.5, 0.5]\n"
         "[imu.accelerometer]\nmax_g = 10\nlow_pass_hz = 300\nfir_taps = [0.25, 0.75]\n"
         "[imu.magnetometer]\nmax_ut = 800\nfir_taps = [0.75, 0.25]\n";
  const std::string model = "model=\"" + (folder_ / "taps.toml") + "\"";
  const auto taps = [](const FirTaps& of) { return of ? *of : std::vector<double>(); };
  using Taps = std::vector<double>;
  const ImuModel fast = imu("native", {model, "rate_hz=1000"}).model;
  EXPECT_EQ(taps(fast.gyro.fir_taps), Taps({0.5, 0.5}));
  EXPECT_EQ(taps(fast.accelerometer.fir_taps), Taps({0.25, 0.75}));
  EXPECT_EQ(taps(fast.magnetometer.fir_taps), Taps({0.75, 0.25}));
  // The sample rate is less than twice the bandwidth of the preset's filter: the filter does not act.
  const ImuModel slow = imu("native", {model, "gyro.fir_taps=[1,2]"}).model;
  EXPECT_FALSE(slow.accelerometer.filter.is_on());
  EXPECT_EQ(taps(slow.accelerometer.fir_taps), Taps());
  EXPECT_EQ(taps(slow.gyro.fir_taps), Taps({1, 2}));
  // The filters of a product take its place: of the magnetometer, too, which has no internal samples.
  const ImuModel product = imu("vectornav", {model, "gyro.fir_taps=[1,2]"}).model;
  EXPECT_EQ(taps(product.accelerometer.fir_taps), Taps());
  EXPECT_EQ(taps(product.magnetometer.fir_taps), Taps());
  EXPECT_EQ(taps(product.gyro.fir_taps), Taps({1, 2}));
  EXPECT_EQ(taps(imu("vectornav", {model, "device_filters=false", "internal_rate_hz=2000"}).model.gyro.fir_taps),
            Taps({0.5, 0.5}));
}

// The white noise of a product is that of one sample: it keeps its density at an internal rate.
TEST_F(FilterConfig, TheWhiteNoiseOfAProductKeepsItsDensity) {
  const Config one = config("vectornav", {"model=\"white\""}),
               ten = config("vectornav", {"model=\"white\"", "internal_rate_hz=8000"});
  ASSERT_EQ(ten.imus.at(0).model.internal_samples * one.imus.at(0).rate_hz, 8000);
  const std::vector<TriadTerms> expected = triad_terms(one.imus.at(0).model),
                                terms = triad_terms(ten.imus.at(0).model);
  EXPECT_GT(expected.at(0).axes[0].N, 0);
  for (const std::size_t triad : {0U, 1U})
    EXPECT_NEAR(terms.at(triad).axes[0].N, expected.at(triad).axes[0].N, 1e-12 * expected.at(triad).axes[0].N);
  EXPECT_EQ(again(ten).gyro.walk_sqrt_cov, ten.imus.at(0).model.gyro.walk_sqrt_cov);
}

}  // namespace
}  // namespace imud
