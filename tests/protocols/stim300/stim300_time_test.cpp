// The STIM300's time, with and without samples: start-up, timeouts, deadlines, a clock that is set.
#include <gtest/gtest.h>

#include "core/units.hpp"
#include "tests/protocols/stim300/stim300_unit.hpp"

namespace imud {
namespace {

using namespace stim300_test;
using namespace std::chrono_literals;

std::vector<unsigned> identifiers(const Datagrams& datagrams) {
  std::vector<unsigned> all;
  for (const auto& datagram : datagrams) all.push_back(first(datagram));
  return all;
}
const std::vector<unsigned> start = {0xB1U, 0xB5U, 0xBCU};

// Accumulated errors, as $ie lists them, after "#ie".
constexpr const char* no_errors = "#ie,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0";
constexpr const char* start_up_active = "#ie,0,0,0,0,0,0,0,0,0,0,0,0,0,0,1,0,0";

// Section 7.5.1 and Table 5-2. A datagram takes 1.1 times its characters (Equation 12): 0.24 ms at 921600 bit/s, 20
// of them 1.2 ms at 184320 bit/s.
TEST(Stim300Time, BootsWithoutASample) {
  Stim300Unit unit("");
  const auto check = [&] {
    EXPECT_TRUE(unit.wait(99'999us).empty());
    EXPECT_EQ(identifiers(unit.wait(1us)), std::vector{0xB1U});
    EXPECT_TRUE(unit.wait(499us).empty()) << "the next internal sample";
    EXPECT_EQ(identifiers(unit.wait(1us)), std::vector{0xB5U});
    EXPECT_EQ(identifiers(unit.wait(500us)), std::vector{0xBCU});
    EXPECT_TRUE(unit.wait(10s).empty()) << "no measurement without a sample";
  };
  check();
  EXPECT_EQ(unit.send_line("R"), "");
  check();
  unit.wait(123us);
  unit.device->power_on(unit.now());
  check();
  unit.send_line("UTILITYMODE");
  EXPECT_EQ(unit.ask("st,184320,1,n,1,0,0"), "#st,0,184320,1,N,1,0,0");
  unit.ask("save");
  unit.device->power_on(unit.now());
  EXPECT_EQ(unit.send_line("$xn,150"), "") << "in Normal Mode";
  EXPECT_EQ(identifiers(unit.wait(101'499us)), std::vector{0xB1U});
  EXPECT_EQ(identifiers(unit.wait(1us)), std::vector{0xB5U});
  EXPECT_EQ(identifiers(unit.wait(1500us)), std::vector{0xBCU});
}

// 20 characters take 147 ms (Equation 12).
TEST(Stim300Time, TheStartWaitsForTheLine) {
  Stim300Unit unit("");
  unit.wait(1s);
  unit.send_line("UTILITYMODE");
  unit.ask("st,1500,1,n,1,0,0");
  unit.ask("save");
  unit.ask("xn");
  unit.send_line("N");
  EXPECT_EQ(identifiers(unit.wait(1ms)), std::vector{0xB1U});
  unit.send_line("R");
  EXPECT_TRUE(unit.wait(146ms).empty());
  EXPECT_EQ(identifiers(unit.wait(1ms)), std::vector{0xB1U});
  EXPECT_TRUE(unit.wait(146ms).empty());
  EXPECT_EQ(identifiers(unit.wait(1ms)), std::vector{0xB5U});
  unit.device->power_on(unit.now());
  EXPECT_EQ(identifiers(unit.wait(100ms)), std::vector{0xB1U}) << "without power there is nothing on the line";
}

TEST(Stim300Time, IsStartingForSevenTenthsOfASecond) {
  for (const bool has_samples : {false, true}) {
    Stim300Unit unit("");
    const auto pass = [&](int steps) { has_samples ? unit.run(steps) : unit.wait(steps * 500us); };
    for (int i = 0; i < 2; ++i) {
      pass(1399);
      unit.send_line("UTILITYMODE");
      EXPECT_EQ(unit.ask("ie"), start_up_active);
      unit.ask("xn");
      unit.send_line("R");
      pass(1402);
      unit.send_line("UTILITYMODE");
      EXPECT_EQ(unit.ask("ie"), no_errors) << "it is over, and nothing else went wrong";
      unit.ask("xn");
      unit.device->power_on(unit.now());
    }
  }
}

TEST(Stim300Time, AnswersWithoutASample) {
  for (const char* settings : {"", "start_up=false"}) {
    Stim300Unit unit(settings);
    EXPECT_EQ(unit.send_line("UTILITYMODE"), "#UTILITYMODE,234\r");
    EXPECT_EQ(unit.send_line("$isn,28"), "#isn,0,N25582405002002,252\r");
    EXPECT_TRUE(unit.wait(1s).empty());
    EXPECT_EQ(unit.ask("xn"), "#xn,0");
    EXPECT_EQ(identifiers(unit.wait(1s)), *settings == 0 ? start : std::vector<unsigned>{})
        << "those of the start have waited";
    EXPECT_TRUE(unit.send_line("SERVICEMODE").starts_with("SERIAL NUMBER = "));
    EXPECT_EQ(unit.send_line("i n"), "i n\rPRODUCT = STIM300\r>");
    EXPECT_TRUE(unit.send_line("a").starts_with("a\rGYRO X-AXIS = 0.00000 \xB0/s\r"));
    unit.send_line("x N");
    for (const auto& [request, id] :
         {std::pair{"N", 0xB1U}, {"I", 0xB5U}, {"C", 0xBCU}, {"T", 0xD1U}, {"E", 0xBEU}}) {
      EXPECT_EQ(unit.send_line(request), "");
      EXPECT_TRUE(unit.wait(999us).empty()) << "the slot of a sample that may still come";
      EXPECT_EQ(identifiers(unit.wait(1s)), std::vector{id}) << request;
    }
    EXPECT_EQ(unit.send_line("UTILITYMODE"), "#UTILITYMODE,234\r");
    EXPECT_EQ(unit.ask("ie"), no_errors);
  }
}

TEST(Stim300Time, ARequestDuringTheStartWaitsWithoutASample) {
  Stim300Unit unit("bit_rate=374400");
  unit.send_line("N");
  EXPECT_EQ(identifiers(unit.wait(1s)), (std::vector{0xB1U, 0xB5U, 0xBCU, 0xB1U}));
  unit.send_line("SERVICEMODE");
  unit.send_line("m 5");
  unit.send_line("x N");
  unit.send_line("I");
  EXPECT_TRUE(unit.wait(1s).empty()) << "an edge";
  EXPECT_TRUE(unit.run(3).empty());
  unit.device->trigger(unit.now() + 400us);
  EXPECT_EQ(identifiers(unit.run(1)), std::vector{0xB5U});
}

TEST(Stim300Time, ARequestThatHasWaitedIsNoFault) {
  Stim300Unit unit("");
  unit.wait(1ms);
  unit.send_line("N");
  EXPECT_EQ(unit.send_line("UTILITYMODE"), "#UTILITYMODE,234\r");
  EXPECT_TRUE(unit.wait(1s).empty());
  unit.ask("xn");
  EXPECT_EQ(identifiers(unit.wait(1s)), (std::vector{0xB1U, 0xB5U, 0xBCU, 0xB1U}));
  unit.send_line("I");
  EXPECT_EQ(unit.send_line("UTILITYMODE"), "#UTILITYMODE,234\r");
  EXPECT_EQ(unit.ask("ie"), no_errors);
  EXPECT_TRUE(unit.wait(1s).empty());
  unit.ask("xn");
  EXPECT_EQ(identifiers(unit.wait(1s)), std::vector{0xB5U});

  // Samples begin at the instant at which the request is answered.
  Stim300Unit other("start_up=false");
  other.send_line("N");
  EXPECT_EQ(identifiers(other.wait(1ms)), std::vector{0xB1U});
  EXPECT_TRUE(other.run(1).empty());
  EXPECT_EQ(identifiers(other.run(2)), std::vector{0xA7U});
  other.send_line("UTILITYMODE");
  EXPECT_EQ(other.ask("ie"), no_errors);
}

// Edges and deadlines are executed in order of time, also if a deadline is not at the time of a sample.
TEST(Stim300Time, AnEdgeWaitsForItsTime) {
  Stim300Unit unit("sample_rate=0");
  unit.wait(123us);
  EXPECT_EQ(identifiers(unit.run(1400)), start);
  ASSERT_EQ(unit.device->deadline(), DeviceTime{} + 700ms);
  unit.device->trigger(DeviceTime{} + 700'100us);
  FrameBuffer out;
  unit.device->poll(DeviceTime{} + 700ms, out);
  EXPECT_TRUE(out.frames().empty());
  EXPECT_EQ(identifiers(unit.run(1)), std::vector{0xA7U});
}

TEST(Stim300Time, HoldTimesPassWithoutASample) {
  Stim300Unit unit;
  unit.send_line("SERVICEMODE");
  EXPECT_EQ(unit.send_line("x n"), "x n\rSYSTEM RETURNING TO NORMAL MODE\r");
  EXPECT_TRUE(unit.wait(2999ms).empty());
  EXPECT_EQ(unit.send_line("UTILITYMODE"), "");
  unit.wait(1ms);
  EXPECT_EQ(unit.send_line("UTILITYMODE"), "#UTILITYMODE,234\r");
  unit.ask("xn");
  unit.send_line("SERVICEMODE");
  unit.send_line("x i");
  EXPECT_TRUE(unit.wait(3099ms).empty());
  EXPECT_EQ(identifiers(unit.wait(1s)), start);
}

TEST(Stim300Time, AnUnfinishedLineTimesOutWithoutASample) {
  Stim300Unit unit;
  unit.send("UTILITY");
  unit.wait(1001ms);
  EXPECT_EQ(unit.send_line("MODE"), "");
  unit.send("UTILITY");
  unit.wait(1000ms);
  EXPECT_EQ(unit.send_line("MODE"), "#UTILITYMODE,234\r");
  unit.ask("xn");
  unit.send_line("SERVICEMODE");
  EXPECT_EQ(unit.send("m "), "m ");
  unit.wait(59'999ms);
  EXPECT_EQ(unit.send("1"), "1");
  unit.wait(59'999ms);
  EXPECT_EQ(unit.send("\r"), "\rSAMPLE RATE [samples/s] = 250\r>");
  unit.send("m 2");
  unit.wait(60s);
  EXPECT_EQ(unit.send("\r"), "\r>");
}

TEST(Stim300Time, PowerOnForgets) {
  for (const bool starts : {false, true}) {
    Stim300Unit unit(starts ? "" : "start_up=false");
    unit.run(3000);
    unit.send_line("UTILITYMODE");
    unit.ask("sgu,1");
    unit.send("$xn,");
    unit.device->power_on(unit.now() + 1s);
    unit.wait(1s);
    EXPECT_EQ(unit.send_line("UTILITYMODE"), "#UTILITYMODE,234\r") << "in Normal Mode, no half line before it";
    EXPECT_EQ(unit.ask("igu"), "#igu,0,0") << "not saved";
    unit.ask("xn");
    unit.device->power_on(unit.now() + 10ms);
    unit.wait(10ms - 500us);
    const auto datagrams = unit.run(203);
    ASSERT_FALSE(datagrams.empty());
    if (starts) {
      EXPECT_EQ(identifiers(datagrams), start);
      continue;
    }
    EXPECT_GE(datagrams.size(), 101U) << "at once";
    EXPECT_EQ(datagrams[0][10], std::byte{0}) << "valid";
    unit.send_line("R");
    EXPECT_TRUE(unit.run(200).empty()) << "a host's reset starts up all the same";
    const auto after = unit.run(100);
    ASSERT_GT(after.size(), 40U);
    EXPECT_EQ(identifiers({after.begin(), after.begin() + 3}), start);
    EXPECT_EQ(after[3][10], std::byte{0x40});
  }
}

TEST(Stim300Time, AnEdgeBeforeAnySampleSendsNothing) {
  Stim300Unit unit("start_up=false,sample_rate=0");
  unit.device->trigger(unit.now());
  EXPECT_TRUE(unit.run(2).empty());
  unit.device->trigger(unit.now() + 400us);
  EXPECT_EQ(unit.run(1).size(), 1U);
}

TEST(Stim300Time, PowerOnDiscardsTheLineAndTheTrigger) {
  Stim300Unit unit("start_up=false,sample_rate=0");
  unit.send_line("UTILITYMODE");
  unit.ask("st,1500,1,n,1,0,0");
  unit.ask("save");
  unit.ask("xn");
  unit.run(2);
  unit.device->trigger(unit.now() + 400us);
  EXPECT_EQ(unit.run(1).size(), 1U);
  unit.device->power_on(unit.now() + 100us);
  unit.run(2);
  unit.device->trigger(unit.now() + 1us);
  EXPECT_EQ(unit.run(1).size(), 1U) << "its 59 characters took 433 ms";
  unit.device->trigger(unit.now() + 400us);
  EXPECT_EQ(unit.run(1).size(), 0U) << "it is busy again";
  unit.device->trigger(unit.now() + 400us);
  unit.device->power_on(unit.now() + 450us);
  unit.run(1);
  unit.device->trigger(unit.now() + 300us);
  EXPECT_EQ(unit.run(1).size(), 1U) << "400 us after an edge before the power failed";
}

// Samples may begin at any time, even during start-up, and anywhere on the grid since power-on.
TEST(Stim300Time, SamplesMayBeginLater) {
  int begun = 0;
  for (const Nanoseconds wait : {0us, 50'000us, 50'123us, 100'000us, 100'001us, 100'500us, 101'100us, 5'000'250us}) {
    Stim300Unit unit("");
    Datagrams datagrams = unit.wait(wait);
    for (const auto& datagram : unit.run(2000)) datagrams.push_back(datagram);
    ASSERT_GT(datagrams.size(), 800U);
    const std::vector<unsigned> sent = identifiers(datagrams);
    EXPECT_EQ(std::vector(sent.begin(), sent.begin() + 3), start) << wait.count();
    EXPECT_EQ(std::count(sent.begin(), sent.end(), 0xA7U), static_cast<long>(sent.size()) - 3) << wait.count();
    begun += datagrams[3][10] == std::byte{0x40} ? 1 : 0;
    EXPECT_EQ(datagrams.back()[10], std::byte{0});
    unit.send_line("UTILITYMODE");
    EXPECT_EQ(unit.ask("ie"), no_errors) << wait.count();
  }
  EXPECT_EQ(begun, 7);
}

// --- Random calls

constexpr const char* short_commands[] = {"N\r",           "I\r",   "C\r",    "T\r",           "E\r",     "R\r",
                                          "UTILITYMODE\r", "$xn",   ",150\r", "SERVICEMODE\r", "x N\r",   "x i\rY\r",
                                          "x n\rY\r",      "m 5\r", "m 4\r",  "m 1\r",         "h t,1\r", "s\rY\r",
                                          "UTIL",          "a\r",   "t 0\r",  "t 3\r",         "d t,1\r", "i p\r"};

// Makes the same random calls of several devices, each with a clock of its own, and compares their output.
class Calls {
 public:
  explicit Calls(std::vector<const char*> settings, std::uint64_t seed) : random_(seed) {
    for (const char* one : settings) units_.push_back({std::move(Stim300Unit(one).device), {}});
  }

  void step(std::size_t unit, Nanoseconds by) {
    units_[unit].device->step_clock(by);
    units_[unit].ahead += by;
  }
  void make_one() {
    const auto below = [&](std::uint64_t n) { return random_() % n; };
    switch (below(8)) {
      case 0: {
        const std::string_view text = short_commands[below(std::size(short_commands))];
        each([&](Device& device, DeviceTime now) { device.receive({std::as_bytes(std::span(text))}, now, *out_); });
        break;
      }
      case 1:
        now_ = now_ + std::chrono::nanoseconds(below(2) == 0 ? below(1'000'000) : below(4'000'000'000));
        break;
      case 2: {
        const Nanoseconds after(1 + below(500'000));
        const bool is_edge = below(2) == 0;
        each(
            [&](Device& device, DeviceTime now) { is_edge ? device.trigger(now + after) : device.pps(now + after); });
        now_ = now_ + after;
        break;
      }
      case 3:
        if (below(50) == 0) each([&](Device& device, DeviceTime now) { device.power_on(now); });
        break;
      case 4:
        poll();
        break;
      default:
        for (std::uint64_t n = below(30); n > 0; --n) {
          now_ = now_ + 500us;
          if (below(2) == 0) poll();
          sample_.counter += 1;
          sample_.rate.x() = static_cast<double>(sample_.counter % 100) * 1e-2;
          sample_.delta_angle.y() = static_cast<double>(sample_.counter % 77) * 1e-6;
          each([&](Device& device, DeviceTime now) {
            sample_.time = now;
            device.sample(sample_, *out_);
          });
        }
    }
  }

  std::size_t frames = 0, polls = 0, pulses = 0;

 private:
  struct Unit {
    std::unique_ptr<Device> device;
    Nanoseconds ahead;  // of now_
  };

  // At its deadline or later.
  void poll() {
    const auto due = units_[0].device->deadline();
    if (due && *due - units_[0].ahead > now_) return;
    polls += due ? 1 : 0;
    each([&](Device& device, DeviceTime now) {
      device.poll(now, *out_);
      ASSERT_GT(device.deadline().value_or(now + 1h), now);
    });
  }
  template <class Call>
  void each(Call&& call) {
    Datagrams wanted;
    std::vector<Nanoseconds> wanted_times;
    for (std::size_t i = 0; i < units_.size(); ++i) {
      const auto& [device, ahead] = units_[i];
      const DeviceTime now = now_ + ahead;
      out_->clear();
      call(*device, now);
      Datagrams sent;
      for (const Frame& frame : out_->frames()) sent.emplace_back(frame.bytes.begin(), frame.bytes.end());
      std::vector<Nanoseconds> times;
      if (const auto due = device->deadline()) times.push_back(*due - now);
      if (const auto pulse = device->pulse()) {
        times.push_back(pulse->begin - now);
        times.push_back(pulse->end - now);
        ++pulses;
      }
      frames += sent.size();
      if (i == 0) {
        wanted = sent;
        wanted_times = times;
      }
      ASSERT_EQ(sent, wanted);
      ASSERT_EQ(times, wanted_times);
    }
  }

  std::vector<Unit> units_;
  std::mt19937_64 random_;
  DeviceTime now_;
  Sample sample_;
  std::unique_ptr<FrameBuffer> out_ = std::make_unique<FrameBuffer>();
};

TEST(Stim300Time, ADeadlineLiesAheadAfterAPoll) {
  std::size_t frames = 0, polls = 0, pulses = 0;
  for (const char* settings : {"", "start_up=false", "bit_rate=374400,pps=true,sample_rate=0"})
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
      Calls calls({settings}, seed);
      for (int i = 0; i < 2000 && !testing::Test::HasFailure(); ++i) calls.make_one();
      frames += calls.frames;
      polls += calls.polls;
      pulses += calls.pulses;
    }
  EXPECT_GT(frames, 50'000U);
  EXPECT_GT(polls, 500U);
  EXPECT_GT(pulses, 50'000U);
}

TEST(Stim300Time, AClockThatIsSetMovesNothingElse) {
  std::size_t frames = 0;
  for (const char* settings : {"pps=true", "start_up=false,pps=true,sample_rate=500", "pps=true,sample_rate=0"})
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
      Calls calls({settings, settings, settings}, seed);
      std::mt19937_64 random(seed);
      const auto by = [&] {
        return Nanoseconds(static_cast<std::int64_t>(random() % 100'000'000'000'000) - 50'000'000'000'000);
      };
      calls.step(1, 1'420'000'000s + 123us);
      for (int i = 0; i < 1000 && !testing::Test::HasFailure(); ++i) {
        if (random() % 20 == 0) calls.step(2, by());
        calls.make_one();
      }
      frames += calls.frames;
    }
  EXPECT_GT(frames, 50'000U);
}

TEST(Stim300Time, ANewRunKeepsTheTimeSinceAPulse) {
  Stim300Unit unit("start_up=false,pps=true,sample_rate=2000,bit_rate=1843200");
  unit.run(10);
  unit.device->pps(unit.now() + 250us);
  unit.run(10);
  unit.step_clock(-3ms);
  const auto datagram = unit.run(1).at(0);
  const auto at = [&](std::size_t i) { return std::to_integer<unsigned>(datagram[i]); };
  EXPECT_EQ(at(52) << 16 | at(53) << 8 | at(54), 10 * 500 + 250 + 506U);
}

}  // namespace
}  // namespace imud
