// The faults of CAN buses, through the frames of products.
#include <gtest/gtest.h>
#include <linux/can/error.h>

#include <bit>

#include "tests/emulator/faults/wire_bench.hpp"
#include "transports/can/can_bits.hpp"

namespace imud {
namespace {

using CanFrames = std::vector<std::vector<StoredFrame>>;  // by sample

// Returns the frames of the device: the last of each sample.
std::vector<StoredFrame> own_of(const std::vector<StoredFrame>& frames, std::size_t count) {
  EXPECT_GE(frames.size(), count);
  return {frames.end() - static_cast<std::ptrdiff_t>(count), frames.end()};
}

void expect_same_outside(const CanFrames& faulty, const CanFrames& plain) {
  for (std::size_t k = 0; k < plain.size(); ++k) {
    if (k >= 10 && k <= 19) continue;
    ASSERT_EQ(faulty[k].size(), plain[k].size()) << k;
    for (std::size_t i = 0; i < plain[k].size(); ++i) {
      EXPECT_EQ(faulty[k][i].can, plain[k][i].can);
      EXPECT_EQ(faulty[k][i].bytes, plain[k][i].bytes);
    }
  }
}

class CanWireTest : public testing::Test {
 protected:
  void run(WireFault kind, std::array<double, FaultKind::max_parameters> parameters = {}) {
    WireBench without(product);
    plain_ = without.run({}, 30);
    const WireWindow window{kind, parameters};
    faulty_ = bench_.run({&window, 1}, 30);
    expect_same_outside(faulty_, plain_);
    const PortCounters& counters = bench_.port->counters();
    EXPECT_EQ(counters.sent + counters.dropped, bench_.passed);
  }

  const std::string product = "bosch-mm7";
  WireBench bench_{product, "", 100, 500'000};
  CanFrames plain_, faulty_;
};

TEST_F(CanWireTest, OffTheBusNothingLeaves) {
  std::vector<PortState> states;
  bench_.check = [&] { states.push_back(bench_.port->state()); };
  run(WireFault::bus_off);
  for (std::size_t k = 10; k <= 19; ++k) {
    EXPECT_TRUE(faulty_[k].empty());
    EXPECT_EQ(states[k], PortState::lost);
  }
  EXPECT_EQ(states[9], PortState::ready);
  EXPECT_EQ(states[20], PortState::ready);
  const PortCounters& counters = bench_.port->counters();
  EXPECT_EQ(counters.bus_offs, 1U);
  EXPECT_EQ(counters.bus_restarts, 1U);
  EXPECT_EQ(counters.lost_count, 1U);
  EXPECT_EQ(counters.dropped, 30U);
}

TEST_F(CanWireTest, AnotherNodeSendsTheSameIdentifiers) {
  run(WireFault::same_id, {1});
  for (std::size_t k = 10; k <= 19; ++k) {
    ASSERT_EQ(faulty_[k].size(), 2 * plain_[k].size());
    for (std::size_t i = 0; i < plain_[k].size(); ++i) {
      EXPECT_EQ(faulty_[k][2 * i].bytes, plain_[k][i].bytes);
      EXPECT_EQ(faulty_[k][2 * i + 1].can, plain_[k][i].can);
      EXPECT_EQ(faulty_[k][2 * i + 1].bytes.size(), plain_[k][i].bytes.size());
      EXPECT_NE(faulty_[k][2 * i + 1].bytes, plain_[k][i].bytes);
    }
  }
  EXPECT_EQ(bench_.port->counters().sent, 90U);
}

TEST_F(CanWireTest, ABabblingNodeSendsAtItsRate) {
  run(WireFault::babbling, {300});
  for (std::size_t k = 10; k <= 19; ++k) {
    ASSERT_EQ(faulty_[k].size(), 6U);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(faulty_[k][i].can, CanHeader{});
    for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(own_of(faulty_[k], 3)[i].bytes, plain_[k][i].bytes);
  }
  EXPECT_EQ(bench_.port->counters().sent, 90U);
}

TEST_F(CanWireTest, ErrorFramesAreThoseOfABusError) {
  run(WireFault::error_frames, {50});
  for (std::size_t k = 10; k <= 19; ++k) {
    ASSERT_EQ(faulty_[k].size(), k % 2 == 0 ? 3U : 4U) << k;
    if (k % 2 == 0) continue;
    EXPECT_TRUE(faulty_[k][0].can.error);
    EXPECT_EQ(faulty_[k][0].can.id, unsigned{CAN_ERR_PROT | CAN_ERR_BUSERROR});
    EXPECT_EQ(faulty_[k][0].bytes.size(), std::size_t{CAN_ERR_DLC});
    EXPECT_EQ(faulty_[k][0].bytes[2], std::byte{CAN_ERR_PROT_STUFF});
  }
}

TEST_F(CanWireTest, AContentIsChangedUnderARightChecksum) {
  run(WireFault::content_wrong, {1});
  Line line(*find_protocol(product));
  Recording recording;
  for (const auto& frames : faulty_) line.feed(frames, recording);
  EXPECT_EQ(line.decoder->errors().checksum, 0U);
  for (std::size_t k = 10; k <= 19; ++k)
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NE(faulty_[k][i].bytes, plain_[k][i].bytes);
}

// The others fill the bus up to the level, to within the frames of a sample and one more: the frames of the device
// are known when they have left.
TEST(CanWire, OtherNodesLoadTheBusUpToALevel) {
  for (const double percent : {10.0, 50.0, 100.0}) {
    WireBench bench("bosch-mm7", "", 100, 500'000);
    const WireWindow window{WireFault::bus_load, {percent, 1e6}, 0, 1000};
    double bits = 0;
    std::size_t low = 0;
    for (const auto& frames : bench.run({&window, 1}, 1000))
      for (const StoredFrame& frame : frames) {
        bits += can_bits(frame.view()).nominal;
        low += frame.can.id == 0x7FF ? 1 : 0;
      }
    const double wanted = percent / 100 * 500'000 * 10;
    EXPECT_NEAR(bits, wanted, 5 * most_can_bits({}, 8).nominal) << percent;
    EXPECT_GT(low, 100U);
  }
  WireBench bench("bosch-mm7", "", 100, 0);
  const WireWindow window{WireFault::bus_load, {1, 500'000}, 0, 1000};
  std::size_t frames = 0;
  for (const auto& all : bench.run({&window, 1}, 100)) frames += all.size();
  EXPECT_EQ(frames, 300U) << "the load of the device alone is above the level";
}

// The CRC of DroneCAN covers a transfer of seven frames: one with another content's CRC is refused as a whole, one
// with a wrong bit and the right CRC is read as if it were good.
TEST(CanWire, ChecksumsOfATransfer) {
  constexpr std::string_view product = "dronecan", settings = "sample_rate_hz=100 raw_imu_hz=100 start_up_ms=0";
  WireBench without(product, settings);
  const CanFrames plain = without.run({}, 30);
  for (const WireFault kind : {WireFault::checksum_wrong, WireFault::content_wrong}) {
    WireBench bench(product, settings);
    const WireWindow window{kind, {1}};
    const CanFrames faulty = bench.run({&window, 1}, 30);
    expect_same_outside(faulty, plain);
    for (std::size_t k = 10; k <= 19; ++k) {
      ASSERT_EQ(faulty[k].size(), plain[k].size());
      ASSERT_EQ(faulty[k].size(), 7U);
      std::size_t content_bits = 0, crc_bits = 0;
      for (std::size_t i = 0; i < 7; ++i) {
        ASSERT_EQ(faulty[k][i].can, plain[k][i].can);
        ASSERT_EQ(faulty[k][i].bytes.size(), plain[k][i].bytes.size());
        ASSERT_EQ(faulty[k][i].bytes.back(), plain[k][i].bytes.back()) << "the tail byte";
        for (std::size_t at = 0; at < faulty[k][i].bytes.size(); ++at)
          (i == 0 && at < 2 ? crc_bits : content_bits) += static_cast<std::size_t>(
              std::popcount(std::to_integer<unsigned>(faulty[k][i].bytes[at] ^ plain[k][i].bytes[at])));
      }
      EXPECT_EQ(content_bits, kind == WireFault::content_wrong ? 1U : 0U);
      EXPECT_GT(crc_bits, 0U);
    }
    Line line(bench.protocol, settings_of(bench.protocol, settings));
    Recording recording;
    for (const auto& frames : faulty) line.feed(frames, recording);
    line.decoder->finish(recording);
    EXPECT_EQ(recording.measurements.size(), kind == WireFault::content_wrong ? 30U : 20U);
    EXPECT_EQ(line.decoder->errors().checksum, kind == WireFault::content_wrong ? 0U : 10U);
  }
}

}  // namespace
}  // namespace imud
