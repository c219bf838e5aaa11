// Faults that are begun by control, where no fault acted before and none acts afterwards.
#include <string>
#include <vector>

#include "emulator/config/scenario.hpp"
#include "emulator/faults/channel_faults.hpp"
#include "tests/emulator/run/realtime_test.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

class BegunFaults : public RealtimeTest {
 protected:
  static FaultConfig read(const std::string& text, const std::vector<ImuConfig>& imus) {
    std::vector<std::string> wrong;
    FaultConfig fault = read_begun_fault(text, 0, imus, wrong);
    EXPECT_EQ(wrong, std::vector<std::string>());
    return fault;
  }
  // Returns the counters of the samples that left from 0.5 s to 0.95 s. The fault begins at 0.5 s, and lasts 0.2 s;
  // the first truth comes at 1 s.
  std::vector<std::uint64_t> left_at_rest(const std::string& fault) {
    const Config all = config(200, "delay_ms = 20", "before_first = \"rest\"\n[control]\nfaults = true\n");
    SimulatedRun run(all);
    for (int k = 0; k <= 20; ++k) run.truth(1 + 0.01 * k, Swing::truth(at_s(0.01 * k)));
    bool has_begun = false;
    run.host().on_wait = [&] {
      if (has_begun || run.host().now() < run.at(0.5)) return;
      has_begun = true;
      Engine& engine = run.engine();
      const std::uint32_t number = engine.faults().add(read(fault + "for_s = 0.2\n", all.imus), fault);
      engine.apply(Step::command({.kind = Command::Kind::fault_begin, .number = number}, HostTime{}));
    };
    run.run(1.1);
    std::vector<std::uint64_t> counters;
    for (const Left& one : run.left())
      if (one.time >= run.at(0.5) && one.time < run.at(0.95)) counters.push_back(one.sample.counter);
    return counters;
  }
};

TEST_F(BegunFaults, AStuckValueIsTheLastOneBefore) {
  const Config all = config(1000, "");
  const FaultConfig stuck = read("target = \"gyro\"\nkind = \"stuck\"\nfor_samples = 3\n", all.imus);
  const FaultConfig counter = read("target = \"message\"\nkind = \"counter_stuck\"\nfor_samples = 3\n", all.imus);
  FaultLog log;
  ChannelFaults faults({}, {}, all.imus[0], 0, 1, log, 4);
  Sample sample;
  const auto take = [&](std::uint64_t k) {
    sample = {};
    sample.counter = k;
    sample.rate.setConstant(static_cast<double>(k));
    faults.take(sample, static_cast<int>(k) * 1ms, std::nullopt);
    Sample sent = sample;
    faults.messages().forge(sent);
    return std::pair(sent.rate.x(), sent.counter);
  };
  for (const std::uint64_t first : {5U, 20U}) {
    for (std::uint64_t k = first - 5; k < first; ++k) {
      EXPECT_EQ(take(k), std::pair(static_cast<double>(k), k));
      EXPECT_TRUE(faults.are_quiet()) << k;
    }
    faults.add(stuck, first < 10 ? 0 : 2, sample);
    faults.add(counter, first < 10 ? 1 : 3, sample);
    for (std::uint64_t k = first; k < first + 3; ++k) {
      EXPECT_EQ(take(k), std::pair(static_cast<double>(first - 1), first - 1)) << k;
      EXPECT_FALSE(faults.are_quiet());
    }
    EXPECT_EQ(take(first + 3), std::pair(static_cast<double>(first + 3), first + 3));
    EXPECT_FALSE(faults.are_quiet());
  }
}

// 1 767 268 800 s since 1970: date -u -d 2026-01-01T12:00:00Z +%s
TEST_F(BegunFaults, ATimeOfTheHostIsGivenAsText) {
  const Config all = config(1000, "");
  const std::string stuck = "target = \"gyro\"\nkind = \"stuck\"\nfor_samples = 3\n";
  for (const std::string time : {"\"2026-01-01T12:00:00Z\"", "\"2026-01-01T13:00:00+01:00\"", "2026-01-01T12:00:00Z"})
    EXPECT_EQ(read(stuck + "at_time = " + time + "\n", all.imus).after_utc_ns, 1'767'268'800'000'000'000) << time;
  for (const std::string time : {"\"noon\"", "\"2026-01-01T12:00:00\"", "\"2026-01-01T12:00:00Z\\nx = 1\""}) {
    std::vector<std::string> wrong;
    static_cast<void>(read_begun_fault(stuck + "at_time = " + time + "\n", 0, all.imus, wrong));
    ASSERT_EQ(wrong.size(), 1U) << time;
    EXPECT_NE(wrong[0].find("at_time: give a date and time with its offset"), std::string::npos) << wrong[0];
  }
}

// Faults from the first truth on, after samples at rest.
TEST_F(BegunFaults, AStuckValueIsTheLastOneAtRest) {
  const Config all = config(200, "delay_ms = 20",
                            "before_first = \"rest\"\n[[fault]]\ntarget = \"accelerometer\"\nkind = \"stuck\"\n"
                            "[[fault]]\ntarget = \"message\"\nkind = \"counter_stuck\"\n");
  SimulatedRun run(all);
  for (int k = 0; k <= 20; ++k) run.truth(1 + 0.01 * k, Swing::truth(at_s(0.01 * k)));
  run.run(1.1);
  const std::vector<Left>& left = run.left();
  std::size_t rests = 0;
  while (rests < left.size() && (left[rests].sample.status & status::at_rest) != 0) ++rests;
  ASSERT_GT(rests, 100U);
  ASSERT_GT(left.size(), rests + 5);
  const Sample& last = left[rests - 1].sample;
  EXPECT_GT(last.specific_force.norm(), 9);
  for (std::size_t k = rests; k < left.size(); ++k) {
    EXPECT_EQ(left[k].sample.specific_force, last.specific_force) << k;
    EXPECT_EQ(left[k].sample.counter, last.counter) << k;
  }
}

TEST_F(BegunFaults, WithoutAnEarlierSampleTheFirstOneIsHeld) {
  const Config all = config(1000, "");
  const std::vector<FaultConfig> configured = {read("target = \"gyro\"\nkind = \"stuck\"\n", all.imus),
                                               read("target = \"barometer\"\nkind = \"stuck\"\n", all.imus),
                                               read("target = \"message\"\nkind = \"counter_stuck\"\n", all.imus)};
  for (const bool by_control : {false, true}) {
    FaultLog log;
    ChannelFaults faults(by_control ? std::span<const FaultConfig>() : configured, {}, all.imus[0], 0, 1, log, 3);
    if (by_control)
      for (std::uint32_t i = 0; i < 3; ++i) faults.add(configured[i], i, Sample{});
    for (std::uint64_t k = 7; k < 12; ++k) {
      Sample sample;
      sample.counter = k;
      sample.rate.setConstant(static_cast<double>(k));
      sample.pressure = 1e5 + static_cast<double>(k);
      faults.take(sample, static_cast<int>(k) * 1ms, std::nullopt);
      faults.messages().forge(sample);
      EXPECT_EQ(sample.rate.x(), 7) << k;
      EXPECT_EQ(sample.pressure, 1e5 + 7) << k;
      EXPECT_EQ(sample.counter, 7U) << k;
    }
  }
}

TEST_F(BegunFaults, APowerFailureAtRestEnds) {
  const std::vector<std::uint64_t> left = left_at_rest("target = \"power\"\nkind = \"off\"\n");
  ASSERT_NEAR(static_cast<double>(left.size()), 50, 2);  // of 90
  EXPECT_EQ(left.back() - left.front() + 1, left.size());
}

TEST_F(BegunFaults, SilenceOfTheWireAtRestEnds) {
  const std::vector<std::uint64_t> left = left_at_rest("target = \"wire\"\nkind = \"silence\"\n");
  EXPECT_NEAR(static_cast<double>(left.size()), 50, 2);
}

}  // namespace
}  // namespace imud
