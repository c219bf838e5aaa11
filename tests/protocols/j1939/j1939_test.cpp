// The messages of the J1939 unit's sensor: known bytes, scales, axes, figures of merit, rates, and the decoder.
#include <cmath>

#include "core/attitude.hpp"
#include "core/units.hpp"
#include "protocols/j1939/measured.hpp"
#include "tests/protocols/j1939/j1939_unit.hpp"

namespace imud::j1939_test {
namespace {

using units::degree;

// Known bytes were computed from the tables of SAE J1939-71 and from ACEINNA's encoder (openIMU335RI-lib 487c4fc,
// Lib/CAN_J1939/src/CANMessaging.c).
Sample known_sample() {
  Sample sample;
  sample.rate = Vector3(1, -2, 3) * degree;
  sample.specific_force = {0, 0, -units::standard_gravity};
  sample.q_LP = Quaternion(dcm_from_yaw_pitch_roll(0.3, 10 * degree, -5 * degree).transpose());
  return sample;
}

TEST(J1939Test, SendsKnownFramesInAscendingOrder) {
  Claimed unit("latency_ms=2");
  // The rates are those of no filter: bit 7 of the user behavior, which is mode 1 of ARI.
  EXPECT_EQ(unit.sample(known_sample()),
            (Texts{"08F02D80#007D007D2B798004", "0CF02980#00008200807A0004", "0CF02A80#807D007C807E4004"}));
  EXPECT_EQ(unit.give("18FF5900#8000008000FF"), Texts{"18E8FF80#00FFFFFF0059FF00"});
  EXPECT_EQ(unit.sample(known_sample()),
            (Texts{"08F02D80#007D007D2B798004", "0CF02980#00008200807A0004", "0CF02A80#807D007C807E0004"}));
}

TEST(J1939Test, SendsHighResolutionAndSlope) {
  Claimed unit("packet_types=ari_hr,accs_hr,ssi latency_ms=2");
  // 257024, 253952, 259072 = 0x3EC00, 0x3E000, 0x3F400; 256000, 256000, 248155 = 0x3E800, 0x3E800, 0x3C95B.
  const auto packed = [](std::uint64_t a, std::uint64_t b, std::uint64_t c) {
    std::string text;
    for (std::uint64_t word = a | b << 19 | c << 38; text.size() < 16; word >>= 8) {
      char byte[3];
      std::snprintf(byte, sizeof byte, "%02X", static_cast<unsigned>(word & 0xFF));
      text += byte;
    }
    return text;
  };
  // SSI: (10 + 64) * 500 = 37000 = 0x9088, (-5 + 64) * 500 = 29500 = 0x733C, (-2 + 64) * 500 = 31000 = 0x7918; the
  // firmware rounds down.
  Sample sample = known_sample();
  sample.q_LP = Quaternion(dcm_from_yaw_pitch_roll(0.3, 10.001 * degree, -4.999 * degree).transpose());
  sample.rate.y() = -1.999 * degree;
  EXPECT_EQ(unit.sample(sample), (Texts{"08FF6D80#" + packed(256000, 256000, 248155), "0CF01380#88903C7318790004",
                                        "0CFF6B80#" + packed(257024, 253953, 259072)}));
}

TEST(J1939Test, SendsTheMessagesOfTheOpenImu300) {
  Claimed unit("model=openimu300ri packet_types=ari,accs,mag,position");
  Sample sample = known_sample();
  sample.rate.x() = 1.0077 * degree;  // 32128.99: rounded down
  sample.magnetic_field = Vector3(0.2000001, -0.0999999, 0.4000001) * 1e-4;
  sample.navigation.latitude = 48 * degree;
  sample.navigation.longitude = -11 * degree;
  // Figures of merit are "not available". (0.2 G + 8 G) / 0.25 mG = 32800 = 0x8020; (48 + 210) * 1e7 = 0x99C7AD00.
  const Texts frames = unit.sample(sample);
  ASSERT_EQ(frames.size(), 4U);
  EXPECT_EQ(frames[0], "08F02D80#007D007D2B79BF00");
  EXPECT_EQ(frames[1], "0CF02A80#807D007C807E3F00");
  EXPECT_EQ(frames[2], "18FEF380#00ADC79980FD9C76");
  EXPECT_EQ(frames[3], "18FF6A80#2080707B40830000");
}

TEST(J1939Test, OrdersSlotsAndSignsAsConfigured) {
  const auto slots = [](std::string_view settings) {
    Claimed unit(std::string("packet_types=accs,ari_hr,ssi ") + std::string(settings));
    Sample sample;
    sample.specific_force = {1, 2, 3};
    sample.q_LP = Quaternion(dcm_from_yaw_pitch_roll(0, 10 * degree, 20 * degree).transpose());
    const Texts frames = unit.sample(sample);
    EXPECT_EQ(frames.size(), 3U);
    return frames[0].substr(9, 12) + " " + frames[1].substr(9, 8);
  };
  EXPECT_EQ(slots("slot_order=xyz axis_signs=ned"), "647DC87D2C7E 889010A4");
  EXPECT_EQ(slots("slot_order=j1939 axis_signs=ned"), "C87D647D2C7E 889010A4");
  EXPECT_EQ(slots("slot_order=xyz axis_signs=enu"), "647D387CD47B 786910A4");
  EXPECT_EQ(slots("slot_order=j1939 axis_signs=enu"), "387C647DD47B 786910A4");
  // The orientation word 0x0048: x, -y, -z.
  EXPECT_EQ(slots("orientation=0x48").substr(0, 12), "647D387CD47B");
}

TEST(J1939Test, ReportsMerit) {
  Claimed unit("packet_types=ssi2,ari,accs,ari_hr,accs_hr,ssi");
  const auto merits = [&](const Sample& sample) {  // bytes 6 of ACCS, SSI, SSI2, ARI and 7 of ACCS-HR, ARI-HR
    const Texts frames = unit.sample(sample);
    EXPECT_EQ(frames.size(), 6U);
    std::string text;
    for (const std::size_t i : {0U, 2U, 3U, 4U}) text += frames[i].substr(9 + 12, 2);
    for (const std::size_t i : {1U, 5U}) text += frames[i].substr(9 + 14, 2);
    return text;
  };
  EXPECT_EQ(merits({}), "800000400000");
  Sample sample;
  sample.status = status::gyro_saturated_x << 1 | status::accelerometer_saturated_x;
  EXPECT_EQ(merits(sample), "822000480410");
  sample.status = status::truth_extrapolated;
  EXPECT_EQ(merits(sample), "951544552A2A");
  sample.status = status::not_valid;
  EXPECT_EQ(merits(sample), "BF3FCC7F7E7E");
  sample = {};
  sample.rate.x() = -300 * degree;
  sample.specific_force.z() = 400;
  EXPECT_EQ(merits(sample), "A00000424104") << "the last bit of 512000 is in the same byte as a merit";
}

TEST(J1939Test, DividesTheRate) {
  for (const unsigned divider : {0U, 1U, 2U, 4U, 5U, 10U, 20U, 25U, 50U}) {
    Claimed unit("packet_types=ari packet_rate=" + std::to_string(divider));
    EXPECT_EQ(unit.run(2s).size(), divider == 0 ? 0 : 200 / divider);
  }
  EXPECT_THROW(Unit("packet_rate=3"), std::invalid_argument);
  EXPECT_THROW(Unit("packet_types=mag"), std::invalid_argument);
  EXPECT_THROW(Unit("model=openimu300ri packet_types=ari_hr"), std::invalid_argument);
  EXPECT_THROW(Unit("orientation=1"), std::invalid_argument);
}

// --- Decoder ---

struct Listener {
  explicit Listener(std::string_view settings = "")
      : decoder(protocol_named("j1939").make_decoder(settings_of(protocol_named("j1939"), settings))) {}
  // Returns the x rates, deg/s, of the measurements that the frames yield.
  std::vector<double> feed(std::string_view text) {
    Recording recording;
    each_frame(text, [&](const Frame& frame) { decoder->feed(frame, recording); });
    std::vector<double> rates;
    for (const Measurement& one : recording.measurements) rates.push_back(one.sample.rate.x() / degree);
    return rates;
  }
  std::unique_ptr<Decoder> decoder;
};

const std::string accs = "08F02D80#007D007D2B798004 ", ari_1 = "0CF02A80#807D007C807E4004 ",
                  ari_2 = "0CF02A80#007E007C807E4004 ";

TEST(J1939DecoderTest, NeverMixesSamples) {
  Listener listener;
  EXPECT_EQ(listener.feed(accs + ari_1), std::vector{1.0});
  EXPECT_EQ(listener.feed(accs), std::vector<double>{});  // its rates are lost
  EXPECT_EQ(listener.feed(accs + ari_2), std::vector{2.0});
  EXPECT_EQ(listener.decoder->errors().incomplete, 1U);
  EXPECT_EQ(listener.feed(ari_1), std::vector<double>{});  // its accelerations are lost
  EXPECT_EQ(listener.feed(accs + ari_2), std::vector{2.0});
  EXPECT_EQ(listener.decoder->errors().incomplete, 2U);
  // A unit whose rates have the higher priority sends these first.
  EXPECT_EQ(listener.feed("04F02A80#807D007C807E4004 " + accs), std::vector{1.0});
}

TEST(J1939DecoderTest, IgnoresOtherNodesAndFollowsItsUnit) {
  Listener listener;
  EXPECT_TRUE(listener.feed("08F02D90#007D007D2B798004 0CF02A90#807D007C807E4004").empty());
  EXPECT_TRUE(listener.feed("18EEFF90#" + own_name + " " + accs + ari_1).empty());
  EXPECT_EQ(listener.feed("08F02D90#007D007D2B798004 0CF02A90#807D007C807E4004"), std::vector{1.0});
}

TEST(J1939DecoderTest, RefusesNumbersThatAreNotAvailable) {
  Listener listener;
  EXPECT_TRUE(listener.feed(accs + "0CF02A80#807D007CFFFF4004").empty());
  EXPECT_TRUE(listener.feed("0CF02A80#807D007C80").empty());
  EXPECT_EQ(listener.decoder->errors().malformed, 2U);
  EXPECT_EQ(listener.feed("0CF02A80#807D007CFFFA4004").size(), 1U) << "0xFAFF is the highest valid number";
}

TEST(J1939DecoderTest, PrefersTheFinerMessages) {
  Unit unit("claim_wait_ms=0 packet_types=ari,accs,ari_hr,accs_hr");
  Sample sample;
  sample.rate.x() = 1.0003 * degree;
  std::string text;
  for (int i = 0; i < 3; ++i)
    for (const std::string& frame : unit.sample(sample)) text += frame + ' ';
  const std::vector<double> rates = Listener().feed(text);
  ASSERT_EQ(rates.size(), 3U);
  EXPECT_NEAR(rates[0], 1.0003, 0.5 / 128) << "ari_hr comes after ari";
  EXPECT_NEAR(rates[1], 1.0003, 0.5 / 1024);
  EXPECT_NEAR(rates[2], 1.0003, 0.5 / 1024);
  Listener informed("packet_types=ari_hr,accs");  // of either kind, the finer one that there is
  EXPECT_NEAR(informed.feed(text).at(0), 1.0003, 0.5 / 1024);
  EXPECT_EQ(informed.decoder->errors().incomplete, 0U);
}

}  // namespace
}  // namespace imud::j1939_test
