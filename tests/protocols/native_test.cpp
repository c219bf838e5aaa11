// The native frame: its bytes, and the resynchronisation of its decoder.
#include <gtest/gtest.h>

#include <bit>
#include <boost/crc.hpp>
#include <set>

#include "protocols/wire/crc32c.hpp"
#include "tests/protocols/recording.hpp"

namespace imud {
namespace {

using Bytes = std::vector<std::byte>;
constexpr std::size_t frame_size = 124;

TEST(Crc32c, CheckValue) {
  constexpr std::string_view digits = "123456789";
  EXPECT_EQ(crc32c(std::as_bytes(std::span(digits))), 0xE3069283U);  // RFC 3720
}

TEST(Crc32c, AgreesWithBoostForEveryLength) {
  std::mt19937_64 random(1);
  for (std::size_t length = 0; length < 300; ++length) {
    const Bytes bytes = random_bytes(length, random);
    boost::crc_optimal<32, 0x1EDC6F41, 0xFFFFFFFF, 0xFFFFFFFF, true, true> boost_crc;
    boost_crc.process_bytes(bytes.data(), bytes.size());
    ASSERT_EQ(crc32c(bytes), boost_crc.checksum());
  }
}

class NativeTest : public testing::Test {
 protected:
  // `count` samples with counters 0, 1, ... in one stream.
  Bytes stream_of(std::size_t count) {
    std::vector<Sample> samples = random_samples(count, protocol_named("native"), random_);
    for (std::size_t i = 0; i < count; ++i) samples[i].counter = i;
    return concatenated(line_.encode_all(samples));
  }

  // The counters that a new decoder finds in `stream`, fed in random pieces.
  std::vector<std::uint64_t> counters_in(std::span<const std::byte> stream) {
    Line line(protocol_named("native"));
    Recording recording;
    while (!stream.empty()) {
      const std::size_t size = std::min<std::size_t>(1 + random_() % 200, stream.size());
      line.decoder->feed({stream.first(size)}, recording);
      stream = stream.subspan(size);
    }
    line.decoder->finish(recording);
    errors_ = line.decoder->errors();
    std::vector<std::uint64_t> counters;
    for (const Measurement& measurement : recording.measurements) counters.push_back(measurement.sample.counter);
    return counters;
  }

  static std::vector<std::uint64_t> all_but(std::size_t count, const std::set<std::uint64_t>& lost) {
    std::vector<std::uint64_t> counters;
    for (std::uint64_t i = 0; i < count; ++i)
      if (!lost.contains(i)) counters.push_back(i);
    return counters;
  }

  Line line_{protocol_named("native")};
  std::mt19937_64 random_{7};
  DecodeErrors errors_;
};

TEST_F(NativeTest, FieldsStandWhereTheTableSays) {
  Sample sample;
  sample.counter = 0x1'0403'0201;
  sample.time.ns = 0x0807060504030201;
  sample.rate = {1.0, 2.0, -2.0};
  sample.specific_force = {0.0, 0.5, 0.0};
  sample.delta_angle = {0.0, 0.0, 0.25};
  sample.delta_velocity = {4.0, 0.0, 8.0};
  sample.temperature_c = -1.0;
  sample.status = 0xA5;
  const std::span<const Frame> frames = line_.encode(sample);
  ASSERT_EQ(frames.size(), 1U);
  const std::span<const std::byte> bytes = frames[0].bytes;
  ASSERT_EQ(bytes.size(), frame_size);

  Bytes wanted(frame_size);
  const auto put = [&wanted](std::size_t offset, std::initializer_list<int> values) {
    for (const int value : values) wanted[offset++] = static_cast<std::byte>(value);
  };
  put(0, {'I', 'M', 1, 124, 1, 2, 3, 4, 1, 2, 3, 4, 5, 6, 7, 8});
  put(16 + 6, {0xF0, 0x3F});   // the high bytes of 1.0,
  put(24 + 7, {0x40});         // 2.0,
  put(32 + 7, {0xC0});         // -2.0
  put(48 + 6, {0xE0, 0x3F});   // 0.5
  put(80 + 6, {0xD0, 0x3F});   // 0.25
  put(88 + 6, {0x10, 0x40});   // 4.0
  put(104 + 6, {0x20, 0x40});  // 8.0
  put(112 + 2, {0x80, 0xBF});  // -1.0F
  put(116, {0xA5});
  boost::crc_optimal<32, 0x1EDC6F41, 0xFFFFFFFF, 0xFFFFFFFF, true, true> crc;
  crc.process_bytes(wanted.data(), 120);
  for (unsigned i = 0; i < 4; ++i) wanted[120 + i] = static_cast<std::byte>(crc.checksum() >> 8 * i);
  EXPECT_EQ(Bytes(bytes.begin(), bytes.end()), wanted);
}

TEST_F(NativeTest, BitErrorsLoseOnlyTheFramesHit) {
  for (int round = 0; round < 300; ++round) {
    Bytes stream = stream_of(40);
    std::set<std::uint64_t> hit;
    for (std::size_t errors = random_() % 12; errors > 0; --errors) {
      const std::size_t at = random_() % stream.size();
      if (!hit.insert(at / frame_size).second) continue;
      stream[at] ^= static_cast<std::byte>(1U << random_() % 8);
    }
    ASSERT_EQ(counters_in(stream), all_but(40, hit));
    EXPECT_EQ(errors_.skipped_bytes, hit.size() * frame_size);
    EXPECT_LE(errors_.checksum, hit.size());
  }
}

TEST_F(NativeTest, LostBytesLoseOnlyTheFramesHit) {
  for (int round = 0; round < 300; ++round) {
    Bytes stream = stream_of(20);
    const std::size_t begin = random_() % stream.size();
    const std::size_t count = std::min<std::size_t>(1 + random_() % 300, stream.size() - begin);
    std::set<std::uint64_t> hit;
    for (std::size_t i = begin; i < begin + count; ++i) hit.insert(i / frame_size);
    const auto first = stream.begin() + static_cast<std::ptrdiff_t>(begin);
    stream.erase(first, first + static_cast<std::ptrdiff_t>(count));
    ASSERT_EQ(counters_in(stream), all_but(20, hit));
  }
}

TEST_F(NativeTest, InsertedBytesLoseOnlyTheFrameHit) {
  for (int round = 0; round < 300; ++round) {
    Bytes stream = stream_of(20);
    const std::size_t at = random_() % stream.size();
    Bytes inserted = random_bytes(1 + random_() % 300, random_);
    inserted[0] = ~stream[at];  // so that the insertion is an error in any case
    stream.insert(stream.begin() + static_cast<std::ptrdiff_t>(at), inserted.begin(), inserted.end());
    std::set<std::uint64_t> hit;
    if (at % frame_size != 0) hit.insert(at / frame_size);
    ASSERT_EQ(counters_in(stream), all_but(20, hit));
  }
}

// The payload contains the beginning of a frame many times, and the true beginning is lost: after each false start
// the search continues at the next byte.
TEST_F(NativeTest, FalseStartsInThePayloadHideNoFrame) {
  constexpr std::uint64_t look_alike = 0x7C014D49'7C014D49;  // "IM", 1, 124, twice
  Sample sample;
  sample.rate = sample.specific_force = sample.delta_angle = sample.delta_velocity =
      Vector3::Constant(std::bit_cast<double>(look_alike));
  std::vector<Sample> samples(10, sample);
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i].counter = i;
  const Bytes stream = concatenated(line_.encode_all(samples));
  for (std::size_t lost = 1; lost < frame_size; ++lost)
    ASSERT_EQ(counters_in(std::span(stream).subspan(lost)), all_but(10, {0})) << lost;
  EXPECT_EQ(counters_in(stream), all_but(10, {}));
}

TEST_F(NativeTest, FinishDropsAFrameThatIsNotWhole) {
  const Bytes stream = stream_of(2);
  EXPECT_EQ(counters_in(std::span(stream).first(2 * frame_size - 1)), all_but(1, {}));
  EXPECT_EQ(errors_.skipped_bytes, frame_size - 1);
  EXPECT_EQ(errors_.checksum, 0U);
}

TEST_F(NativeTest, NumbersThatAreNotFiniteAreMalformed) {
  Sample sample;
  sample.delta_angle.y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(counters_in(concatenated(line_.encode_all(std::vector{sample}))).empty());
  EXPECT_EQ(errors_.malformed, 1U);
}

}  // namespace
}  // namespace imud
