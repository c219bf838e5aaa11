// The shipped descriptions: each has a test frame from outside, and is decoded after any damage.
#include <filesystem>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "core/units.hpp"
#include "tests/protocols/frames/frame_unit.hpp"
#include "tests/support/allocations.hpp"

namespace imud {
namespace {

Sample typical() {
  Sample sample;
  sample.time.ns = 12'000'000'000;
  sample.counter = 100;
  sample.rate = Vector3(0.1, -0.2, 0.3);
  sample.specific_force = Vector3(0.5, -0.25, -9.8);
  sample.delta_angle = 0.01 * sample.rate;
  sample.delta_velocity = 0.01 * sample.specific_force;
  sample.magnetic_field = Vector3(2e-5, 1e-6, 4e-5);
  sample.pressure = 101325;
  sample.navigation = {.is_known = true, .gps_ns = 1'440'000'001'000'000'000, .latitude = 0.8, .longitude = 0.1};
  return sample;
}

TEST(ShippedFrames, HaveATestFrame) {
  std::set<std::string> names, files;
  for (const ShippedFrames& shipped : shipped_frames()) {
    SCOPED_TRACE(shipped.name);
    names.emplace(shipped.name);
    const auto description = read_frames(std::string(shipped.name));
    EXPECT_FALSE(description->document.empty());
    EXPECT_TRUE(std::ranges::all_of(description->messages,
                                    [](const FrameDescription::Message& m) { return !m.tests.empty(); }));
  }
  for (const auto& file : std::filesystem::directory_iterator(IMUD_SOURCE_DIR "/protocols/frames"))
    if (file.path().extension() == ".toml") files.insert(file.path().stem());
  EXPECT_EQ(names, files);
  EXPECT_GE(names.size(), 34U);
}

// Returns true if the frames carry the specific force.
bool is_measured(std::string_view name) {
  const std::vector<FrameMessage> messages = frame_messages(*read_frames(std::string(name)));
  return std::ranges::any_of(messages,
                             [](const FrameMessage& m) { return (m.layout->components() & 0b111'000U) != 0; });
}

TEST(ShippedFrames, AreDecodedWithinAnLsb) {
  std::set<std::string_view> without;
  for (const ShippedFrames& shipped : shipped_frames()) {
    SCOPED_TRACE(shipped.name);
    Line line(protocol_named("frame"), frame_settings(read_frames(std::string(shipped.name))));
    Recording recording;
    Sample sample = typical();
    for (int k = 0; k < 20; ++k) {
      for (const Frame& frame : line.encode(sample)) line.decoder->feed(frame, recording);
      ++sample.counter;
      sample.time = sample.time + std::chrono::milliseconds(100);  // the slowest sends at 10 Hz as delivered
    }
    line.decoder->finish(recording);
    const DecodeErrors& errors = line.decoder->errors();
    EXPECT_EQ(errors.checksum + errors.malformed + errors.incomplete + errors.skipped_bytes, 0U);
    if (!is_measured(shipped.name)) {
      without.insert(shipped.name);
      continue;
    }
    ASSERT_EQ(recording.measurements.size(), 20U);
    for (const Measurement& measurement : recording.measurements) {
      if ((measurement.fields & Measurement::rate) != 0) {
        EXPECT_LE((measurement.sample.rate - sample.rate).norm(), 1e-3) << measurement.sample.rate.transpose();
      } else if ((measurement.fields & Measurement::delta_angle) != 0) {
        EXPECT_TRUE(measurement.sample.delta_angle.isApprox(sample.delta_angle, 1e-3))
            << measurement.sample.delta_angle.transpose();
      } else {
        EXPECT_EQ(shipped.name, "bno08x-rvc");
      }
      EXPECT_NE(measurement.fields & Measurement::specific_force, 0U);
      EXPECT_LE((measurement.sample.specific_force - sample.specific_force).norm(), 0.02);
    }
  }
  EXPECT_EQ(without,
            (std::set<std::string_view>{"applanix-gsof", "nmea", "nmea-attitude", "novatel-raw", "stim210", "tss1"}));
}

TEST(ShippedFrames, AllocateNothingOnceMade) {
  for (const ShippedFrames& shipped : shipped_frames()) {
    SCOPED_TRACE(shipped.name);
    Line line(protocol_named("frame"), frame_settings(read_frames(std::string(shipped.name))));
    Recording recording(1000);
    Sample sample = typical();
    const std::uint64_t before = allocations();
    for (int k = 0; k < 500; ++k) {
      for (const Frame& frame : line.encode(sample)) line.decoder->feed(frame, recording);
      ++sample.counter;
      sample.time = sample.time + std::chrono::milliseconds(10);
    }
    line.device->power_on(sample.time);
    EXPECT_EQ(allocations() - before, 0U);  // frame_request_fuzz_test.cpp counts while the host sends
  }
}

// Frames that a unit does not send as delivered, because settings select them, are right to the byte, too.
TEST(ShippedFrames, SettingsSelectFurtherMessages) {
  Sample sample;
  sample.counter = 1;
  sample.rate = Vector3(0.1, -0.2, 0.3);
  sample.specific_force.z() = 9.80665;
  const auto frame = [](const char* description, std::string_view message, const Reading& reading) {
    for (const FrameMessage& one : frame_messages(*read_frames(description))) {
      if (one.name != message) continue;
      std::vector<double> carried(one.layout->carries());
      std::vector<std::byte> bytes(one.layout->longest());
      one.layout->encode(reading, {}, carried, bytes);
      return bytes;
    }
    return std::vector<std::byte>();
  };
  EXPECT_EQ(
      frame("hg4930", "inertial, version", {sample, {0.001, -0.002, 0.003}, {0, 0, 0.0980665}}),
      hex_bytes("0E 02 AF 00 A2 FE 0C 02 00 00 00 00 6F 03 05 00 12 00 6F 12 83 00 23 DB F9 FE 4C 37 89 01 00 00 "
                "00 00 00 00 00 00 AD EC 92 02 13 1C"));
  sample.rate = units::degree * Vector3(0.1, 0.2, 0.3);
  EXPECT_EQ(frame("um7", "gyro", {sample}), hex_bytes("73 6E 70 CC 61 3D CC CC CD 3E 4C CC CD 3E 99 99 9A 09 4D"));
  // Each is sent if its setting has the value, and another in its place, or none.
  for (const auto& [name, setting, size, selected] :
       {std::tuple{"hg4930", "INERTIAL_STATUS=version", 5 * 20 + 44, 5 * 20 + 44},
        {"hg4930", "CONTROL_STATUS=version", 5 * 20 + 44, 5 * 20 + 44},
        {"kvh1750", "TEMPUNITS=F", 6 * 36, 6 * 36},
        {"anpp", "SYSTEM_STATE_HZ=1", 6 * 53, 6 * 53 + 105},
        {"novatel-raw", "INSPVAS_HZ=1", 6 * 56, 6 * 56 + 104},
        {"novatel-raw", "BESTGNSSPOS_HZ=1", 6 * 56, 6 * 56 + 104},
        {"novatel-raw", "BESTGNSSVEL_HZ=1", 6 * 56, 6 * 56 + 76},
        {"um7", "GYRO_ALONE=on", 6 * (55 + 19 + 27) + 51, 6 * (55 + 19 + 27 + 19) + 51}}) {
    Settings settings = frame_settings(read_frames(name));
    Line delivered(protocol_named("frame"), settings);
    settings.set("settings", std::vector<std::string>{setting});
    Line other(protocol_named("frame"), settings);
    std::vector<std::byte> sent, of_setting;
    Sample one = typical();
    for (int k = 0; k < 6; ++k) {
      for (const auto& [line, into] : {std::pair(&delivered, &sent), std::pair(&other, &of_setting)}) {
        const std::vector<std::byte> bytes = bytes_of(*line, one);
        into->insert(into->end(), bytes.begin(), bytes.end());
      }
      ++one.counter;
      one.time = one.time + std::chrono::milliseconds(2);
    }
    EXPECT_EQ(sent.size(), static_cast<std::size_t>(size)) << setting;
    EXPECT_EQ(of_setting.size(), static_cast<std::size_t>(selected)) << setting;
    EXPECT_NE(sent, of_setting) << setting;
    // A unit that sends other messages than the one of the settings is decoded as well.
    Recording recording;
    delivered.decoder->feed({of_setting}, recording);
    delivered.decoder->finish(recording);
    EXPECT_EQ(recording.measurements.size(), 6U) << setting;
    EXPECT_EQ(delivered.decoder->errors().skipped_bytes, 0U) << setting;
  }
}

// The byte with the state of the start: HG4930, mode of the built-in test; KVH 1750, sensors whose data are valid.
TEST(ShippedFrames, StateTheirStart) {
  struct Case {
    const char* name;
    std::size_t at;
    std::uint8_t mask, starting, started;
    std::int64_t silent_ms, until_ms;
  };
  for (const Case& one :
       {Case{"hg4930", 14, 0x0C, 0x00, 0x04, 300, 400}, {"kvh1750", 28, 0xFF, 0x70, 0x77, 0, 1250}}) {
    SCOPED_TRACE(one.name);
    Line line(protocol_named("frame"), frame_settings(read_frames(one.name)));
    const auto state = [&](std::int64_t ms) {
      Sample sample = typical();
      sample.time.ns = 1'000'000 * ms;
      const std::vector<std::byte> bytes = bytes_of(line, sample);
      return one.at < bytes.size() ? std::to_integer<int>(bytes[one.at]) & one.mask : -1;
    };
    EXPECT_EQ(state(one.silent_ms), one.starting);
    EXPECT_EQ(state(one.until_ms - 1), one.starting);
    EXPECT_EQ(state(one.until_ms), one.started);
  }
}

// Each bit of a frame in error, between good frames: no wrong number, and the good frames are found.
TEST(ShippedFrames, RefuseEveryBitInError) {
  const std::set<std::string_view> slow = {"sensaition-ins", "um7", "witmotion", "mavlink-hil", "mavlink-imu"};
  int refused = 0;
  for (const ShippedFrames& shipped : shipped_frames()) {
    SCOPED_TRACE(shipped.name);
    if (shipped.name == "razor" || shipped.name == "tss1") continue;  // without a check
    ++refused;
    const Settings settings = frame_settings(read_frames(std::string(shipped.name)));
    Line line(protocol_named("frame"), settings);
    const std::vector<std::byte> good = bytes_of(line, typical());
    const bool has_slow = slow.contains(shipped.name), has_force = is_measured(shipped.name);
    for (std::size_t bit = 0; bit < 8 * good.size(); ++bit) {
      std::vector<std::byte> stream = good;
      stream[bit / 8] ^= static_cast<std::byte>(1U << bit % 8);
      stream.insert(stream.end(), good.begin(), good.end());
      stream.insert(stream.end(), good.begin(), good.end());
      Line other(protocol_named("frame"), settings);
      Recording recording;
      other.decoder->feed({stream}, recording);
      other.decoder->finish(recording);
      const DecodeErrors& errors = other.decoder->errors();
      if (!has_force) {
        EXPECT_GT(errors.skipped_bytes + errors.checksum, 0U) << "bit " << bit;
        continue;
      }
      // A message that not every sample has, or that a setting may switch off, does not count.
      ASSERT_GE(recording.measurements.size(), 2U) << "bit " << bit;
      ASSERT_LE(recording.measurements.size(), has_slow ? 3U : 2U) << "bit " << bit;
      for (const Measurement& measurement : recording.measurements)
        if (shipped.name != "witmotion" || (measurement.fields & Measurement::specific_force) != 0) {
          ASSERT_LE((measurement.sample.specific_force - typical().specific_force).norm(), 0.02) << "bit " << bit;
        }
      EXPECT_GT(errors.skipped_bytes, 0U) << "bit " << bit;
      EXPECT_EQ(errors.malformed, 0U) << "bit " << bit;
    }
  }
  EXPECT_GE(refused, 32);
}

}  // namespace
}  // namespace imud
