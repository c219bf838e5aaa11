// When messages are sent, and how a stream of several messages is decoded.
#include "core/units.hpp"
#include "tests/protocols/frames/frame_unit.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

constexpr std::string_view three_messages = R"(
frame_version = 1
name = "three"
byte_order = "big"
[[message]]
name = "fast"
layout = ["F1", "rate_x_deg_per_s:i16*0.01", "rate_y_deg_per_s:i16*0.01", "rate_z_deg_per_s:i16*0.01",
          "sample_counter:u8", "time_ms:u16"]
[[message]]
name = "divided"
divider = 5
phase = 2
layout = ["F2", "delta_angle_x_rad:f64", "delta_angle_y_rad:f64", "delta_angle_z_rad:f64", "alive_counter:u8"]
[[message]]
name = "slow"
rate_hz = 8
layout = ["F3", "temperature_c:i8", "alive_counter:u16"]
)";

Sample nth(std::uint64_t k) {
  Sample sample;
  sample.counter = k;
  sample.time.ns = static_cast<std::int64_t>(k) * 10'000'000;
  sample.rate = Vector3(1, -2, 3) * units::degree * (1 + 0.01 * static_cast<double>(k % 7));
  sample.delta_angle = Vector3(0.5, 0.25, -0.125) * static_cast<double>(k);
  sample.temperature_c = 20;
  return sample;
}

std::string kinds(Line& line, std::uint64_t first, std::uint64_t count) {
  std::string text;
  for (std::uint64_t k = first; k < first + count; ++k) {
    for (const Frame& frame : line.encode(nth(k))) text += std::to_string(std::to_integer<int>(frame.bytes[0]) & 15);
    text += ' ';
  }
  return text;
}

TEST(FrameSchedule, MessagesAreSentByDividerPhaseAndRate) {
  Line line = frame_line(three_messages);
  EXPECT_EQ(kinds(line, 0, 16), "13 1 12 1 1 1 1 12 1 1 1 1 12 13 1 1 ");
  line.device->power_on({});
  EXPECT_EQ(kinds(line, 100, 4), "13 1 12 1 ");
  // Samples that are skipped do not shift the grid.
  EXPECT_EQ(kinds(line, 107, 1), "12 ");
  EXPECT_EQ(kinds(line, 111, 2), "1 12 ");
}

// A fixed sequence: five messages of one kind and one of another, as the HG4930 sends.
TEST(FrameSchedule, PhasesMakeASequence) {
  constexpr std::string_view text = R"(
frame_version = 1
name = "sequence"
[[message]]
name = "control"
divider = 6
phase = [0, 1, 2, 3, 4]
layout = ["F1", "rate_x_deg_per_s:f32", "sample_counter:u8", "alive_counter:u8"]
[[message]]
name = "inertial"
divider = 6
phase = 5
layout = ["F2", "delta_angle_x_rad:f64", "sample_counter:u8", "alive_counter:u8"]
)";
  Line line = frame_line(text);
  EXPECT_EQ(kinds(line, 0, 14), "1 1 1 1 1 2 1 1 1 1 1 2 1 1 ");
  line.device->power_on({});
  Recording recording;
  std::vector<int> alive;
  double sum = 0, sums = 0;
  for (std::uint64_t k = 0; k < 60; ++k) {
    sum += 0.5 * static_cast<double>(k);
    for (const Frame& frame : line.encode(nth(k))) {
      alive.push_back(std::to_integer<int>(frame.bytes.back()));
      line.decoder->feed(frame, recording);
    }
    if (k % 6 == 5) sums += std::exchange(sum, 0);
  }
  EXPECT_EQ(alive[16], 14);  // the number of control messages before
  EXPECT_EQ(alive[17], 2);
  ASSERT_EQ(recording.measurements.size(), 60U);  // each with its message, without waiting for the next one
  EXPECT_EQ(line.decoder->errors().incomplete, 0U);
  double found = 0;
  for (std::uint64_t k = 0; k < 60; ++k) {
    const Measurement& measurement = recording.measurements[k];
    EXPECT_EQ(measurement.sample.counter, k);
    const bool is_inertial = k % 6 == 5;
    EXPECT_EQ((measurement.fields & Measurement::rate) != 0, !is_inertial) << k;
    EXPECT_EQ((measurement.fields & Measurement::delta_angle) != 0, is_inertial) << k;
    if (is_inertial) found += measurement.sample.delta_angle.x();
  }
  EXPECT_EQ(found, sums);
}

TEST(FrameSchedule, AFrameCounterCountsAllMessages) {
  Line line = frame_line(R"(
frame_version = 1
name = "two"
[[message]]
name = "a"
layout = ["F1", "frame_counter%5:u8"]
[[message]]
name = "b"
divider = 2
text = "<{frame_counter%5:d}>"
)");
  const auto sent = [&line](std::uint64_t k) {
    std::string text;
    for (const std::byte byte : bytes_of(line, nth(k))) text += std::to_string(std::to_integer<int>(byte)) + ' ';
    return text;
  };
  EXPECT_EQ(sent(0), "241 0 60 49 62 ");
  EXPECT_EQ(sent(1), "241 2 ");
  EXPECT_EQ(sent(2), "241 3 60 52 62 ");
  EXPECT_EQ(sent(3), "241 0 ");
  line.device->power_on({});
  EXPECT_EQ(sent(4), "241 0 60 49 62 ");
}

TEST(FrameSchedule, ADeviceStartsUpWhenAHostResetsIt) {
  Line line = frame_line("start = {silent_s = 0.3, until_s = 0.4}\n" + one_message("A5\nbits:u8:0=starting") +
                         "[[request]]\nbytes = \"52\"\nreset = true\n");
  const auto at = [](std::int64_t ms) {
    Sample sample = nth(static_cast<std::uint64_t>(ms));
    sample.time.ns = ms * 1'000'000;
    return sample;
  };
  EXPECT_EQ(bytes_of(line, at(1000)), hex_bytes("A5 00"));
  FrameBuffer replies;
  const auto request = hex_bytes("52");
  line.device->receive({request}, {1'005'000'000}, replies);
  EXPECT_TRUE(bytes_of(line, at(1010)).empty());
  EXPECT_TRUE(bytes_of(line, at(1304)).empty());
  EXPECT_EQ(bytes_of(line, at(1305)), hex_bytes("A5 01"));
  EXPECT_EQ(bytes_of(line, at(1405)), hex_bytes("A5 00"));
}

TEST(FrameSchedule, MessagesCoincideByTheirPhases) {
  const auto message = [](std::uint64_t divider, std::vector<std::uint64_t> phases) {
    FrameMessage one;
    one.divider = divider;
    one.phases = std::move(phases);
    return one;
  };
  EXPECT_TRUE(may_coincide(message(1, {0}), message(7, {3})));
  EXPECT_FALSE(may_coincide(message(2, {0}), message(4, {1, 3})));
  EXPECT_TRUE(may_coincide(message(4, {1}), message(6, {3})));   // 9, 21, ...
  EXPECT_FALSE(may_coincide(message(4, {1}), message(6, {2})));  // an odd and an even number
  EXPECT_TRUE(may_coincide(message(3, {1}), message(5, {4})));   // 4, 19, ...
}

TEST(FrameSchedule, ADeviceStartsUp) {
  Line line = frame_line(
      "start = {silent_s = 0.3, until_s = 0.4, pattern = 0x55}\n" +
      one_message(
          "A5\nrate_x_deg_per_s:i16*0.01\ntemperature_c:i8\nbits:u8:0=starting,6=!not_valid|starting,7=!starting"));
  const auto at = [](std::int64_t ms) {
    Sample sample = nth(0);
    sample.time.ns = ms * 1'000'000;
    sample.counter = static_cast<std::uint64_t>(ms);
    return sample;
  };
  const auto pattern = hex_bytes("A5 55 55 14 01"), good = hex_bytes("A5 64 00 14 C0");
  const auto starts_up = [&](std::int64_t since) {
    EXPECT_TRUE(bytes_of(line, at(since)).empty());
    EXPECT_TRUE(bytes_of(line, at(since + 299)).empty());
    EXPECT_EQ(bytes_of(line, at(since + 300)), pattern);
    EXPECT_EQ(bytes_of(line, at(since + 399)), pattern);
    EXPECT_EQ(bytes_of(line, at(since + 400)), good);
  };
  starts_up(0);
  // By a bit of the start alone as well.
  for (const auto& [bit, starting, started] : {std::tuple("0=starting", "01", "00"), {"7=!starting", "00", "80"}}) {
    Line reader =
        frame_line("start = {silent_s = 0.3, until_s = 0.4, pattern = 0x55}\n" +
                   one_message("A5\nrate_x_deg_per_s:i16*0.01\ntemperature_c:i8\nbits:u8:" + std::string(bit)));
    Recording recording;
    for (const std::string end : {starting, started, starting}) {
      const auto bytes = hex_bytes("A5 55 55 14 " + end);
      reader.decoder->feed({bytes}, recording);
    }
    reader.decoder->finish(recording);
    ASSERT_EQ(recording.measurements.size(), 3U) << bit;
    for (std::size_t i = 0; i < 3; ++i)
      EXPECT_EQ((recording.measurements[i].sample.status & status::not_valid) != 0, i != 1) << bit << i;
  }
  line.device->power_on({5'000'000'000});
  starts_up(5000);
  line.device->power_on({9'000'000'000});
  line.device->step_clock(std::chrono::seconds(-4));
  starts_up(5000);
  Sample invalid = at(5500);
  invalid.status = status::not_valid;
  EXPECT_EQ(bytes_of(line, invalid), hex_bytes("A5 64 00 14 80"));
  EXPECT_TRUE(contains(faults_of(one_message("A5\nbits:u8:0=starting|rate_x_deg_per_s")),
                       "only bits of the status are joined by |, as in not_valid|starting"));
  EXPECT_EQ(faults_of("start = {silent_s = 1, until_s = 0.5}\n" + one_message("A5")),
            "test.toml:1: start.until_s: give more than silent_s, during which nothing is sent");
}

TEST(FrameSchedule, IncrementsAreSumsSinceTheLastMessage) {
  Line line = frame_line(three_messages);
  Recording recording;
  for (std::uint64_t k = 0; k < 20; ++k)
    for (const Frame& frame : line.encode(nth(k))) line.decoder->feed(frame, recording);
  line.decoder->finish(recording);
  ASSERT_EQ(recording.measurements.size(), 20U);
  double sum = 0;
  for (std::uint64_t k = 0; k < 20; ++k) {
    const Measurement& measurement = recording.measurements[k];
    EXPECT_EQ(measurement.sample.counter, k);
    EXPECT_EQ(measurement.sample.time.ns, nth(k).time.ns);
    EXPECT_NEAR(measurement.sample.rate.z(), nth(k).rate.z(), 0.005 * units::degree);
    const bool has_increment = k % 5 == 2;
    EXPECT_EQ((measurement.fields & Measurement::delta_angle) != 0, has_increment) << k;
    EXPECT_EQ((measurement.fields & Measurement::temperature) != 0, k == 0 || k == 13) << k;
    sum += 0.5 * static_cast<double>(k);
    if (has_increment) {
      EXPECT_EQ(measurement.sample.delta_angle.x(), std::exchange(sum, 0));
    }
  }
}

TEST(FrameSchedule, ClocksAndCountersGoOnWhereTheyBeginAgain) {
  Line line = frame_line(three_messages);
  Recording recording(20'000);
  for (std::uint64_t k = 0; k < 20'000; ++k) {  // 200 s: three rounds of the clock, 78 of the counter
    if (k >= 5000 && k < 5200) continue;        // a loss
    for (const Frame& frame : line.encode(nth(k))) line.decoder->feed(frame, recording);
  }
  line.decoder->finish(recording);
  ASSERT_EQ(recording.measurements.size(), 19'800U);
  EXPECT_EQ(recording.measurements.back().sample.counter, 19'999U);
  EXPECT_EQ(recording.measurements.back().sample.time.ns, nth(19'999).time.ns);
}

TEST(FrameSchedule, AStreamWithoutACounterOfSamplesHasThatOfMessages) {
  Line line = frame_line(one_message("A5 5A\nalive_counter%100:u8\nrate_x_deg_per_s:f32"));
  Recording recording;
  for (std::uint64_t k = 0; k < 250; ++k)
    for (const Frame& frame : line.encode(nth(k)))
      if (k < 150 || k > 160) line.decoder->feed(frame, recording);
  ASSERT_EQ(recording.measurements.size(), 239U);
  EXPECT_EQ(recording.measurements[0].fields, std::uint32_t{Measurement::counter | Measurement::rate});
  EXPECT_EQ(recording.measurements[149].sample.counter, 149U);
  EXPECT_EQ(recording.measurements[150].sample.counter, 161U);
}

// Damage of all kinds: a frame that is hit is lost, and only that.
TEST(FrameSchedule, DamageLosesOnlyTheFramesHit) {
  const std::string text = one_message(
      "55 AA\n@a\nsample_counter:u32\nrate_x_deg_per_s:f32\nrate_y_deg_per_s:f32\nrate_z_deg_per_s:f32\n"
      "check:crc16/xmodem:@a.. be");
  std::mt19937_64 random(7);
  Line line = frame_line(text);
  std::vector<std::byte> stream;
  std::vector<std::uint64_t> whole;
  for (std::uint64_t k = 0; k < 2000; ++k) {
    std::vector<std::byte> bytes = bytes_of(line, nth(k));
    const auto damage = random() % 10;
    if (damage == 0) bytes[random() % bytes.size()] ^= std::byte{0x10};
    if (damage == 1) bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(random() % bytes.size()));
    if (damage == 2) bytes.insert(bytes.begin() + 5, {std::byte{0x55}, std::byte{0xAA}, std::byte{0x55}});
    if (damage > 2) whole.push_back(k);
    stream.insert(stream.end(), bytes.begin(), bytes.end());
  }
  Recording recording;
  for (std::span<const std::byte> rest = stream; !rest.empty();) {
    const std::size_t size = std::min<std::size_t>(1 + random() % 50, rest.size());
    line.decoder->feed({rest.first(size)}, recording);
    rest = rest.subspan(size);
  }
  line.decoder->finish(recording);
  std::vector<std::uint64_t> found;
  for (const Measurement& measurement : recording.measurements) found.push_back(measurement.sample.counter);
  EXPECT_EQ(found, whole);
  EXPECT_GT(line.decoder->errors().checksum, 100U);
}

}  // namespace
}  // namespace imud
