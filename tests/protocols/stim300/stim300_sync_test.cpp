// The STIM300's external trigger, PPS and TOV against its datasheet, TS1524 rev. 31, sections 7.2 to 7.4.
#include <gtest/gtest.h>

#include "core/units.hpp"
#include "tests/protocols/stim300/stim300_unit.hpp"

namespace imud {
namespace {

using namespace stim300_test;

using namespace std::chrono_literals;
using Bytes = std::vector<std::byte>;

unsigned number(const Bytes& datagram, std::size_t from_end, unsigned bytes) {
  unsigned value = 0;
  for (std::size_t i = datagram.size() - from_end; bytes > 0; --bytes)
    value = value << 8 | std::to_integer<unsigned>(datagram[i++]);
  return value;
}
unsigned latency_us(const Bytes& datagram) { return number(datagram, 6, 2); }
unsigned counter(const Bytes& datagram) { return number(datagram, 7, 1); }
unsigned pps_us(const Bytes& datagram) { return number(datagram, 11, 3); }
unsigned pps_status(const Bytes& datagram) { return number(datagram, 8, 1); }

class Triggered : public Stim300Unit {
 public:
  explicit Triggered(const std::string& settings = "start_up=false") : Stim300Unit(settings) {
    send_line("UTILITYMODE");
    ask("sm,5");
    ask("xn");
    run(10);
  }
  // Returns the datagrams after an edge at that time after the last sample, with those of the samples that follow.
  std::vector<Bytes> trigger(Nanoseconds after, int samples = 1) {
    device->trigger(now() + after);
    return run(samples);
  }
};

// Figure 7-3.
TEST(Stim300Trigger, SendsTheLatestCompensatedSampleAtAnEdge) {
  Triggered unit;
  EXPECT_TRUE(unit.run(100).empty()) << "silent without an edge";
  const auto check = [&](Nanoseconds after, unsigned latency, double rate, unsigned before) {
    unit.run(10);
    for (const double x : {0.125, 0.25}) {
      unit.sample.rate = {x, 0, 0};
      unit.run(1);
    }
    const unsigned latest = static_cast<unsigned>(unit.sample.counter);
    unit.sample.rate = {0.5, 0, 0};
    const auto datagrams = unit.trigger(after, 10);
    ASSERT_EQ(datagrams.size(), 1U);
    EXPECT_EQ(latency_us(datagrams[0]), latency)
        << "from the sample that is sent to the edge; 1000 us at most (Table 5-2)";
    EXPECT_EQ(counter(datagrams[0]), latest - before);
    EXPECT_NEAR(unit.decode(datagrams).measurements.at(0).sample.rate.x(), rate, 1e-6);
  };
  check(0us, 500, 0.125, 1);
  check(123us, 623, 0.125, 1);
  check(299us, 799, 0.125, 1);
  check(300us, 300, 0.25, 0);
  check(500us, 500, 0.25, 0);
}

// Table 5-2.
TEST(Stim300Trigger, EdgesAreHalfAMillisecondApart) {
  Triggered unit;
  int sent = 0;
  for (int i = 0; i < 100; ++i) sent += static_cast<int>(unit.trigger(i % 2 == 0 ? 200us : 100us).size());
  EXPECT_EQ(sent, 50) << "100, 900 us, ...: 400 us is too soon after the edge before";
  EXPECT_EQ(unit.trigger(300us).size(), 1U);
  unit.run(2000);
  EXPECT_EQ(unit.trigger(300us).size(), 1U) << "a second later; the counter has wrapped (note 7)";
}

// The line could carry all of them: 18 characters take 0.11 ms.
TEST(Stim300Trigger, AnEdgeTooSoonIsNoneOnAnyLine) {
  Triggered unit("start_up=false,bit_rate=1843200,acceleration=false,inclination=false,temperature=false");
  const auto sent = [&](std::initializer_list<Nanoseconds> edges) {  // one after each sample
    unit.run(10);
    std::vector<std::size_t> counts;
    for (const Nanoseconds edge : edges) counts.push_back(unit.trigger(edge).size());
    return counts;
  };
  EXPECT_EQ(sent({400us, 399us}), (std::vector<std::size_t>{1, 0})) << "499 us";
  EXPECT_EQ(sent({400us, 400us, 400us}), (std::vector<std::size_t>{1, 1, 1})) << "500 us";
  EXPECT_EQ(sent({400us, 300us, 1us}), (std::vector<std::size_t>{1, 0, 1})) << "601 us after the one that counts";
}

TEST(Stim300Trigger, AnEdgeOnABusyLineIsLost) {
  Triggered unit("start_up=false,bit_rate=374400");  // 59 characters take 1.58 ms
  int sent = 0;
  for (int i = 0; i < 100; ++i) sent += static_cast<int>(unit.trigger(200us).size());
  EXPECT_EQ(sent, 25);
  unit.run(10);
  unit.send_line("E");
  EXPECT_EQ(unit.trigger(0us).at(0)[8] & std::byte{0x10}, std::byte{0x10}) << "E68";
}

TEST(Stim300Trigger, SpecialDatagramsWaitForAnEdge) {
  Triggered unit;
  unit.send_line("N");
  unit.send_line("C");
  EXPECT_TRUE(unit.run(100).empty());
  EXPECT_EQ(first(unit.trigger(100us).at(0)), 0xBCU) << "the last that was asked for";
  unit.run(10);
  EXPECT_EQ(first(unit.trigger(100us).at(0)), 0xA7U);
  EXPECT_EQ(unit.send_line("UTILITYMODE"), "#UTILITYMODE,234\r");
  EXPECT_TRUE(unit.trigger(100us, 10).empty()) << "not in Utility Mode";
  unit.ask("save");
  unit.ask("xn");
  unit.send_line("R");
  unit.device->trigger(unit.now() + 100us);
  const auto start = unit.run(2000);
  ASSERT_EQ(start.size(), 3U) << "the special ones of the start need no edge (section 7.2)";
  EXPECT_EQ(first(start[0]), 0xB1U);
  EXPECT_EQ(first(unit.trigger(100us).at(0)), 0xA7U);
}

// Table 5-2, note 9: 2^23 steps of 2^-21 deg.
TEST(Stim300Trigger, AnIncrementBeyondItsRangeIsOverload) {
  Triggered unit("start_up=false,gyro_unit=increment");
  unit.sample.delta_angle = Vector3(0, 200, 0) * units::degree / 2000;
  unit.trigger(0us);
  unit.run(38);
  EXPECT_EQ(unit.trigger(0us).at(0)[10], std::byte{0}) << "3.9 deg";
  unit.run(41);
  const Bytes datagram = unit.trigger(0us).at(0);
  EXPECT_EQ(datagram[10], std::byte{0x12}) << "4.2 deg";
  EXPECT_EQ(number(datagram, datagram.size() - 4, 3), 0x7FFFFFU);
}

// Figures 7-6 and 7-7.
TEST(Stim300Pps, CountsFromTheEdge) {
  Stim300Unit unit("start_up=false,pps=true,sample_rate=500");
  EXPECT_EQ(pps_us(unit.run(4).at(0)), 0x7FFFFFU) << "none yet";
  unit.device->pps(unit.now() + 250us);
  const auto datagrams = unit.run(8000);
  for (std::size_t i = 0; i < datagrams.size(); ++i) {
    ASSERT_EQ(pps_us(datagrams[i]), 250 + 2000 * i + 506) << "the sample, and to the end of its latency";
    ASSERT_EQ(pps_status(datagrams[i]), 0U);
  }
  const auto later = unit.run(9000);
  EXPECT_EQ(pps_us(later.back()), 0x7FFFFFU) << "8.4 s are over";
  EXPECT_EQ(pps_status(later.back()), 0x10U);
  unit.send_line("E");
  EXPECT_EQ(unit.run(4).at(0)[2] & std::byte{1}, std::byte{1}) << "E112";

  Triggered triggered("start_up=false,pps=true");
  triggered.device->pps(triggered.now() + 250us);
  triggered.run(2);
  EXPECT_EQ(pps_us(triggered.trigger(100us).at(0)), 250U + 500 + 100) << "to the trigger's edge";
}

TEST(Stim300Pps, AResetDiscardsTheEdge) {
  Stim300Unit unit("pps=true");
  unit.run(2000);
  unit.device->pps(unit.now() + 250us);
  EXPECT_EQ(pps_us(unit.run(2).at(0)) % 500, 256U);
  unit.send_line("R");
  EXPECT_EQ(pps_us(unit.run(300).back()), 0x7FFFFFU);
}

TEST(Stim300Pps, FilteredIsTheLevelOfAnOpenInput) {
  Stim300Unit unit("start_up=false,pps=true");
  unit.send_line("SERVICEMODE");
  unit.send_line("u p,0");
  unit.send_line("x N");
  EXPECT_EQ(pps_us(unit.run(2).at(0)), 1U << 22) << "1 (Equation 8)";
}

// Figures 7-4 and 7-5.
TEST(Stim300Tov, IsLowWhileADatagramIsSent) {
  Stim300Unit unit("start_up=false,sample_rate=1000");
  for (int i = 0; i < 10; ++i) {
    const bool sends = !unit.run(1).empty();
    const auto pulse = unit.device->pulse();
    ASSERT_EQ(pulse.has_value(), sends);
    if (!pulse) continue;
    EXPECT_EQ(pulse->begin - unit.now(), 506us) << "the latency";
    EXPECT_EQ(pulse->end - pulse->begin, nanoseconds(80e-6 + 59 * 10 / 921600.0));
  }
  unit.send_line("SERVICEMODE");
  unit.run(2);
  EXPECT_FALSE(unit.device->pulse());
  unit.send_line("m 5");
  unit.send_line("x N");
  for (int i = 0; i < 10; ++i) {
    EXPECT_TRUE(unit.run(1).empty());
    const auto pulse = unit.device->pulse();
    ASSERT_TRUE(pulse) << "at every internal sample with an external trigger";
    EXPECT_EQ(pulse->end - pulse->begin, 50us);
  }
}

TEST(Stim300Tov, RestsForTheSpecialDatagramsOfTheStart) {
  for (const bool toggles : {false, true}) {
    Stim300Unit unit;
    unit.send_line("SERVICEMODE");
    unit.send_line(toggles ? "h t,1" : "h t,0");
    unit.send_line("s");
    unit.send_line("Y");
    unit.send_line("x I");
    int pulses = 0, specials = 0, measurements = 0;
    for (int k = 0; k < 10'000 && measurements == 0; ++k)
      for (const Bytes& sent : unit.run(1)) {
        pulses += unit.device->pulse() ? 1 : 0;
        ++(first(sent) == 0xA7 ? measurements : specials);
      }
    EXPECT_EQ(specials, 3);
    EXPECT_EQ(measurements, 1);
    EXPECT_EQ(pulses, toggles ? 4 : 1);
  }
}

}  // namespace
}  // namespace imud
