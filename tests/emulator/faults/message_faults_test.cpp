// Faults of messages and of truth: each kind in closed form, through the bytes.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "emulator/faults/fault_kinds.hpp"
#include "tests/emulator/faults/faulty_run.hpp"

namespace imud {
namespace {

constexpr std::size_t first_late = 1000, last_late = 1499;

class MessageFaultsTest : public FaultyRunTest {
 protected:
  Result faulty(const std::string& kind, const std::string& settings = "", const std::string& target = "message") {
    return run(
        fmt::format("[[fault]]\ntarget = \"{}\"\nkind = \"{}\"\n{}at_s = 2\nfor_s = 1\n", target, kind, settings));
  }
  // Every sample outside of the window has the frame that it has without the fault.
  void expect_same_outside(const Result& faulty, const Result& clean, std::size_t first = first_late,
                           std::size_t last = last_late) {
    ASSERT_EQ(faulty.frames.size(), clean.frames.size());
    for (std::size_t k = 0; k < clean.frames.size(); ++k)
      ASSERT_TRUE((k >= first && k <= last) || faulty.frames[k].bytes == clean.frames[k].bytes) << k;
  }
};

TEST_F(MessageFaultsTest, MissingMessages) {
  const Result clean = run(""), none = faulty("missing"), some = faulty("missing", "each = 0.25\n");
  ASSERT_EQ(none.frames.size(), clean.frames.size() - 500);
  for (std::size_t k = 0; k < none.frames.size(); ++k)
    ASSERT_EQ(none.frames[k].bytes, clean.frames[k < first_late ? k : k + 500].bytes);
  // Binomial: 125 +- 5 sqrt(500/4 * 3/4) with a false-alarm probability of 6e-7.
  EXPECT_NEAR(static_cast<double>(clean.frames.size() - some.frames.size()), 125, 49);
}

TEST_F(MessageFaultsTest, TwoKindsHaveASecondName) {
  const std::string settings = "delay_ms = 7\n";
  const Result late = faulty("late", settings), delay = faulty("delay", settings);
  ASSERT_EQ(faulty("dropout").frames.size(), late.frames.size() - 500);
  ASSERT_EQ(delay.frames.size(), late.frames.size());
  for (std::size_t k = 0; k < late.frames.size(); ++k) ASSERT_EQ(delay.frames[k].time, late.frames[k].time) << k;
  // A replay waits for late truth, so that its frames are the same.
  ASSERT_NE(find_fault_kind("late", "truth"), nullptr);
  EXPECT_EQ(find_fault_kind("delay", "truth"), find_fault_kind("late", "truth"));
  EXPECT_EQ(find_fault_kind("delay", "wire"), nullptr);
}

TEST_F(MessageFaultsTest, RepeatedMessages) {
  const Result clean = run(""), twice = faulty("repeated", "value = 2\n");
  ASSERT_EQ(twice.frames.size(), clean.frames.size() + 1000);
  for (std::size_t k = first_late; k <= last_late; ++k)
    for (std::size_t copy = 0; copy < 3; ++copy)
      ASSERT_EQ(twice.frames[first_late + 3 * (k - first_late) + copy].bytes, clean.frames[k].bytes);
}

TEST_F(MessageFaultsTest, LateMessages) {
  const Result clean = run(""), late = faulty("late", "delay_ms = 7\n");
  ASSERT_EQ(late.frames.size(), clean.frames.size());
  for (std::size_t k = 0; k < clean.frames.size(); ++k) {
    ASSERT_EQ(late.frames[k].bytes, clean.frames[k].bytes) << k;
    // Those that follow wait until the last late one has left.
    const bool is_late = k >= first_late && k <= last_late;
    const auto expected = clean.frames[k].time + (is_late ? std::chrono::milliseconds(7) : Nanoseconds{0});
    if (k > last_late && k <= last_late + 3) {
      ASSERT_GE(late.frames[k].time, clean.frames[last_late].time + std::chrono::milliseconds(7)) << k;
    } else {
      ASSERT_EQ(late.frames[k].time, expected) << k;
    }
  }
}

TEST_F(MessageFaultsTest, JitterKeepsTheOrder) {
  const Result clean = run(""), late = faulty("late", "delay_ms = 1\njitter_ms = 10\n");
  ASSERT_EQ(late.frames.size(), clean.frames.size());
  std::set<std::int64_t> delays;
  for (std::size_t k = 0; k < clean.frames.size(); ++k) {
    ASSERT_EQ(late.frames[k].bytes, clean.frames[k].bytes) << k;
    ASSERT_TRUE(k == 0 || late.frames[k].time >= late.frames[k - 1].time);
    delays.insert((late.frames[k].time - clean.frames[k].time).count());
  }
  EXPECT_GT(delays.size(), 100U);
  EXPECT_LE(*delays.rbegin(), 11'000'000);
}

TEST_F(MessageFaultsTest, BatchesOfAUsbAdapter) {
  const Result clean = run(""), batched = faulty("batched", "period_ms = 16\n");
  ASSERT_EQ(batched.frames.size(), clean.frames.size());
  std::map<std::int64_t, int> batches;
  for (std::size_t k = 0; k < clean.frames.size(); ++k) {
    ASSERT_EQ(batched.frames[k].bytes, clean.frames[k].bytes) << k;
    if (k < first_late || k > last_late) continue;
    const Nanoseconds late = batched.frames[k].time - clean.frames[k].time;
    ASSERT_TRUE(late >= Nanoseconds{0} && late < std::chrono::milliseconds(16));
    ASSERT_EQ(batched.frames[k].time.ns % 16'000'000, 0);
    ++batches[batched.frames[k].time.ns];
  }
  // 500 Hz: eight messages in a batch. The first message is at a multiple of 16 ms, and the last batch has 3.
  EXPECT_EQ(batches.size(), 64U);
  EXPECT_EQ(std::next(batches.begin())->second, 8);
}

TEST_F(MessageFaultsTest, MessagesChangePlaces) {
  const Result clean = run(""), other = faulty("out_of_order");
  expect_same_outside(other, clean);
  for (std::size_t k = first_late; k <= last_late; ++k)
    ASSERT_EQ(other.frames[k].bytes, clean.frames[k % 2 == 0 ? k + 1 : k - 1].bytes) << k;
}

// A sample of these products has no message, or one message: each second sample of a STIM300, each tenth of a MIP
// unit, each twentieth of a VectorNav unit.
TEST_F(MessageFaultsTest, MessagesOfDividedRatesChangePlaces) {
  const std::string faults = "[[fault]]\ntarget = \"message\"\nkind = \"out_of_order\"\nat_s = 2\nfor_s = 1\n";
  for (const std::string product : {"stim300", "mip", "vectornav"}) {
    SCOPED_TRACE(product);
    const std::string keys = product == "stim300" ? "" : "navigation.solution = \"truth\"\n";
    const Result clean = run("", product, 1, keys), other = run(faults, product, 1, keys);
    ASSERT_EQ(other.frames.size(), clean.frames.size());
    ASSERT_EQ(other.labels.size(), 1U);
    const DeviceTime first = other.labels[0].first.device_time, last = other.labels[0].last.device_time;
    std::size_t changed = 0;
    for (std::size_t k = 0; k < clean.frames.size(); ++k) {
      if (other.frames[k].bytes == clean.frames[k].bytes) continue;
      ++changed;
      ASSERT_TRUE(clean.frames[k].time >= first && clean.frames[k].time <= last) << k;
      const bool is_later = k > 0 && other.frames[k].bytes == clean.frames[k - 1].bytes;
      const bool is_earlier = k + 1 < clean.frames.size() && other.frames[k].bytes == clean.frames[k + 1].bytes;
      ASSERT_TRUE(is_later || is_earlier) << k;
    }
    EXPECT_GT(changed, 30U);
  }
}

// Each message leaves once. Both faults withhold the even samples, one from 1000 and the other one from 1252 on; a
// message that follows a withheld one is not withheld.
TEST_F(MessageFaultsTest, TwoFaultsOfTheOrderLoseNoMessage) {
  const std::string out_of_order = "[[fault]]\ntarget = \"message\"\nkind = \"out_of_order\"\n";
  const Result clean = run(""), both = run(out_of_order + "at_sample = 1000\nfor_samples = 500\n" + out_of_order +
                                           "at_sample = 1251\nfor_samples = 500\n");
  expect_same_outside(both, clean, 1000, 1750);
  std::multiset<std::string> sent, expected;
  for (const Sent& frame : both.frames) sent.insert(frame.bytes);
  for (const Sent& frame : clean.frames) expected.insert(frame.bytes);
  EXPECT_EQ(sent, expected);
  for (std::size_t k = 1000; k < 1500; ++k)
    ASSERT_EQ(both.frames[k].bytes, clean.frames[k % 2 == 0 ? k + 1 : k - 1].bytes) << k;
}

// The run has 5001 samples: the last one, number 5000, is withheld at its end.
TEST_F(MessageFaultsTest, AMessageThatIsWithheldAtTheEndLeaves) {
  const std::string to_the_end = "[[fault]]\ntarget = \"message\"\nkind = \"out_of_order\"\nat_s = 2\n";
  const Result clean = run(""), other = run(to_the_end);
  ASSERT_EQ(clean.frames.size(), 5001U);
  expect_same_outside(other, clean, first_late, 4999);
  for (std::size_t k = first_late; k <= 4999; ++k)
    ASSERT_EQ(other.frames[k].bytes, clean.frames[k % 2 == 0 ? k + 1 : k - 1].bytes) << k;
}

TEST_F(MessageFaultsTest, Counters) {
  const Result clean = run(""), stuck = faulty("counter_stuck"), ahead = faulty("counter_jump", "value = 100\n");
  expect_same_outside(stuck, clean);
  expect_same_outside(ahead, clean);
  for (std::size_t k = first_late; k <= last_late; ++k) {
    ASSERT_EQ(stuck.measurements[k].sample.counter, first_late - 1);
    ASSERT_EQ(ahead.measurements[k].sample.counter, k + 100);
  }
}

// A product that divides its rate sends the messages that it sends without the fault, also afterwards.
TEST_F(MessageFaultsTest, CountersDecideNoMessage) {
  const std::string ranges = "gyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n";
  struct Product {
    std::string name, keys;
    bool is_counted;  // its frames have a counter
  };
  const std::vector<Product> products = {
      {"stim300", "", true},
      {"mip", "navigation.solution = \"truth\"\n", false},
      {"vectornav", "navigation.solution = \"truth\"\n", false},
      {"hg1120", "", true},
      {"hg4930", "", true},
      {"kvh1775", "", true},
      {"dmu", ranges, true},
      {"epson-burst", "rate_hz = 125\n" + ranges, true},
      {"applanix-gsof", "rate_hz = 100\n" + ranges, true},
  };
  for (const auto& [name, keys, is_counted] : products) {
    const Result clean = run("", name, 1, keys);
    ASSERT_GT(clean.frames.size(), 300U) << name;
    for (const std::string kind : {"counter_stuck", "counter_jump"}) {
      SCOPED_TRACE(name + " " + kind);
      // The fault begins between two messages of the products that divide their rate.
      const Result faulty = run(fmt::format("[[fault]]\ntarget = \"message\"\nkind = \"{}\"\n{}"
                                            "at_s = 2.0017\nfor_s = 1.0023\n",
                                            kind, kind == "counter_jump" ? "value = 13\n" : ""),
                                name, 1, keys);
      ASSERT_EQ(faulty.frames.size(), clean.frames.size());
      ASSERT_EQ(faulty.labels.size(), 1U);
      const DeviceTime first = faulty.labels[0].first.device_time, last = faulty.labels[0].last.device_time;
      std::size_t changed = 0;
      for (std::size_t k = 0; k < clean.frames.size(); ++k) {
        ASSERT_EQ(faulty.frames[k].time, clean.frames[k].time) << k;
        if (faulty.frames[k].bytes == clean.frames[k].bytes) continue;
        ++changed;
        ASSERT_TRUE(faulty.frames[k].time >= first && faulty.frames[k].time <= last) << k;
      }
      EXPECT_TRUE(!is_counted || changed > 50) << changed;
    }
  }
}

// 200 messages a second with the counter of the message.
TEST_F(MessageFaultsTest, CountersOfMessages) {
  const std::string ranges = "gyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n",
                    from = "[[fault]]\ntarget = \"message\"\nat_sample = 400\nfor_samples = 200\nkind = ";
  const Result stuck = run(from + "\"counter_stuck\"\n", "dmu", 1, ranges),
               ahead = run(from + "\"counter_jump\"\nvalue = 100\n", "dmu", 1, ranges);
  ASSERT_GE(stuck.measurements.size(), 600U);
  ASSERT_GE(ahead.measurements.size(), 600U);
  for (std::size_t k = 0; k < 600; ++k) {
    ASSERT_EQ(stuck.measurements[k].sample.counter, std::min<std::size_t>(k, 399));
    ASSERT_EQ(ahead.measurements[k].sample.counter, k < 400 ? k : k + 100);
  }
}

TEST_F(MessageFaultsTest, FlagsThatLie) {
  const Result clean = run(""), invalid = faulty("invalid");
  const Result both =
      run("[[fault]]\ntarget = \"accelerometer\"\nkind = \"saturation\"\nvalue = 1\nat_s = 2\nfor_s = 1\n"
          "[[fault]]\ntarget = \"message\"\nkind = \"valid\"\nat_s = 2\nfor_s = 1\n");
  expect_same_outside(invalid, clean);
  for (std::size_t k = first_late; k <= last_late; ++k) {
    ASSERT_EQ(invalid.measurements[k].sample.status, clean.measurements[k].sample.status | status::not_valid);
    ASSERT_EQ(both.measurements[k].sample.status, 0U);
    ASSERT_EQ(std::abs(both.measurements[k].sample.specific_force.z()), 1.0);
  }
}

TEST_F(MessageFaultsTest, ClocksThatAreWrong) {
  const Result clean = run(""), jump = faulty("jump", "value_s = -0.25\n", "clock"),
               drift = faulty("drift", "value_ppm = 200\n", "clock");
  expect_same_outside(jump, clean);
  expect_same_outside(drift, clean);
  for (std::size_t k = first_late; k <= last_late; ++k) {
    const DeviceTime time = clean.measurements[k].sample.time;
    ASSERT_EQ(jump.measurements[k].sample.time, time - std::chrono::milliseconds(250));
    // 200 ppm of 2 ms are 400 ns in each period.
    ASSERT_EQ(drift.measurements[k].sample.time, time + Nanoseconds{400 * static_cast<std::int64_t>(k - first_late)});
  }
}

// Truth has 200 Hz: the fault begins with the truth at 2 s, and the first one after it is that at 3 s.
TEST_F(MessageFaultsTest, TruthThatFreezesOrIsNoNumber) {
  const Result clean = run(""), frozen = faulty("frozen", "", "truth"), nan = faulty("nan", "", "truth"),
               late = faulty("late", "value = 5\n", "truth");
  for (const Result* result : {&frozen, &nan}) {
    ASSERT_EQ(result->frames.size(), clean.frames.size());
    // The curve between two truths depends on both.
    for (std::size_t k = 0; k < clean.frames.size(); ++k) {
      if (k >= 997 && k <= 1501) continue;
      ASSERT_LT((result->measurements[k].sample.rate - clean.measurements[k].sample.rate).norm(), 1e-12) << k;
    }
  }
  for (std::size_t k = 1003; k < 1490; ++k) {
    ASSERT_TRUE(frozen.measurements[k].sample.delta_angle.norm() < 1e-3) << k;
    ASSERT_TRUE(nan.measurements[k].sample.rate.allFinite());
  }
  ASSERT_EQ(frozen.labels.size(), 1U);
  EXPECT_EQ(frozen.labels[0].imu, "truth");
  EXPECT_EQ(frozen.labels[0].first.sample, 400U);
  EXPECT_EQ(frozen.labels[0].last.sample, 599U);
  // A capture waits for its truths: those that are late change nothing.
  EXPECT_EQ(late.all_bytes, clean.all_bytes);
}

}  // namespace
}  // namespace imud
