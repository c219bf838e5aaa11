// The faults of the power, by themselves and through the datagrams of a STIM300.
#include "emulator/faults/power_faults.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/emulator/faults/faulty_run.hpp"
#include "tests/emulator/faults/powered_unit.hpp"
#include "tests/emulator/run/run_test.hpp"

namespace imud {
namespace {

// Returns 'x' for a sample at which the device is off, '|' for one at which it starts, '.' otherwise.
std::string steps_of(std::initializer_list<PowerWindow> windows, std::uint64_t samples) {
  PowerFaults power("imu1", 1, 100);
  std::string steps;
  for (std::uint64_t k = 0; k < samples; ++k) {
    const PowerStep step = power.step(active_at({windows.begin(), windows.size()}, k));
    EXPECT_TRUE(step.is_on || !step.starts);
    steps += !step.is_on ? 'x' : step.starts ? '|' : '.';
  }
  return steps;
}

TEST(PowerFaults, SwitchTheSupply) {
  EXPECT_EQ(steps_of({}, 5), ".....");
  EXPECT_EQ(steps_of({{"off", 2, 4}}, 8), "..xxx|..");
  EXPECT_EQ(steps_of({{"off", 0, 1}}, 4), "xx|.");
  EXPECT_EQ(steps_of({{"boot_loader", 2, 4}}, 8), "..xxx|..");
  EXPECT_EQ(steps_of({{"off", 2, 4}, {"boot_loader", 4, 5}}, 8), "..xxxx|.");
  EXPECT_EQ(steps_of({{"settings_lost", 2, 2}}, 5), "..|..");
  EXPECT_EQ(steps_of({{"slow_start", 0, 7, 0.03}}, 5), ".....") << "nothing starts";
  EXPECT_EQ(steps_of({{"off", 2, 3}, {"slow_start", 0, 7, 0.03}}, 10), "..xxxxx|..");
  EXPECT_EQ(steps_of({{"off", 2, 3}, {"slow_start", 0, 4, 0.03}}, 10), "..xxxxx|..") << "it had begun";
  EXPECT_EQ(steps_of({{"settings_lost", 2, 2}, {"slow_start", 0, 7, 0.03}}, 8), "..xxx|..");
  EXPECT_EQ(steps_of({{"brown_out", 2, 4, 100}}, 7), "..|||..") << "each sample has a reset";
}

// 10 resets in each of 1000 s: Poisson, as their probability in a sample of 1/1000 s is small. The bound of 5
// standard deviations is passed by all but 6e-7 of the seeds.
TEST(PowerFaults, BrownOutsHaveTheirRate) {
  PowerFaults power("imu1", 1, 1000), same("imu1", 1, 1000), other("imu2", 1, 1000);
  double resets = 0;
  std::size_t different = 0;
  for (std::uint64_t k = 0; k < 1'000'000; ++k) {
    const std::array<ActiveFault, 1> active = {power_fault("brown_out", k, 10)};
    const bool starts = power.step(active).starts;
    resets += starts ? 1 : 0;
    ASSERT_EQ(same.step(active).starts, starts);
    different += other.step(active).starts != starts ? 1 : 0;
  }
  EXPECT_NEAR(resets, 10'000, 5 * std::sqrt(10'000 * 0.99));
  EXPECT_GT(different, 15'000U);
}

class PowerFaultsRun : public RunTest {
 protected:
  std::string unit(const std::string& device = "") const {
    return write("config.toml", std::string(powered_unit_config) + device);
  }
};

// From the end of the fault on, the datagrams are those of a unit whose power is cycled at that instant: Init Mode
// with its special datagrams, then Normal Mode.
TEST_F(PowerFaultsRun, AfterAnInterruptionTheUnitStartsAsByACycleOfItsPower) {
  const std::string config = unit();
  PoweredUnit without(config, false), faulty(config, true), cycled(config, false);
  const std::array<PowerWindow, 1> windows = {{{"off", 1000, 1999}}};
  std::size_t sent = 0, after = 0;
  for (std::uint64_t k = 0; k < 8000; ++k) {
    if (k == 2000) cycled.channel->cycle_power(cycled.instant(2000));
    const std::vector<std::byte> plain = without.step(), got = faulty.step(windows), wanted = cycled.step();
    if (k < 1000) {
      ASSERT_EQ(got, plain) << k;
      sent += got.empty() ? 0 : 1;
    } else if (k < 2000) {
      ASSERT_TRUE(got.empty()) << k;
      if (k == 1500) {
        EXPECT_EQ(faulty.ask("SERVICEMODE\r"), "");
        EXPECT_FALSE(faulty.channel->next_wake());
      }
    } else {
      ASSERT_EQ(got, wanted) << k;
      after += got.empty() ? 0 : 1;
    }
  }
  EXPECT_GT(sent, 10U);
  EXPECT_GT(after, 1000U);
  EXPECT_NE(faulty.ask("SERVICEMODE\r"), "") << "it has forgotten what was sent while it was off, and answers now";
}

TEST_F(PowerFaultsRun, LostSettingsAreThoseAsDelivered) {
  const std::string configured = unit("cr_lf = true\nsample_rate = 500\n"), delivered = unit();
  PoweredUnit plain(delivered, false);
  const std::string again = unit("cr_lf = true\nsample_rate = 500\n");
  PoweredUnit faulty(again, true);
  const std::array<PowerWindow, 1> windows = {{{"settings_lost", 1000, 1000}}};
  std::size_t after = 0;
  for (std::uint64_t k = 0; k < 8000; ++k) {
    if (k == 1000) plain.channel->cycle_power(plain.instant(1000));
    const std::vector<std::byte> wanted = plain.step(), got = faulty.step(windows);
    if (k < 1000) continue;
    ASSERT_EQ(got, wanted) << k;
    after += got.empty() ? 0 : 1;
  }
  EXPECT_GT(after, 1000U);
}

class PowerFaultsOfASensor : public FaultyRunTest {};

// With a turn-on bias alone, the sensor differs from that of the run without the fault by a constant from the start
// on: the difference of two draws. Two of three axes are beyond 1 mrad/s at a standard deviation of 100 but for 1e-4
// of the seeds.
TEST_F(PowerFaultsOfASensor, AnInterruptionDrawsOtherTurnOnErrors) {
  const std::string errors =
      "rate_hz = 500\nmodel = \"ideal\"\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n"
      "gyro.turn_on_bias_rad_per_s = 0.1\n";
  const std::vector<Measurement> plain = run("", "native", 1, errors).measurements;
  const std::vector<Measurement> faulty =
      run("[[fault]]\ntarget = \"power\"\nkind = \"off\"\nat_s = 2\nfor_s = 1\n", "native", 1, errors).measurements;
  ASSERT_GT(faulty.size(), 4000U);
  const auto difference = [&](const Measurement& one) -> Vector3 {
    return one.sample.rate - plain.at(one.sample.counter).sample.rate;
  };
  const Vector3 after = difference(faulty.back());
  EXPECT_GE((after.array().abs() > 1e-3).count(), 2) << after.transpose();
  std::size_t before_it = 0, after_it = 0;
  for (const Measurement& one : faulty) {
    const bool has_started = one.sample.counter > 1500;
    (has_started ? after_it : before_it) += 1;
    // The sample at which the device starts still has the errors of before.
    if (one.sample.counter == 1500) continue;
    ASSERT_LT((difference(one) - (has_started ? after : Vector3::Zero())).norm(), 1e-12) << one.sample.counter;
  }
  EXPECT_EQ(before_it, 1001U);
  EXPECT_GT(after_it, 3000U);
}

TEST_F(PowerFaultsRun, ACommandSwitchesTheSupply) {
  const std::string config = unit("start_up = false\n");
  PoweredUnit unit(config, true), cycled(config, false);
  const auto none = std::span<const PowerWindow>();
  for (std::uint64_t k = 0; k < 3000; ++k) {
    if (k == 1000) unit.channel->execute({.kind = Command::Kind::power_off}, unit.book, unit.instant(1000));
    if (k == 1001) {
      EXPECT_EQ(unit.ask("SERVICEMODE\r"), "");
      unit.channel->cycle_power(unit.instant(1001));
    }
    if (k == 2000) {
      unit.channel->execute({.kind = Command::Kind::power_on}, unit.book, unit.instant(2000));
      cycled.channel->cycle_power(cycled.instant(2000));
    }
    const std::vector<std::byte> got = unit.step(none), wanted = cycled.step();
    if (k >= 1000 && k < 2000) {
      ASSERT_TRUE(got.empty()) << k;
    } else {
      ASSERT_EQ(got, wanted) << k;
    }
  }
}

// 0.05 s are 100 samples. The first cycle is by a command, the second by a request, and the third one in the delay.
// The fault has ended at the last one.
TEST_F(PowerFaultsRun, EachStartIsSlow) {
  const std::string config = unit();
  PoweredUnit unit(config, true), cycled(config, false);
  const std::vector<PowerWindow> slow = {{"slow_start", 0, 11'999, 0.05}};
  std::size_t silent = 0, sent = 0;
  for (std::uint64_t k = 0; k < 15'000; ++k) {
    if (k == 1000) unit.channel->execute({.kind = Command::Kind::power_cycle}, unit.book, unit.instant(k));
    if (k == 6000 || k == 6050 || k == 13'000) unit.channel->cycle_power(unit.instant(k));
    if (k == 1100 || k == 6150 || k == 13'000) cycled.channel->cycle_power(cycled.instant(k));
    const std::vector<std::byte> got = unit.step(slow), wanted = cycled.step();
    if ((k >= 1000 && k < 1100) || (k >= 6000 && k < 6150)) {
      ASSERT_TRUE(got.empty()) << k;
      ++silent;
    } else {
      ASSERT_EQ(got, wanted) << k;
      sent += got.empty() ? 0 : 1;
    }
  }
  EXPECT_EQ(silent, 250U);
  EXPECT_GT(sent, 1000U);
}

// A cycle of the power just before the instant at which the unit starts anyhow changes nothing: neither an earlier
// start, nor other turn-on errors.
TEST_F(PowerFaultsRun, AUnitThatIsAboutToStartStartsOnce) {
  const std::string config = unit();
  PoweredUnit unit(config, true), plain(config, true);
  const std::array<PowerWindow, 1> off = {{{"off", 1000, 1999}}};
  std::size_t sent = 0;
  for (std::uint64_t k = 0; k < 8000; ++k) {
    const auto cycle = [&] {
      if (k == 2000) unit.channel->cycle_power(unit.instant(k) - std::chrono::microseconds(100));
    };
    const std::vector<std::byte> got = unit.step(off, cycle), wanted = plain.step(off);
    ASSERT_EQ(got, wanted) << k;
    sent += k >= 2000 && !got.empty() ? 1 : 0;
  }
  EXPECT_GT(sent, 1000U);
}

}  // namespace
}  // namespace imud
