// Devices whose messages are tables: when a message is sent, what it sums, and what their decoder makes of losses;
// and the known frames of the products.
#include "protocols/signals/signal_device.hpp"

#include <gtest/gtest.h>

#include <string>
#include <utility>

#include "core/attitude.hpp"
#include "core/units.hpp"
#include "tests/protocols/can_text.hpp"
#include "tests/protocols/recording.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

// A device and its clock.
class Sender {
 public:
  Sender(std::string_view protocol, std::string_view settings)
      : Sender(protocol_named(protocol).make(settings_of(protocol_named(protocol), settings))) {}
  explicit Sender(std::unique_ptr<Device> device) : device(std::move(device)) {}

  // The frames of the next sample, after `step`.
  std::vector<std::string> next(Nanoseconds step, std::uint64_t skipped = 0) {
    sample.counter += 1 + skipped;
    sample.time = sample.time + step;
    return now();
  }
  std::vector<std::string> now() {
    frames_->clear();
    device->sample(sample, *frames_);
    std::vector<std::string> lines;
    for (const Frame& frame : frames_->frames()) lines.push_back(can_text(frame));
    return lines;
  }

  std::unique_ptr<Device> device;
  Sample sample;

 private:
  std::unique_ptr<FrameBuffer> frames_ = std::make_unique<FrameBuffer>();
};

std::vector<std::string> identifiers(const std::vector<std::string>& lines) {
  std::vector<std::string> ids;
  for (const std::string& line : lines) ids.push_back(line.substr(0, line.find('#')));
  return ids;
}
using Lines = std::vector<std::string>;

// --- Known frames ---

// IMU_ACCEL and IMU_GYRO: cantools and canmatrix decode these numbers by SBG's own sbgCan.dbc.
TEST(SignalDeviceTest, SbgFramesAreThoseOfSbgsDbc) {
  Sender sbg("sbg-can", "");
  sbg.sample.time.ns = 1'234'567'000;
  sbg.sample.temperature_c = -12.34;
  sbg.sample.specific_force = {9.81, 0, -9.81};
  sbg.sample.rate = {0.1, -0.2, 0.3};
  EXPECT_EQ(sbg.now(), (Lines{"120#87D61200FF032EFB", "121#D50300002BFC", "122#640038FF2C01"}));
  sbg.sample.status = status::gyro_saturated_x << 1 | status::not_valid;
  EXPECT_EQ(sbg.next(5ms)[0], "120#0FEA120001012EFB");
  sbg.sample.status = status::accelerometer_saturated_x << 2;
  EXPECT_EQ(sbg.next(5ms)[0], "120#97FD1200FF022EFB");
}

TEST(SignalDeviceTest, SbgSendsWhatIsConfigured) {
  Sender sbg("sbg-can", "messages=ekf_quat@50,imu_gyro,ekf_euler@100 identifiers=imu_gyro=0x712 id_offset=1");
  EXPECT_EQ(identifiers(sbg.now()), (Lines{"712", "132", "133"}));
  int sent[3] = {};
  for (int i = 1; i <= 400; ++i)  // two seconds
    for (const std::string& id : identifiers(sbg.next(5ms))) ++sent[id == "712" ? 0 : id == "132" ? 1 : 2];
  EXPECT_EQ(sent[0], 400);
  EXPECT_EQ(sent[1], 100);
  EXPECT_EQ(sent[2], 200);
}

TEST(SignalDeviceTest, SbgReportsTheTruthsNavigation) {
  Sender sbg("sbg-can",
             "messages=utc_0,utc_1,ekf_quat,ekf_euler,ekf_pos,ekf_altitude,ekf_vel_ned,ekf_vel_body,mag_1");
  Sample& s = sbg.sample;
  s.time.ns = 1'000'000;
  s.q_LP = exp(Vector3(0, 0, units::pi / 2));  // x points east
  s.navigation.is_known = true;
  s.navigation.gps_ns = 1'420'000'000'123'456'789;  // 2025-01-04 04:26:22.123456789 UTC, week 2347 and 534400 s
  s.navigation.latitude = 47 * units::degree;
  s.navigation.longitude = -11.5 * units::degree;
  s.navigation.height = 600.25;
  s.navigation.v_L = {1, 2, -3};
  s.magnetic_field = {50e-6, -25e-6, 100e-6};
  EXPECT_EQ(sbg.now(), (Lines{"110#E80300007B4CDA1F", "111#190104041A16D204", "131#825A00000000825A",
                              "132#000000005C3D", "134#80A1031C403D25F9", "135#BA2809000000", "137#6400C800D4FE",
                              "139#C8009CFFD4FE", "151#E8030CFED007"}));
  const Navigation place = std::exchange(s.navigation, {});
  EXPECT_EQ(sbg.next(5ms)[1], "111#0000000000000000");
  s.solution.emplace().receiver = place;  // its own filter aligns
  const Lines aligns = sbg.next(5ms);
  EXPECT_EQ(aligns[4], "134#80A1031C403D25F9");
  EXPECT_EQ(aligns[5], "135#BA2809000000");
  EXPECT_EQ(aligns[7], "139#C8009CFFD4FE");
}

// The frames of facts known of MM7.10: the first is the golden one; the others have its counter.
TEST(SignalDeviceTest, BoschMm7FramesHaveTheirCounterAndCrc) {
  Sender mm7("bosch-mm7", "");
  mm7.sample.counter = 3;
  mm7.sample.rate.z() = 10 * units::degree;
  mm7.sample.specific_force.y() = -units::standard_gravity;
  mm7.sample.temperature_c = 20;
  const Lines lines = mm7.now();
  ASSERT_EQ(identifiers(lines), (Lines{"174", "178", "17C"}));
  EXPECT_EQ(lines[0], "174#D08700465B610352");
  EXPECT_EQ(lines[1].substr(4, 14), "00800000008003");
  EXPECT_EQ(lines[2].substr(4, 14), "00800000008003");
  mm7.sample.counter = 15;
  mm7.sample.status = status::gyro_saturated_x << 2 | status::accelerometer_saturated_x << 1;
  mm7.sample.rate.z() = -1e3;
  mm7.sample.specific_force.y() = 1e3;
  mm7.sample.temperature_c = 1e3;
  EXPECT_EQ(mm7.next(10ms)[0].substr(4, 14), "000020C9FFFF20");
}

// off_highway_mm7p10, receiver.hpp: TEMP_INVALID_HIGH 0xC9, "temp > 150", TEMP_INVALID_LOW 0xFF, "temp < -50"; bits
// of the status IMU_NOT_AVAILABLE 0x01, SIGNAL_FAILURE 0x02. receiver.cpp: imu_.angular_velocity.x = -roll_rate.
TEST(SignalDeviceTest, BoschMm7SendsWhatBoschsReceiverExpects) {
  struct {
    double celsius;
    const char* code;
  } constexpr temperatures[] = {{150, "C8"}, {150.01, "C9"}, {1e6, "C9"}, {-50, "00"}, {-50.01, "FF"}, {-1e6, "FF"}};
  Sender mm7("bosch-mm7", ""), right_handed("bosch-mm7", "axes=right_handed");
  mm7.sample.rate.x() = right_handed.sample.rate.x() = 10 * units::degree;
  EXPECT_EQ(mm7.now()[1].substr(4, 4), "3078") << "-10 deg/s: 0x7830";
  EXPECT_EQ(right_handed.now()[1].substr(4, 4), "D087");
  for (const auto& [celsius, code] : temperatures) {
    mm7.sample.temperature_c = celsius;
    EXPECT_EQ(mm7.next(10ms)[0].substr(10, 2), code) << celsius;
  }
  mm7.sample.temperature_c = 20;
  mm7.sample.status = status::not_valid;
  for (const std::string& line : mm7.next(10ms)) {
    EXPECT_EQ(line.substr(8, 1), "1") << line;
    EXPECT_EQ(line.substr(16, 1), "1") << line;
  }
  mm7.sample.status |= status::gyro_saturated_x;
  EXPECT_EQ(mm7.next(10ms)[1].substr(8, 1), "3") << "both bits";
}

TEST(SignalDeviceTest, BoschMm5HasNeitherCounterNorCrc) {
  Sender mm5("bosch-mm5", "identifiers=az=0x17D");
  mm5.sample.rate.z() = 10 * units::degree;
  mm5.sample.specific_force.y() = -units::standard_gravity;
  EXPECT_EQ(mm5.now(), (Lines{"174#D08700005B610000", "178#0080000000800000", "17D#0000000000800000"}));
}

// RateOfTurn and Acceleration: cantools decodes these numbers by the vendor's xsens.dbc.
TEST(SignalDeviceTest, XsensFramesAreThoseOfTheVendorsDbc) {
  Sender xsens("xsens-can",
               "messages=sample_time,group_counter,status_word,quaternion,euler,delta_v,rate_of_turn,"
               "acceleration,free_acceleration,temperature,pressure,velocity");
  Sample& s = xsens.sample;
  s.time.ns = 123'456'700'000;
  s.counter = 0x1'2345;
  s.rate = {0.5, -0.25, 0.125};
  s.specific_force = {9.8086, 0, -9.8086};
  s.temperature_c = 25.5;
  s.pressure = 101'325;
  s.delta_velocity = {0.125, -0.0625, 0};
  s.navigation.v_L = {1, 2, -3};
  s.status = status::gyro_saturated_x << 2 | status::accelerometer_saturated_x;
  EXPECT_EQ(xsens.now(), (Lines{"005#0012D687", "006#2345", "011#00082103", "021#5A82000000005A82",
                                "022#000000002D00", "031#40002000000011", "032#01000080FFC0", "034#09CF000009CF",
                                "035#000009CF0000", "051#1980", "052#C5E68000", "076#0080004000C0"}));
  s.delta_velocity.z() = -3;  // 2^-17 m/s would be too little: the exponent falls to 13
  EXPECT_EQ(xsens.next(std::chrono::milliseconds(10))[5], "031#0400020060000D");
}

// Forward, left, up, also relative to north-east-down: roll 30 degrees and yaw 90 are -150 and 90 of the case.
TEST(SignalDeviceTest, XsensSendsTheAxesOfItsCase) {
  Sender xsens("xsens-can", "messages=quaternion_ned,euler_ned,delta_q,magnetic_field");
  Sample& s = xsens.sample;
  s.q_LP = exp(Vector3(0, 0, units::pi / 2)) * exp(Vector3(units::pi / 6, 0, 0));
  s.magnetic_field = {50e-6, 25e-6, -12.5e-6};
  s.delta_angle = {0, 0, units::pi / 2};
  EXPECT_EQ(xsens.now(),
            (Lines{"021#176DA893A893176D", "022#B50000002D00", "033#5A8200000000A57E", "041#0400FE000100"}));
}

// --- Schedule ---

constexpr CanSignal counter_signals[] = {
    {"C", 0, 16, intel_unsigned, 1, 0, alive_counter_source},
    {"V", 16, 32, {false, SignalFormat::float32}, 1, 0, "delta_velocity_x_m_per_s"},
    {"A", 48, 16, intel_signed, 0.001, 0, "delta_angle_z_rad"},
};
std::unique_ptr<Device> counting(Nanoseconds period) {
  std::vector<SignalMessage> messages;
  messages.push_back({{.id = 1}, period, CanSignalCodec(8, counter_signals)});
  return std::make_unique<SignalDevice>(std::move(messages));
}

TEST(SignalDeviceTest, IncrementsAreTheSumsSinceTheLastMessage) {
  Sender sender(counting(10ms));
  EXPECT_EQ(sender.now(), Lines{"001#0000000000000000"});
  sender.sample.delta_velocity.x() = 0.25;
  sender.sample.delta_angle.z() = 0.002;
  for (int message = 1; message < 10; ++message) {
    EXPECT_EQ(sender.next(4ms), Lines{});
    const Lines sent = message % 2 == 1 ? (sender.next(4ms), sender.next(4ms)) : sender.next(4ms);
    // At 12, 20, 32, 40 ms and so on: sums of three and of two samples.
    EXPECT_EQ(sent,
              Lines{"001#0" + std::to_string(message) + "00" + (message % 2 == 1 ? "0000403F0600" : "0000003F0400")});
  }
}

TEST(SignalDeviceTest, SkippedSamplesLeaveAGapInTheAliveCounter) {
  Sender sender(counting(10ms));
  sender.now();
  EXPECT_EQ(sender.next(10ms)[0].substr(4, 4), "0100");
  EXPECT_EQ(sender.next(30ms, 2)[0].substr(4, 4), "0400");
  EXPECT_EQ(sender.next(10ms)[0].substr(4, 4), "0500");
  // Samples that are slower than the messages leave none.
  EXPECT_EQ(sender.next(30ms)[0].substr(4, 4), "0600");
  Sender every(counting({}));
  every.now();
  EXPECT_EQ(every.next(10ms)[0].substr(4, 4), "0100");
  EXPECT_EQ(every.next(30ms, 2)[0].substr(4, 4), "0400");
}

// The counter of the samples is 13 ahead after the start, then right, then stuck, then right again. The pages of the
// multiplexor change in turn meanwhile.
TEST(SignalDeviceTest, AWrongCounterChangesTheAliveCounterAlone) {
  constexpr PageRange even[] = {{0, 0}}, odd[] = {{1, 1}};
  const CanSignal signals[] = {
      {"C", 0, 8, intel_unsigned, 1, 0, alive_counter_source},
      {"M", 8, 8, intel_unsigned},
      {"X", 16, 8, intel_signed, 1, 0, "rate_x_rad_per_s", nullptr, 0, 0, 0, even, "M"},
      {"Y", 24, 8, intel_signed, 1, 0, "rate_y_rad_per_s", nullptr, 0, 0, 0, odd, "M"},
  };
  std::vector<SignalMessage> messages;
  messages.push_back({{.id = 1}, {}, CanSignalCodec(4, signals)});
  Sender sender(std::make_unique<SignalDevice>(std::move(messages))), timed(counting(10ms));
  const auto set_error = [](Sample& sample, std::uint64_t error) {
    sample.counter += error - sample.counter_error;
    sample.counter_error = error;
  };
  const auto next = [&](std::uint64_t error) {
    set_error(sender.sample, error);
    return sender.next(10ms);
  };
  set_error(sender.sample, 13);
  EXPECT_EQ(sender.now(), Lines{"001#0D000000"});
  EXPECT_EQ(next(13), Lines{"001#0E010000"});
  EXPECT_EQ(next(0), Lines{"001#02000000"});
  EXPECT_EQ(next(~std::uint64_t{0}), Lines{"001#02010000"});
  EXPECT_EQ(next(~std::uint64_t{1}), Lines{"001#02000000"});
  EXPECT_EQ(next(0), Lines{"001#05010000"});
  set_error(timed.sample, 13);  // a message with a period counts periods
  timed.now();
  EXPECT_EQ(timed.next(10ms)[0].substr(4, 4), "0100");
  set_error(timed.sample, 0);
  EXPECT_EQ(timed.next(10ms)[0].substr(4, 4), "0200");
}

TEST(SignalDeviceTest, PowerOnRestartsPeriodsCountersAndSums) {
  Sender sender(counting(10ms));
  sender.now();
  sender.sample.delta_velocity.x() = 1;
  EXPECT_EQ(sender.next(10ms)[0].substr(4, 4), "0100");
  sender.next(7ms);
  sender.device->power_on(sender.sample.time);
  sender.sample.delta_velocity.x() = 0;
  EXPECT_EQ(sender.next(2ms), Lines{"001#0000000000000000"});
  EXPECT_EQ(sender.next(9ms), Lines{});
  EXPECT_EQ(sender.next(1ms)[0].substr(4, 4), "0100");
}

TEST(SignalDeviceTest, AStepOfTheClockChangesNoPeriod) {
  for (const Nanoseconds step : {1'000'000s, -1'000'000s}) {
    Sender sender(counting(10ms));
    sender.now();
    EXPECT_EQ(sender.next(10ms).size(), 1U);
    EXPECT_EQ(sender.next(4ms).size(), 0U);
    sender.device->step_clock(step);
    sender.sample.time = sender.sample.time + step;
    EXPECT_EQ(sender.next(4ms).size(), 0U);
    const Lines sent = sender.next(2ms);
    ASSERT_EQ(sent.size(), 1U);
    EXPECT_EQ(sent[0].substr(4, 4), "0200");
  }
}

TEST(SignalDeviceTest, RatesThatAreNoWholeNanosecondsStayInStep) {
  const Grid grid(300);
  Sender sender(counting(10ms));
  std::size_t sent = sender.now().size();
  for (std::uint64_t k = 1; k <= 30'000; ++k)
    sent += sender.next(grid.nominal_offset(k) - grid.nominal_offset(k - 1)).size();
  EXPECT_EQ(sent, 10'001U);
}

// --- Decoder ---

class MixedRates : public testing::Test {
 protected:
  // The frames of `samples` samples, of which the messages at 50 Hz come with every fourth.
  std::vector<StoredFrame> frames(int samples) {
    std::vector<Sample> all(static_cast<std::size_t>(samples));
    for (std::size_t i = 0; i < all.size(); ++i) {
      all[i].counter = i;
      all[i].time.ns = static_cast<std::int64_t>(i) * 5'000'000;
      all[i].rate.x() = 0.001 * static_cast<double>(i);
      all[i].specific_force.x() = 0.01 * static_cast<double>(i);
    }
    return line_.encode_all(all);
  }
  Line line_{protocol_named("sbg-can"),
             settings_of(protocol_named("sbg-can"), "messages=imu_info,imu_accel,imu_gyro@50,ekf_euler@50")};
  Recording got_;
};

TEST_F(MixedRates, EachSampleIsAMeasurementWithWhatItHas) {
  line_.feed(frames(9), got_);
  EXPECT_EQ(got_.measurements.size(), 9U) << "the ninth is complete, with the messages at 50 Hz";
  line_.decoder->finish(got_);
  ASSERT_EQ(got_.measurements.size(), 9U);
  for (std::size_t i = 0; i < 9; ++i) {
    const Measurement& one = got_.measurements[i];
    const std::uint32_t always = Measurement::time | Measurement::specific_force | Measurement::temperature;
    EXPECT_EQ(one.fields, always | (i % 4 == 0 ? Measurement::rate : 0U)) << i;
    EXPECT_EQ(one.sample.time.ns, static_cast<std::int64_t>(i) * 5'000'000);
    EXPECT_NEAR(one.sample.specific_force.x(), 0.01 * static_cast<double>(i), 1e-12);
    if (i % 4 == 0) {
      EXPECT_NEAR(one.sample.rate.x(), 0.001 * static_cast<double>(i), 1e-12);
    }
  }
  EXPECT_EQ(line_.decoder->errors().incomplete, 0U);
}

TEST_F(MixedRates, ASampleWithoutOneOfItsMessagesIsNone) {
  std::vector<StoredFrame> all = frames(9);  // 4 frames, then 3 times 2, and so on
  all.erase(all.begin() + 5);                // imu_accel of sample 1
  all.erase(all.begin() + 6);                // imu_info of sample 3, after imu_info and imu_accel of sample 2
  all.erase(all.begin() + 5, all.begin() + 6);
  line_.feed(all, got_);
  line_.decoder->finish(got_);
  EXPECT_LT(got_.measurements.size(), 9U);
  for (const Measurement& one : got_.measurements) {
    EXPECT_NEAR(one.sample.specific_force.x(), 2e-9 * static_cast<double>(one.sample.time.ns), 1e-9)
        << "two samples are mixed";
  }
  EXPECT_GT(line_.decoder->errors().incomplete, 0U);
}

// No message comes with every sample: the messages of the shortest period make a set.
TEST(SignalDecoderTest, ASetWithoutOneOfTheMostFrequentMessagesIsIncomplete) {
  const Protocol& sbg = protocol_named("sbg-can");
  for (std::size_t lost = 0; lost < 8; ++lost) {
    Line line(sbg, settings_of(sbg, "messages=imu_info@50,imu_accel@50,imu_gyro@50,ekf_euler@25"));
    std::vector<Sample> samples(9);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      samples[i].counter = i;
      samples[i].time.ns = static_cast<std::int64_t>(i) * 5'000'000;
    }
    std::vector<StoredFrame> frames = line.encode_all(samples);
    ASSERT_EQ(frames.size(), 4U + 3U + 4U);
    if (lost > 0) frames.erase(frames.begin() + static_cast<std::ptrdiff_t>(lost + 3));
    Recording got;
    line.feed(frames, got);
    line.decoder->finish(got);
    const bool is_seldom = lost == 7;  // ekf_euler of the last sample
    EXPECT_EQ(got.measurements.size(), lost == 0 || is_seldom ? 3U : 2U) << lost;
    EXPECT_EQ(line.decoder->errors().incomplete, lost == 0 || is_seldom ? 0U : 1U) << lost;
  }
}

TEST(SignalDecoderTest, SetsWithAnotherCounterAreNotMixed) {
  const Protocol& mm7 = protocol_named("bosch-mm7");
  Line line(mm7);
  std::mt19937_64 random(1);
  std::vector<Sample> samples(2);
  samples[1].counter = 1;
  const std::vector<StoredFrame> frames = line.encode_all(samples);
  Recording got;
  line.decoder->feed(frames[0].view(), got);  // 0x174 of the first, the others of the second
  line.decoder->feed(frames[4].view(), got);
  line.decoder->feed(frames[5].view(), got);
  line.decoder->finish(got);
  EXPECT_EQ(got.measurements.size(), 0U);
  EXPECT_EQ(line.decoder->errors().incomplete, 2U);
  line.feed(frames, got);
  EXPECT_EQ(got.measurements.size(), 2U);
}

// --- Settings ---

std::string refusal(std::string_view protocol, std::string_view settings) {
  const Protocol& entry = protocol_named(protocol);
  try {
    static_cast<void>(entry.make(settings_of(entry, settings)));
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(SignalProductTest, AFaultySettingIsRefusedWithItsRemedy) {
  EXPECT_EQ(refusal("sbg-can", "messages=imu_accel"), "");
  EXPECT_EQ(refusal("sbg-can", "messages="), "messages: list at least one message");
  EXPECT_EQ(refusal("sbg-can", "messages=imu_accel,imu_accel@50"),
            "messages: \"imu_accel@50\": the message is listed twice");
  for (const char* rate : {"imu_accel@3", "imu_accel@0", "imu_accel@-1", "imu_accel@400", "imu_accel@nan",
                           "imu_accel@1x", "imu_accel@", "imu_accel@1e-300"})
    EXPECT_EQ(refusal("sbg-can", std::string("messages=") + rate),
              std::string("messages: \"") + rate + "\": output_rate_hz must be divisible by the rate of a message");
  EXPECT_EQ(refusal("sbg-can", "messages=accel").substr(0, 63),
            "messages: unknown message \"accel\"; the messages are status_01, ");
  EXPECT_EQ(refusal("sbg-can", "identifiers=imu_accel"),
            "identifiers: \"imu_accel\": give NAME=ID, such as imu=0x123");
  EXPECT_EQ(refusal("sbg-can", "identifiers=imu_accel=x"),
            "identifiers: \"imu_accel=x\": the identifier must be a number, such as 0x123");
  EXPECT_EQ(refusal("sbg-can", "identifiers=imu_accel=0x122"), "identifiers: two messages have the identifier 290");
  EXPECT_EQ(refusal("sbg-can", "identifiers=imu_accel=0x800"),
            "identifiers: an identifier exceeds 2047; with extended = true it may be higher");
  EXPECT_EQ(refusal("sbg-can", "id_offset=0x700"),
            "id_offset: an identifier exceeds 2047; with extended = true it may be higher");
  EXPECT_EQ(refusal("sbg-can", "id_offset=0x1FFFFFFF extended=true"), "id_offset: an identifier exceeds 536870911");
  EXPECT_EQ(refusal("bosch-mm7", "identifiers=yaw_ay=0x123 id_offset=8"), "");
}

}  // namespace
}  // namespace imud
