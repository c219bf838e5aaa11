// The faults of lines of bytes, through the frames of products. Statistics are those of fixed seeds; each bound is 5
// standard deviations of the number that is tested, which right random numbers pass with all but 6e-7 of the seeds.
#include "emulator/faults/wire_faults.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <numeric>

#include "tests/emulator/faults/wire_bench.hpp"
#include "tests/protocols/recording.hpp"

namespace imud {
namespace {

using Leaving = std::vector<std::vector<StoredFrame>>;  // by sample

// Products with a measurement in every frame, and their settings.
constexpr std::pair<std::string_view, std::string_view> sealed_products[] = {
    {"native", ""},     {"stim300", "start_up=false"},
    {"vectornav", ""},  {"hipnuc", ""},
    {"kvh1750", ""},    {"ncom", ""},
    {"epson-burst", ""}};
constexpr std::size_t native_size = 124, native_content = 120;

std::vector<std::byte> bytes_of(std::initializer_list<unsigned> values) {
  std::vector<std::byte> bytes;
  for (const unsigned value : values) bytes.push_back(static_cast<std::byte>(value));
  return bytes;
}

std::size_t wrong_bits(std::span<const std::byte> a, std::span<const std::byte> b) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    count += static_cast<std::size_t>(std::popcount(std::to_integer<unsigned>(a[i] ^ b[i])));
  return count;
}

DecodeErrors errors_in(const Protocol& protocol, const Leaving& samples, std::size_t& measurements) {
  Line line(protocol);
  Recording recording;
  for (const auto& frames : samples) line.feed(frames, recording);
  line.decoder->finish(recording);
  measurements = recording.measurements.size();
  return line.decoder->errors();
}

// Runs 30 samples with and without the fault, which acts on samples 10 to 19, and checks that all others are equal.
class WireWindowTest : public testing::Test {
 protected:
  void run(WireFault kind, std::array<double, FaultKind::max_parameters> parameters = {},
           std::string_view product = "native", std::string_view settings = "") {
    WireBench without(product, settings);
    plain_ = without.run({}, 30);
    if (!bench_) bench_.emplace(product, settings);
    const WireWindow window{kind, parameters};
    faulty_ = bench_->run({&window, 1}, 30);
    for (std::uint64_t k = 0; k < 30; ++k) {
      if (k < 10 || k > 19) {
        EXPECT_EQ(joined(faulty_[k]), joined(plain_[k])) << "sample " << k;
      }
    }
    const PortCounters& counters = bench_->port->counters();
    EXPECT_EQ(counters.sent + counters.dropped, bench_->passed);
  }
  std::vector<std::byte> faulty(std::uint64_t k) const { return joined(faulty_[k]); }
  std::vector<std::byte> plain(std::uint64_t k) const { return joined(plain_[k]); }
  // Returns the number of wrong bits of a native frame without its checksum.
  std::size_t wrong_content(std::uint64_t k) const {
    const std::vector<std::byte> bytes = faulty(k);
    return wrong_bits(std::span(bytes).first(native_content), plain(k));
  }
  std::uint64_t dropped() const { return bench_->port->counters().dropped; }

  std::optional<WireBench> bench_;
  Leaving plain_, faulty_;
};

TEST_F(WireWindowTest, CutFramesAreTheBeginsOfFrames) {
  run(WireFault::cut, {40, 0.5, 1});
  for (std::uint64_t k = 10; k <= 19; ++k) {
    std::vector<std::byte> begin = plain(k);
    begin.resize(40);
    EXPECT_EQ(faulty(k), begin);
  }
  bench_.reset();
  run(WireFault::cut, {0, 0.25, 1});
  EXPECT_EQ(faulty(10).size(), native_size / 4);
  EXPECT_EQ(dropped(), 0U);
}

TEST_F(WireWindowTest, WrongChecksumStandsAtTheRightContent) {
  for (const auto& [product, settings] : sealed_products) {
    bench_.reset();
    run(WireFault::checksum_wrong, {1}, product, settings);
    std::size_t right = 0, good = 0, frames = 0;
    for (const auto& sample : plain_) frames += sample.size();
    ASSERT_GT(frames, 0U) << product;
    errors_in(bench_->protocol, plain_, right);
    const DecodeErrors errors = errors_in(bench_->protocol, faulty_, good);
    std::size_t changed = 0;
    for (std::uint64_t k = 10; k <= 19; ++k) changed += plain_[k].size();
    EXPECT_GE(errors.checksum, changed) << product;
    EXPECT_LE(good, right - changed) << product;
    if (product != "native") continue;
    EXPECT_EQ(good, 20U);
    for (std::uint64_t k = 10; k <= 19; ++k) {
      EXPECT_EQ(wrong_content(k), 0U);
      EXPECT_GT(wrong_bits(faulty(k), plain(k)), 0U);
    }
  }
}

TEST_F(WireWindowTest, WrongContentHasARightChecksum) {
  for (const auto& [product, settings] : sealed_products) {
    bench_.reset();
    run(WireFault::content_wrong, {1}, product, settings);
    std::size_t right = 0, good = 0;
    errors_in(bench_->protocol, plain_, right);
    const DecodeErrors errors = errors_in(bench_->protocol, faulty_, good);
    EXPECT_EQ(errors.checksum, 0U) << product;
    EXPECT_EQ(good + errors.malformed, right) << product;
    for (std::uint64_t k = 10; k <= 19; ++k) {
      if (plain_[k].empty()) continue;
      EXPECT_NE(faulty(k), plain(k));
      EXPECT_EQ(faulty(k).size(), plain(k).size());
      if (product == "native") {
        EXPECT_EQ(wrong_content(k), 1U);
      }
    }
  }
}

TEST_F(WireWindowTest, GarbagePrecedesTheFrames) {
  run(WireFault::garbage, {500});
  for (std::uint64_t k = 10; k <= 19; ++k) {
    ASSERT_EQ(faulty_[k].size(), 2U);
    EXPECT_EQ(faulty_[k][0].bytes.size(), 5U);
    EXPECT_EQ(faulty_[k][1].bytes, plain(k));
  }
  EXPECT_NE(faulty_[10][0].bytes, faulty_[11][0].bytes);
  std::size_t good = 0;
  EXPECT_EQ(errors_in(bench_->protocol, faulty_, good).skipped_bytes, 50U);
  EXPECT_EQ(good, 30U);
}

TEST_F(WireWindowTest, TenTimesATenthIsOneByte) {
  run(WireFault::garbage, {10});
  for (std::uint64_t k = 10; k <= 19; ++k) EXPECT_EQ(faulty_[k].size(), k == 19 ? 2U : 1U) << k;
}

TEST_F(WireWindowTest, ABreakIsReceivedAsOneZero) {
  run(WireFault::line_break);
  EXPECT_EQ(faulty(10), bytes_of({0}));
  for (std::uint64_t k = 11; k <= 19; ++k) EXPECT_TRUE(faulty(k).empty());
  EXPECT_EQ(bench_->inner->breaks, (std::vector<bool>{true, false}));
  EXPECT_EQ(bench_->port->counters().sent, 30U);

  bench_.emplace("native");
  bench_->inner->has_break = true;
  run(WireFault::line_break);
  for (std::uint64_t k = 10; k <= 19; ++k) EXPECT_TRUE(faulty(k).empty());
  EXPECT_EQ(bench_->inner->breaks, (std::vector<bool>{true, false}));
}

TEST_F(WireWindowTest, InSilenceNothingLeavesOrArrives) {
  bench_.emplace("native");
  std::uint64_t k = 0;
  std::vector<std::uint64_t> arrived;
  bench_->check = [&] {
    bench_->inner->from_host = {{std::byte{'a'}}, {std::byte{'b'}}};
    while (const auto received = bench_->port->receive()) arrived.push_back(k);
    EXPECT_TRUE(bench_->inner->from_host.empty());
    ++k;
  };
  run(WireFault::silence);
  for (std::uint64_t i = 10; i <= 19; ++i) EXPECT_TRUE(faulty(i).empty());
  EXPECT_EQ(bench_->port->counters().sent, 30U);
  std::vector<std::uint64_t> others;
  for (std::uint64_t i = 0; i < 30; ++i)
    if (i < 10 || i > 19) others.insert(others.end(), 2, i);
  EXPECT_EQ(arrived, others);
}

TEST_F(WireWindowTest, ACableThatIsOutDropsFrames) {
  bench_.emplace("native");
  std::vector<PortState> states;
  bench_->check = [&] {
    states.push_back(bench_->port->state());
    EXPECT_EQ(bench_->port->state_of_port(), PortState::ready) << "no reader has left";
  };
  run(WireFault::disconnect);
  for (std::uint64_t k = 10; k <= 19; ++k) EXPECT_TRUE(faulty(k).empty());
  for (std::uint64_t k = 0; k < 30; ++k)
    EXPECT_EQ(states[k], k >= 10 && k <= 19 ? PortState::lost : PortState::ready) << k;
  EXPECT_EQ(bench_->inner->connections, (std::vector<bool>{false, true}));
  EXPECT_EQ(dropped(), 10U);
  EXPECT_EQ(bench_->port->counters().lost_count, 1U);
}

// The last of 40 faults at once acts as the first.
TEST_F(WireWindowTest, ManyFaultsActAtOnce) {
  WireBench bench("native");
  std::vector<WireWindow> windows;
  for (std::uint32_t i = 0; i < 40; ++i)
    windows.push_back({i < 39 ? WireFault::byte_loss : WireFault::silence, {}, 10, 19, i});
  const auto frames = bench.run(windows, 30);
  for (std::uint64_t k = 0; k < 30; ++k) EXPECT_EQ(frames[k].empty(), k >= 10 && k <= 19) << k;
}

// A frame has 1240 bits on the line, which carries 1152 in a sample, or 576 if half is left: it is busy for one
// sample after that of a frame, or for two.
TEST_F(WireWindowTest, ABusyLineDropsFramesWhole) {
  run(WireFault::half_bandwidth, {1, 115'200});
  for (std::uint64_t k = 10; k <= 19; ++k) EXPECT_EQ(faulty(k).empty(), k % 2 == 1) << k;
  EXPECT_EQ(dropped(), 5U);
  bench_.emplace("native", "", 100, 115'200);
  run(WireFault::half_bandwidth, {0.5, 1e9});
  for (std::uint64_t k = 10; k <= 19; ++k) EXPECT_EQ(faulty(k).empty(), (k - 10) % 3 != 0) << k;
  EXPECT_EQ(dropped(), 6U);
}

// The bits of the sender are twice as long. In bits of the receiver, a character with the data bits d0 to d7 is 0, 0,
// d0, d0, ..., d7, d7, 1, 1: the receiver samples 0, d0, d0, d1, d1, d2, d2, d3 as data, and d3 as the stop bit, and
// then waits for an edge down. 0x55 has one between d4 and d5: then the data are 0, d6, d6, d7, d7, 1, 1, 1.
TEST(WireFaults, ASlowSenderIsReceivedAsSampled) {
  WireBench bench("native");
  const WireWindow window{WireFault::baud_wrong, {2}, 0, 100};
  bench.set_active({&window, 1});
  const auto sent = [&](std::initializer_list<unsigned> values) {
    const std::vector<std::byte> bytes = bytes_of(values);
    const Frame frame{bytes};
    bench.port->send({&frame, 1});
    return joined(std::exchange(bench.inner->kept, {}));
  };
  EXPECT_EQ(sent({0xFF}), bytes_of({0xFE}));
  EXPECT_EQ(sent({0x00}), bytes_of({0x00}));
  EXPECT_EQ(sent({0x55}), bytes_of({0x66, 0xE6}));
  // Bytes that the host sends at the line's speed are sampled at half of it: every second bit, from the start bit's
  // end on.
  bench.inner->from_host = {bytes_of({0xFF})};
  EXPECT_FALSE(bench.port->receive()) << "the start bit is over when its middle is sampled";
  bench.inner->from_host = {bytes_of({0xFE})};
  const auto received = bench.port->receive();
  ASSERT_TRUE(received);
  EXPECT_EQ(received->frame.bytes.size(), 1U);
  EXPECT_EQ(received->frame.bytes[0], std::byte{0xFF});
}

TEST_F(WireWindowTest, AWrongSpeedLastsAsLongAsTheFault) {
  run(WireFault::baud_wrong, {2});
  std::size_t good = 0;
  errors_in(bench_->protocol, faulty_, good);
  EXPECT_EQ(good, 20U);
  for (std::uint64_t k = 10; k <= 19; ++k) EXPECT_FALSE(faulty(k).empty());
}

// --- Random bits and bytes ---

// Sends 1000 frames of 124 zeros in calls of `size` bytes, and returns what leaves.
std::vector<std::byte> zeros_through(WireFault kind, std::array<double, FaultKind::max_parameters> parameters,
                                     std::size_t size = native_size, std::uint64_t seed = 1,
                                     std::string_view imu = "imu1", std::uint64_t occurrence = 0,
                                     std::uint32_t number = 0) {
  WireBench bench("native", "", 100, 0, seed, imu);
  const WireWindow window{kind, parameters, 0, 1'000'000, number, occurrence};
  bench.set_active({&window, 1});
  const std::vector<std::byte> zeros(1000 * native_size);
  for (std::span<const std::byte> rest = zeros; !rest.empty();) {
    const Frame frame{rest.first(std::min(size, rest.size()))};
    bench.port->send({&frame, 1});
    rest = rest.subspan(frame.bytes.size());
  }
  return joined(bench.inner->kept);
}

TEST(WireFaults, BitErrorsHaveTheirRate) {
  constexpr double p = 1e-3, bits = 8.0 * 1000 * native_size;
  const std::vector<std::byte> received = zeros_through(WireFault::bit_errors, {p, 0});
  ASSERT_EQ(received.size(), 1000 * native_size);
  const auto wrong = static_cast<double>(wrong_bits(received, std::vector<std::byte>(received.size())));
  EXPECT_NEAR(wrong, p * bits, 5 * std::sqrt(bits * p * (1 - p)));
  // Neighbours of wrong bits are as often wrong as others.
  std::vector<bool> levels;
  for (const std::byte byte : received)
    for (unsigned bit = 0; bit < 8; ++bit) levels.push_back((std::to_integer<unsigned>(byte) >> bit & 1U) != 0);
  double pairs = 0;
  for (std::size_t i = 1; i < levels.size(); ++i) pairs += levels[i] && levels[i - 1] ? 1 : 0;
  EXPECT_NEAR(pairs, p * p * bits, 5 * std::sqrt(p * p * bits) + 1);

  EXPECT_EQ(zeros_through(WireFault::bit_errors, {0, 0}), std::vector<std::byte>(received.size()));
  EXPECT_EQ(zeros_through(WireFault::bit_errors, {1, 0}), std::vector<std::byte>(received.size(), std::byte{0xFF}));
}

// Runs of mean L have the variance L (L - 1), and the number of wrong bits that of the alternating renewal process,
// which for small p is N p (2 L - 1).
TEST(WireFaults, BurstsHaveTheirLengthAndRate) {
  constexpr double p = 0.01, mean = 8, bits = 8.0 * 1000 * native_size;
  double wrong = 0, runs = 0;
  bool was_wrong = false;
  for (const std::byte byte : zeros_through(WireFault::bit_errors, {p, mean}))
    for (unsigned bit = 0; bit < 8; ++bit) {
      const bool is_wrong = (std::to_integer<unsigned>(byte) >> bit & 1U) != 0;
      wrong += is_wrong ? 1 : 0;
      runs += is_wrong && !was_wrong ? 1 : 0;
      was_wrong = is_wrong;
    }
  EXPECT_NEAR(wrong, p * bits, 5 * std::sqrt(bits * p * (2 * mean - 1)));
  EXPECT_NEAR(wrong / runs, mean, 5 * std::sqrt(mean * (mean - 1) / runs));
}

TEST(WireFaults, BytesAreLostAndInsertedAtTheirRates) {
  constexpr double p = 0.01, bytes = 1000 * native_size;
  const double bound = 5 * std::sqrt(bytes * p * (1 - p));
  EXPECT_NEAR(static_cast<double>(zeros_through(WireFault::byte_loss, {p}).size()), bytes * (1 - p), bound);
  const std::vector<std::byte> more = zeros_through(WireFault::byte_insertion, {p});
  EXPECT_NEAR(static_cast<double>(more.size()), bytes * (1 + p), bound);
  // One of 256 inserted bytes is a zero itself.
  const auto zeros = static_cast<double>(std::count(more.begin(), more.end(), std::byte{}));
  EXPECT_GE(zeros, bytes);
  EXPECT_LE(zeros, bytes + 5 * std::sqrt(bytes * p / 256) + bytes * p / 256);
  EXPECT_TRUE(zeros_through(WireFault::byte_loss, {1}).empty());
  EXPECT_EQ(zeros_through(WireFault::byte_insertion, {1}).size(), 2 * 1000 * native_size);
}

TEST(WireFaults, ChangesDependOnSeedImuFaultAndOccurrenceAlone) {
  for (const WireFault kind : {WireFault::bit_errors, WireFault::byte_loss, WireFault::byte_insertion}) {
    const std::array<double, FaultKind::max_parameters> parameters = {0.01, 4};
    const std::vector<std::byte> one = zeros_through(kind, parameters);
    for (const std::size_t size : {1U, 7U, 1000U, 16'000U}) EXPECT_EQ(zeros_through(kind, parameters, size), one);
    EXPECT_NE(zeros_through(kind, parameters, native_size, 2), one);
    EXPECT_NE(zeros_through(kind, parameters, native_size, 1, "imu2"), one);
    EXPECT_NE(zeros_through(kind, parameters, native_size, 1, "imu1", 1), one);
    EXPECT_NE(zeros_through(kind, parameters, native_size, 1, "imu1", 0, 1), one);
  }
}

TEST(WireFaults, AWeightScalesTheProbability) {
  constexpr double p = 0.02, bytes = 1000 * native_size;
  for (const double weight : {0.0, 0.5, 1.0}) {
    WireBench bench("native");
    WireWindow window{WireFault::byte_loss, {p}, 0, 1'000'000};
    window.weight = 0.1;
    bench.run({&window, 1}, 1);
    window.weight = weight;
    const Leaving all = bench.run({&window, 1}, 1000);
    const double lost = bytes - std::accumulate(all.begin(), all.end(), 0.0, [](double sum, const auto& frames) {
                          return sum + static_cast<double>(joined(frames).size());
                        });
    EXPECT_NEAR(lost, bytes * p * weight, 5 * std::sqrt(bytes * p * weight));
  }
}

// --- Several faults, and the port ---

TEST(WireFaults, ActInTheOrderOfTheList) {
  WireBench bench("native");
  const std::array<WireWindow, 2> windows = {WireWindow{WireFault::cut, {8, 0, 1}, 10, 19, 0},
                                             WireWindow{WireFault::byte_insertion, {1}, 10, 19, 1}};
  EXPECT_EQ(joined(bench.run(windows, 11)[10]).size(), 16U);
  const std::array<WireWindow, 2> reversed = {windows[1], windows[0]};
  WireBench other("native");
  EXPECT_EQ(joined(other.run(reversed, 11)[10]).size(), 8U);
}

TEST(WireFaults, WhatOthersSendIsNotCounted) {
  WireBench bench("native");
  bench.inner->holds = true;
  const WireWindow window{WireFault::garbage, {500}, 2, 5};
  bench.check = [&] {
    const PortCounters& counters = bench.port->counters();
    EXPECT_LT(counters.sent + counters.dropped, bench.passed) << "frames are held back";
    EXPECT_TRUE(bench.port->next_flush());
  };
  bench.run({&window, 1}, 10);
  bench.port->flush();
  EXPECT_EQ(bench.port->counters().sent, 10U);
  EXPECT_FALSE(bench.port->next_flush());
  bench.check = nullptr;
  bench.inner->holds = false;
  bench.inner->refuses = true;
  const WireWindow later{WireFault::garbage, {500}, 12, 15};
  bench.run({&later, 1}, 10);
  EXPECT_EQ(bench.port->counters().sent, 10U);
  EXPECT_EQ(bench.port->counters().dropped, 10U);
}

TEST(WireFaults, RepliesCountAsReplies) {
  WireBench bench("native");
  const WireWindow window{WireFault::silence, {}, 0, 0};
  const std::vector<std::byte> bytes(4);
  const Frame frame{bytes};
  bench.set_active({&window, 1});
  bench.port->reply({&frame, 1});
  bench.port->set_active({});
  bench.port->reply({&frame, 1});
  bench.port->send({&frame, 1});
  EXPECT_EQ(bench.port->counters().replies, 2U);
  EXPECT_EQ(bench.port->counters().sent, 3U);
  EXPECT_EQ(bench.inner->counters().replies, 1U);
}

// Many windows of all kinds, which overlap: nothing breaks, every frame is counted once, nothing is allocated, and
// when all have ended the frames are those of the run without faults.
TEST(WireFaults, AfterAnyFaultsTheFramesAreRightAgain) {
  std::vector<std::string_view> products = {"hg4930"};
  for (const Protocol* protocol : protocols()) products.push_back(protocol->name);
  EXPECT_GT(products.size(), 15U);
  for (const std::string_view product : products) {
    std::mt19937_64 random(17);
    const Protocol& protocol = *resolve_protocol(product);
    std::vector<WireWindow> windows;
    for (std::uint32_t number = 0; number < 60; ++number) {
      const FaultKind& kind = wire_fault_kinds()[random() % wire_fault_kinds().size()];
      if (!wire_fault_objection(kind, protocol, Settings(protocol.settings)).empty()) continue;
      WireWindow window{wire_fault(kind), {}, random() % 1800, 0, number};
      window.last = window.first + random() % 200;
      for (std::size_t i = 0; i < kind.parameters.size(); ++i) {
        const FaultParameter& parameter = kind.parameters[i];
        const double u = static_cast<double>(random() % 1000) / 999;
        window.parameters[i] = parameter.min + u * (std::min(parameter.max, 5000.0) - parameter.min);
      }
      windows.push_back(window);
    }
    WireBench without(product, "", 100, 500'000), bench(product, "", 100, 500'000);
    const Leaving plain = without.run({}, 2100);
    bench.check = [&] {
      const PortCounters& counters = bench.port->counters();
      ASSERT_EQ(counters.sent + counters.dropped, bench.passed);
    };
    const Leaving faulty = bench.run(windows, 2100);
    std::size_t changed = 0;
    for (std::uint64_t k = 0; k < 2100; ++k) {
      const bool is_free = std::none_of(windows.begin(), windows.end(), [k](const WireWindow& window) {
        return k >= window.first && k <= window.last;
      });
      if (is_free) {
        ASSERT_EQ(joined(faulty[k]), joined(plain[k])) << product << ", sample " << k;
      } else if (joined(faulty[k]) != joined(plain[k])) {
        ++changed;
      }
    }
    EXPECT_GT(changed, 100U) << product;
    EXPECT_EQ(bench.port->state(), PortState::ready);
  }
}

TEST(WireFaults, AreRefusedWhereTheyCannotBe) {
  const auto objection = [](WireFault kind, std::string_view protocol) {
    const Protocol& product = *resolve_protocol(protocol);
    return wire_fault_objection(wire_fault_kinds()[static_cast<std::size_t>(kind)], product,
                                Settings(product.settings));
  };
  EXPECT_EQ(objection(WireFault::bit_errors, "native"), "");
  EXPECT_EQ(objection(WireFault::bus_off, "sbg-can"), "");
  EXPECT_EQ(objection(WireFault::silence, "sbg-can"), "");
  EXPECT_EQ(objection(WireFault::content_wrong, "bosch-mm7"), "");
  EXPECT_EQ(objection(WireFault::content_wrong, "hipnuc"), "");
  EXPECT_EQ(objection(WireFault::content_wrong, "razor"),
            "the frames of razor have no checksum; bit_errors changes their content");
  EXPECT_EQ(objection(WireFault::checksum_wrong, "csv"),
            "the frames of csv have no checksum; bit_errors changes their content");
  EXPECT_EQ(objection(WireFault::content_wrong, "sbg-can"), "the frames of sbg-can have no checksum");
  EXPECT_EQ(objection(WireFault::bit_errors, "sbg-can"),
            "sbg-can is on a CAN bus; right would be checksum_wrong, content_wrong, silence, disconnect, bus_off, "
            "error_frames, same_id, babbling, bus_load");
  EXPECT_TRUE(
      objection(WireFault::bus_off, "native").starts_with("native is on a line of bytes; right would be bit"));
}

}  // namespace
}  // namespace imud
