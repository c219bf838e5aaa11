#include "tools/stream_statistics.hpp"

#include <gtest/gtest.h>

#include "tests/support/text.hpp"
#include "tests/tools/sample_stream.hpp"
#include "tools/duration_text.hpp"
#include "tools/stream_report.hpp"

namespace imud {
namespace {

Protocol protocol_like(unsigned counter_bits, std::int64_t time_period_ns = 0, double time_resolution_s = 0) {
  Protocol protocol = protocol_named("native");
  protocol.counter_bits = counter_bits;
  protocol.time_period_ns = time_period_ns;
  protocol.resolution.time_s = time_resolution_s;
  return protocol;
}

// Samples as received over the wire of `protocol`, without times of arrival.
StreamStatistics statistics_of(std::vector<Sample> samples, const Protocol& protocol,
                               std::uint32_t fields = Measurement::all) {
  StreamStatistics statistics(protocol);
  const std::uint64_t mask =
      protocol.counter_bits >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << protocol.counter_bits) - 1;
  for (Sample& sample : samples) {
    sample.counter &= mask;
    if (protocol.time_period_ns != 0) sample.time.ns %= protocol.time_period_ns;
    statistics.add({sample, fields}, std::nullopt);
  }
  statistics.finish();
  return statistics;
}

void erase(std::vector<Sample>& samples, std::ptrdiff_t from, std::ptrdiff_t count) {
  samples.erase(samples.begin() + from, samples.begin() + from + count);
}

constexpr std::uint32_t only_counter = Measurement::all & ~std::uint32_t{Measurement::time};
constexpr std::uint32_t only_time = Measurement::all & ~std::uint32_t{Measurement::counter};

TEST(StreamStatistics, SteadyStream) {
  for (const unsigned count : {2U, 3U, 100U, 8192U, 8193U, 30000U}) {
    const auto statistics = statistics_of(steady_samples(count, 300), protocol_like(32));
    EXPECT_EQ(statistics.samples(), count);
    EXPECT_EQ(statistics.device().steps, count - 1);
    EXPECT_NEAR(statistics.device().hz().value(), 300.0, 1e-4);
    EXPECT_FALSE(statistics.arrival().hz().has_value());
    EXPECT_EQ(statistics.jitter().count(), 0U);
    EXPECT_TRUE(statistics.can_detect_gaps());
    EXPECT_EQ(statistics.gaps() + statistics.missing() + statistics.time_jumps(), 0U);
    EXPECT_EQ(statistics.repeated() + statistics.back(), 0U);
  }
}

TEST(StreamStatistics, FewSamplesGiveNoFigures) {
  for (const unsigned count : {0U, 1U}) {
    const auto statistics = statistics_of(steady_samples(count, 300), protocol_like(32));
    EXPECT_EQ(statistics.samples(), count);
    EXPECT_FALSE(statistics.device().hz().has_value());
    EXPECT_FALSE(statistics.can_detect_gaps());
  }
}

// Every second sample has a time.
TEST(StreamStatistics, TimesInSeparateSamplesGiveNoRate) {
  const Protocol protocol = protocol_like(32);
  for (const bool is_arrival : {false, true}) {
    StreamStatistics statistics(protocol);
    for (const Sample& sample : steady_samples(100, 300)) {
      const bool has_time = sample.counter % 2 != 0;
      const std::optional<HostTime> arrival = HostTime{sample.time.ns};
      statistics.add({sample, has_time && !is_arrival ? std::uint32_t{Measurement::all} : only_counter},
                     has_time && is_arrival ? arrival : std::nullopt);
    }
    statistics.finish();
    EXPECT_FALSE(statistics.device().hz() || statistics.arrival().hz());
    const StreamReport report{protocol, {}, statistics, {}, {}, {}, {}, {}};
    EXPECT_TRUE(contains(report.text(), "rate       unknown: too few samples with a time\n")) << report.text();
  }
}

// Gaps anywhere: at the first step, across the border of two windows, at the end of the stream.
TEST(StreamStatistics, MissingSamplesAreCountedByCounterOrTime) {
  auto samples = steady_samples(20000, 400);
  erase(samples, 19990, 3);
  erase(samples, 8190, 5);
  erase(samples, 4096, 1);
  erase(samples, 1, 1);
  for (const std::uint32_t fields : {std::uint32_t{Measurement::all}, only_counter, only_time}) {
    const auto statistics = statistics_of(samples, protocol_like(32), fields);
    EXPECT_EQ(statistics.gaps(), 4U) << fields;
    EXPECT_EQ(statistics.missing(), 10U) << fields;
    EXPECT_EQ(statistics.time_jumps(), 0U) << fields;
  }
}

// A product that samples at 2000 Hz internally, and sends 500 samples per second.
TEST(StreamStatistics, ACounterOfUnsentSamples) {
  Protocol protocol = protocol_like(8);
  protocol.sends_some_samples = true;
  std::vector<Sample> samples = steady_samples(1000, 500);
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i].counter = 4 * i;
  EXPECT_EQ(statistics_of(samples, protocol, only_counter).gaps(), 0U);
  erase(samples, 300, 3);
  erase(samples, 600, 1);
  const auto statistics = statistics_of(samples, protocol, only_counter);
  EXPECT_EQ(statistics.gaps(), 2U);
  EXPECT_EQ(statistics.missing(), 4U);
}

TEST(StreamStatistics, CounterOverflows) {
  const auto samples = steady_samples(2000, 100);
  for (const unsigned bits : {8U, 16U, 32U, 64U})
    EXPECT_EQ(statistics_of(samples, protocol_like(bits)).gaps(), 0U) << bits;
  auto from_the_end = samples;
  for (Sample& sample : from_the_end) sample.counter += ~std::uint64_t{0} - 1000;
  EXPECT_EQ(statistics_of(from_the_end, protocol_like(64), only_counter).gaps(), 0U);
  EXPECT_EQ(statistics_of(from_the_end, protocol_like(32), only_counter).gaps(), 0U);
}

// With 8 bits, 300 missing samples differ from 44 by the device's time only.
TEST(StreamStatistics, TimeResolvesTheOverflowsOfANarrowCounter) {
  auto samples = steady_samples(2000, 100);
  erase(samples, 500, 300);
  const auto with_time = statistics_of(samples, protocol_like(8));
  EXPECT_EQ(with_time.gaps(), 1U);
  EXPECT_EQ(with_time.missing(), 300U);
  EXPECT_EQ(with_time.time_jumps(), 0U);
  EXPECT_EQ(statistics_of(samples, protocol_like(8), only_counter).missing(), 44U);

  auto whole_turn = steady_samples(2000, 100);
  erase(whole_turn, 500, 255);
  EXPECT_EQ(statistics_of(whole_turn, protocol_like(8)).missing(), 255U);
}

TEST(StreamStatistics, TimeThatRestartsIsNoJump) {
  const auto statistics = statistics_of(steady_samples(5000, 100), protocol_like(32, 10'000'000'000));
  EXPECT_EQ(statistics.back(), 0U);
  EXPECT_EQ(statistics.time_jumps(), 0U);
  EXPECT_EQ(statistics.device().time, std::chrono::milliseconds(49'990));
}

TEST(StreamStatistics, JumpOfTheDeviceClock) {
  auto samples = steady_samples(1000, 100);
  for (std::size_t i = 400; i < samples.size(); ++i) samples[i].time = samples[i].time + std::chrono::milliseconds(7);
  const auto statistics = statistics_of(samples, protocol_like(32));
  EXPECT_EQ(statistics.time_jumps(), 1U);
  EXPECT_EQ(statistics.gaps(), 0U);
  EXPECT_NEAR(statistics.device().hz().value(), 100.0, 1e-6);
}

TEST(StreamStatistics, RepetitionAndRestart) {
  auto samples = steady_samples(300, 100);
  samples.insert(samples.begin() + 50, samples[49]);
  const auto again = steady_samples(200, 100);
  samples.insert(samples.end(), again.begin(), again.end());
  for (const std::uint32_t fields : {std::uint32_t{Measurement::all}, only_counter, only_time}) {
    const auto statistics = statistics_of(samples, protocol_like(32), fields);
    EXPECT_EQ(statistics.repeated(), 1U) << fields;
    EXPECT_EQ(statistics.back(), 1U) << fields;
    EXPECT_EQ(statistics.gaps(), 0U) << fields;
  }
}

// At 2 kHz a clock of 1 ms shows each time twice.
TEST(StreamStatistics, CoarseDeviceClock) {
  auto samples = steady_samples(1000, 2000);
  for (Sample& sample : samples) sample.time.ns = sample.time.ns / 1'000'000 * 1'000'000;
  const auto statistics = statistics_of(samples, protocol_like(32, 0, 1e-3));
  EXPECT_EQ(statistics.gaps() + statistics.time_jumps() + statistics.repeated(), 0U);
  EXPECT_NEAR(statistics.device().hz().value(), 2000.0, 3.0);
  EXPECT_FALSE(statistics_of(samples, protocol_like(32, 0, 1e-3), only_time).can_detect_gaps());
}

// Arrival: an offset, a clock that is 50 ppm off, and every tenth sample 1 ms late.
TEST(StreamStatistics, JitterIsTheDeviationFromALine) {
  for (const std::uint32_t fields : {std::uint32_t{Measurement::all}, only_counter, only_time}) {
    StreamStatistics statistics(protocol_like(32));
    std::size_t k = 0;
    for (const Sample& sample : steady_samples(20000, 200)) {
      const double late_ns = k++ % 10 == 5 ? 1e6 : 0;
      const double arrival_ns = 7e9 + static_cast<double>(sample.time.ns) * 1.00005 + late_ns;
      statistics.add({sample, fields}, HostTime{static_cast<std::int64_t>(arrival_ns)});
    }
    statistics.finish();
    EXPECT_EQ(statistics.jitter().count(), 20000U);
    EXPECT_NEAR(statistics.jitter().percentile(50), 0.1e-3, 0.01e-3);
    EXPECT_NEAR(statistics.jitter().percentile(99), 0.9e-3, 0.03e-3);
    EXPECT_NEAR(statistics.jitter().max(), 0.9e-3, 0.01e-3);
    EXPECT_NEAR(statistics.arrival().hz().value(), 200.0 / 1.00005, 1e-3);
  }
}

TEST(StreamStatistics, AJumpOfTheDeviceClockIsNoJitter) {
  StreamStatistics statistics(protocol_like(32));
  for (Sample sample : steady_samples(1000, 100)) {
    const HostTime arrival{sample.time.ns};
    if (sample.counter >= 500) sample.time = sample.time + std::chrono::hours(1);
    statistics.add({sample, Measurement::all}, arrival);
  }
  statistics.finish();
  EXPECT_EQ(statistics.time_jumps() + statistics.gaps(), 1U);
  EXPECT_LT(statistics.jitter().max(), 1e-6);
}

TEST(DurationText, DurationsAreReadable) {
  EXPECT_EQ(duration_text(0), "0 us");
  EXPECT_EQ(duration_text(12.34e-6), "12.3 us");
  EXPECT_EQ(duration_text(999.6e-6), "1 ms");
  EXPECT_EQ(duration_text(0.25), "250 ms");
  EXPECT_EQ(duration_text(12.345), "12.3 s");
  EXPECT_EQ(duration_text(4321), "4321 s");
}

}  // namespace
}  // namespace imud
