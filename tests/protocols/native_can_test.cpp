// The native CAN frames: the bytes of both kinds, and incomplete sets.
#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "tests/protocols/recording.hpp"

namespace imud {
namespace {

Settings settings_of(std::initializer_list<std::pair<std::string_view, SettingValue>> values) {
  Settings settings(protocol_named("native-can").settings);
  for (const auto& [key, value] : values) settings.set(key, value);
  return settings;
}

std::uint64_t little_endian(std::span<const std::byte> bytes) {
  std::uint64_t value = 0;
  for (std::size_t i = bytes.size(); i > 0; --i) value = value << 8 | std::to_integer<std::uint64_t>(bytes[i - 1]);
  return value;
}

Sample known_sample() {
  Sample sample;
  sample.counter = 0x1234;
  sample.time.ns = 4294967301'000 + 499;  // 2^32 + 5 us and a little
  sample.temperature_c = -1.5;
  sample.status = 0x141;
  sample.rate = {0x1p-22, -0x1p-22, 1.0};
  sample.specific_force = {-1024.0, 1024.0, -9.81};
  sample.delta_angle = {0.5, -0.5, 0x1.8p-28};  // the last 3/4 LSB
  sample.delta_velocity = {1.0, 0.0, -1.0};
  return sample;
}

class NativeCan : public testing::Test {
 protected:
  std::vector<StoredFrame> frames_of(std::size_t count, const Settings& settings = settings_of({})) {
    std::vector<Sample> samples = random_samples(count, protocol_named("native-can"), random_);
    for (std::size_t i = 0; i < count; ++i) samples[i].counter = i;
    return Line(protocol_named("native-can"), settings).encode_all(samples);
  }

  // Returns the counters that a new decoder decodes from `frames`.
  std::vector<std::uint64_t> counters_in(std::span<const StoredFrame> frames,
                                         const Settings& settings = settings_of({})) {
    Line line(protocol_named("native-can"), settings);
    Recording recording;
    line.feed(frames, recording);
    line.decoder->finish(recording);
    errors_ = line.decoder->errors();
    std::vector<std::uint64_t> counters;
    for (const Measurement& measurement : recording.measurements) counters.push_back(measurement.sample.counter);
    return counters;
  }

  using Counters = std::vector<std::uint64_t>;
  std::mt19937_64 random_{11};
  DecodeErrors errors_;
};

TEST_F(NativeCan, ClassicFramesAreAsDocumented) {
  Line line(protocol_named("native-can"));
  const std::span<const Frame> frames = line.encode(known_sample());
  ASSERT_EQ(frames.size(), 7U);
  for (std::uint32_t i = 0; i < 7; ++i) {
    EXPECT_EQ(frames[i].can.id, 0x100 + i);
    EXPECT_EQ(frames[i].bytes.size(), 8U);
    EXPECT_FALSE(frames[i].can.extended || frames[i].can.fd || frames[i].can.bit_rate_switch);
  }
  EXPECT_EQ(little_endian(frames[0].bytes), 0x41FE'8000'0000'0534ULL);  // status, -384, 5 us, counter
  EXPECT_EQ(little_endian(frames[1].bytes), 0x34FF'FFFF'F000'0001ULL);  // -1, 1
  EXPECT_EQ(little_endian(frames[2].bytes), 0x3480'0000'0040'0000ULL);  // -2^27, 2^22
  EXPECT_EQ(little_endian(frames[3].bytes), 0x34FE'C614'87FF'FFFFULL);  // -1285816, 2^27 - 1
  EXPECT_EQ(little_endian(frames[4].bytes), 0x34C0'0000'0400'0000ULL);  // -2^26, 2^26
  EXPECT_EQ(little_endian(frames[5].bytes), 0x3401'0000'0000'0001ULL);  // 2^20, 1
  EXPECT_EQ(little_endian(frames[6].bytes), 0x34FF'0000'0000'0000ULL);  // -2^20, 0
}

TEST_F(NativeCan, FdFrameIsAsDocumented) {
  const Settings settings = settings_of({{"fd", true}, {"can_id", std::int64_t{0x7FF}}});
  Line line(protocol_named("native-can"), settings);
  const std::span<const Frame> frames = line.encode(known_sample());
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_EQ(frames[0].can.id, 0x7FFU);
  EXPECT_TRUE(frames[0].can.fd && frames[0].can.bit_rate_switch);
  const std::span<const std::byte> bytes = frames[0].bytes;
  ASSERT_EQ(bytes.size(), 64U);
  EXPECT_EQ(little_endian(bytes.subspan(0, 8)), 4294967301'499ULL);
  EXPECT_EQ(little_endian(bytes.subspan(8, 4)), 0x1234U);
  EXPECT_EQ(little_endian(bytes.subspan(12, 2)), 0xFE80U);
  EXPECT_EQ(little_endian(bytes.subspan(14, 2)), 0x141U);
  EXPECT_EQ(little_endian(bytes.subspan(16, 4)), 0x34800000U);  // 2^-22F
  EXPECT_EQ(little_endian(bytes.subspan(28, 4)), 0xC4800000U);  // -1024F
  EXPECT_EQ(little_endian(bytes.subspan(40, 4)), 0x3F000000U);  // 0.5F
  EXPECT_EQ(little_endian(bytes.subspan(60, 4)), 0xBF800000U);  // -1F
}

TEST_F(NativeCan, FdCarriesFloatsAndExactTime) {
  const Settings settings = settings_of({{"fd", true}});
  Line line(protocol_named("native-can"), settings);
  for (const Sample& sample : random_samples(500, protocol_named("native-can"), random_)) {
    Recording recording;
    for (const Frame& frame : line.encode(sample)) line.decoder->feed(frame, recording);
    ASSERT_EQ(recording.measurements.size(), 1U);
    const Sample& got = recording.measurements[0].sample;
    EXPECT_EQ(recording.measurements[0].fields, Measurement::all);
    EXPECT_EQ(got.time, sample.time);
    EXPECT_EQ(got.counter, sample.counter & 0xFFFF'FFFFU);
    EXPECT_EQ(got.status, sample.status & 0xFFFFU);
    EXPECT_NEAR(got.temperature_c, sample.temperature_c, 0x1p-9);
    EXPECT_EQ(got.rate, sample.rate.cast<float>().cast<double>());
    EXPECT_EQ(got.specific_force, sample.specific_force.cast<float>().cast<double>());
    EXPECT_EQ(got.delta_angle, sample.delta_angle.cast<float>().cast<double>());
    EXPECT_EQ(got.delta_velocity, sample.delta_velocity.cast<float>().cast<double>());
  }
  EXPECT_EQ(line.decoder->errors().malformed, 0U);
}

TEST_F(NativeCan, OneDecoderTakesBothKinds) {
  const Settings settings = settings_of({{"extended", true}, {"can_id", std::int64_t{0x18FF0000}}});
  Settings fd = settings;
  fd.set("fd", true);
  std::vector<StoredFrame> frames = frames_of(2, settings);
  const std::vector<StoredFrame> fd_frames = frames_of(1, fd);
  frames.insert(frames.begin() + 3, fd_frames.begin(), fd_frames.end());
  EXPECT_EQ(counters_in(frames, settings), (Counters{0, 0, 1}));
  EXPECT_EQ(counters_in(frames, fd), (Counters{0, 0, 1}));
  EXPECT_EQ(errors_.incomplete + errors_.malformed, 0U);
  EXPECT_TRUE(counters_in(frames).empty()) << "other identifiers";
}

TEST_F(NativeCan, ASetWithOneFrameMissingIsIncomplete) {
  for (std::ptrdiff_t missing = 7; missing < 14; ++missing) {
    std::vector<StoredFrame> frames = frames_of(3);
    frames.erase(frames.begin() + missing);
    EXPECT_EQ(counters_in(frames), (Counters{0, 2})) << missing;
    EXPECT_EQ(errors_.incomplete, 1U) << missing;
  }
}

TEST_F(NativeCan, ASetOutOfOrderIsIncomplete) {
  for (std::size_t swapped = 7; swapped < 13; ++swapped) {
    std::vector<StoredFrame> frames = frames_of(3);
    std::swap(frames[swapped], frames[swapped + 1]);
    EXPECT_EQ(counters_in(frames), (Counters{0, 2})) << swapped;
    EXPECT_GE(errors_.incomplete, 1U) << swapped;
  }
}

TEST_F(NativeCan, TwoSamplesAreNeverMixed) {
  // The end of one sample and the beginning of the next are lost: the rest has the identifiers of one complete set.
  for (std::ptrdiff_t cut = 1; cut < 7; ++cut) {
    std::vector<StoredFrame> frames = frames_of(4);
    frames.erase(frames.begin() + 7 + cut, frames.begin() + 14 + cut);
    EXPECT_EQ(counters_in(frames), (Counters{0, 3})) << cut;
    EXPECT_EQ(errors_.incomplete, 2U) << cut;
  }
}

TEST_F(NativeCan, AListenerThatComesLateCountsOneSet) {
  const std::vector<StoredFrame> frames = frames_of(3);
  EXPECT_EQ(counters_in(std::span(frames).subspan(4)), (Counters{1, 2}));
  EXPECT_EQ(errors_.incomplete, 1U);
  EXPECT_EQ(counters_in(std::span(frames).first(18)), (Counters{0, 1}));
  EXPECT_EQ(errors_.incomplete, 1U);
}

TEST_F(NativeCan, FramesOfAnotherLengthAreMalformed) {
  std::vector<StoredFrame> frames = frames_of(2);
  frames[3].bytes.pop_back();
  EXPECT_EQ(counters_in(frames), (Counters{1}));
  EXPECT_EQ(errors_.malformed, 1U);
  EXPECT_EQ(errors_.incomplete, 1U);

  const Settings fd = settings_of({{"fd", true}});
  frames = frames_of(2, fd);
  frames[0].bytes.resize(48);
  frames[1].bytes[16 + 3] = std::byte{0xFF};  // rate x: not finite
  frames[1].bytes[16 + 2] = std::byte{0xFF};
  EXPECT_TRUE(counters_in(frames, fd).empty());
  EXPECT_EQ(errors_.malformed, 2U);
}

TEST_F(NativeCan, OthersFramesAreLeftAlone) {
  std::vector<StoredFrame> frames = frames_of(1);
  std::vector<StoredFrame> others = frames;
  for (std::size_t i = 0; i < others.size(); ++i) {
    CanHeader& can = others[i].can;
    if (i % 5 == 0) can.id += 7;
    if (i % 5 == 1) can.id -= 0x80;
    if (i % 5 == 2) can.extended = true;
    if (i % 5 == 3) can.remote = true;
    if (i % 5 == 4) can.error = true;
  }
  for (std::size_t i = 0; i < others.size(); ++i)
    frames.insert(frames.begin() + static_cast<std::ptrdiff_t>(2 * i), others[i]);
  EXPECT_EQ(counters_in(frames), Counters{0});
  EXPECT_EQ(errors_.incomplete + errors_.malformed, 0U);
}

TEST_F(NativeCan, TimeIsFollowedThroughItsWraps) {
  Line line(protocol_named("native-can"));
  Recording recording;
  const std::int64_t step = 1'000'000'000'000;  // 16.7 min, a wrap in every four or five
  for (std::int64_t k = 0; k < 30; ++k) {
    Sample sample;
    sample.time.ns = k * step;
    for (const Frame& frame : line.encode(sample)) line.decoder->feed(frame, recording);
    ASSERT_EQ(recording.measurements.back().sample.time.ns, k * step);
  }
  Sample restarted;  // a step back of less than half a period is one
  restarted.time.ns = 29 * step - 1'000'000'000;
  for (const Frame& frame : line.encode(restarted)) line.decoder->feed(frame, recording);
  EXPECT_EQ(recording.measurements.back().sample.time, restarted.time);
}

TEST_F(NativeCan, TimeIsRoundedToTheNearestMicrosecond) {
  for (const auto& [ns, us] :
       {std::pair{499, 0}, {500, 1}, {1499, 1}, {-499, 0}, {-500, 0}, {-501, -1}, {-1501, -2}}) {
    Line line(protocol_named("native-can"));
    Sample sample;
    sample.time.ns = ns;
    const std::uint64_t head = little_endian(line.encode(sample)[0].bytes);
    EXPECT_EQ(static_cast<std::int32_t>(head >> 8 & 0xFFFF'FFFFU), us) << ns;
  }
}

TEST_F(NativeCan, IdentifiersThatDoNotFitAreRefused) {
  const Protocol& protocol = protocol_named("native-can");
  EXPECT_NO_THROW(protocol.make(settings_of({{"can_id", std::int64_t{0x7F9}}})));
  EXPECT_NO_THROW(protocol.make(settings_of({{"can_id", std::int64_t{0x7FF}}, {"fd", true}})));
  EXPECT_NO_THROW(protocol.make(settings_of({{"can_id", std::int64_t{0x1FFFFFF9}}, {"extended", true}})));
  for (const Settings& settings :
       {settings_of({{"can_id", std::int64_t{0x7FA}}}), settings_of({{"can_id", std::int64_t{0x800}}, {"fd", true}}),
        settings_of({{"can_id", std::int64_t{0x1FFFFFFA}}, {"extended", true}})}) {
    EXPECT_THROW(protocol.make(settings), std::invalid_argument);
    EXPECT_THROW(protocol.make_decoder(settings), std::invalid_argument);
  }
}

}  // namespace
}  // namespace imud
