// MIP against packets of real devices and of MicroStrain's own library.
#include <gtest/gtest.h>

#include <bit>
#include <cstring>
#include <set>
#include <string_view>

#include "core/attitude.hpp"
#include "core/units.hpp"
#include "tests/protocols/mip/mip_unit.hpp"
#include "tests/protocols/recording.hpp"
#include "tests/protocols/table_names.hpp"

namespace imud::mip_test {
namespace {

// mip_sdk e5a847d, test/data/mip_data.bin: packets of a device at offsets 10 and 84, whose third field is not part of
// a measurement.
TEST(Mip, DecodesARealDevicesPackets) {
  const auto decoder = find_protocol("mip")->make_decoder(Settings(find_protocol("mip")->settings));
  Recording recording;
  for (const char* text : {"756580300ad500000041d8bae0400ad600000000007a12000e043c8eaf72bbda6818bf7c52e80e05bb469ccf3"
                           "9a34c8bbb8be12fd771",
                           "7565800e0e063d7affd63e919fe83e79ffd6eac9",
                           "756580300ad500000041d934f2400ad600000000007a12000e043c8d232abbf0c43cbf7c5ef40e05bb5b4572b"
                           "a08e007bb9e054eeaed"}) {
    const Bytes bytes = hex(text);
    decoder->feed({std::as_bytes(std::span(bytes))}, recording);
  }
  ASSERT_EQ(recording.measurements.size(), 2U);
  EXPECT_EQ(decoder->errors().checksum + decoder->errors().malformed + decoder->errors().skipped_bytes, 0U);
  const Measurement& m = recording.measurements[0];
  EXPECT_EQ(m.fields, Measurement::time | Measurement::specific_force | Measurement::rate);
  EXPECT_EQ(m.sample.time.ns, 282'809'000'000);
  EXPECT_TRUE(
      m.sample.rate.isApprox(Vector3(-0.0030305867549031973, 0.0003114681167062372, -0.004268787335604429), 1e-15));
  EXPECT_TRUE(m.sample.specific_force.isApprox(
      units::standard_gravity * Vector3(0.01741764321923256, -0.006665240973234177, -0.9856400489807129), 1e-15));
}

// The same packet, encoded: 80:{D5, 04, 05} from the values above; D6 by hand.
TEST(Mip, EncodesThemToTheSameBytes) {
  Unit unit({{"sensor_rate_hz", std::int64_t{1000}},
             {"sensor_fields", std::vector<std::string>{"reference_time", "reference_delta", "acceleration", "rate"}},
             {"filter_fields", std::vector<std::string>{}}});
  FrameBuffer out;
  Sample s;
  s.rate = Vector3(-0.0030305867549031973, 0.0003114681167062372, -0.004268787335604429);
  s.specific_force =
      units::standard_gravity * Vector3(0.01741764321923256, -0.006665240973234177, -0.9856400489807129);
  for (const std::int64_t ns : {282'801'000'000, 282'809'000'000}) {
    s.time.ns = ns;
    out.clear();
    unit.device->sample(s, out);
  }
  const Bytes wanted = hex(
      "756580300ad500000041d8bae0400ad600000000007a12000e043c8eaf72bbda6818bf7c52e80e05bb469ccf39a34c8bbb8be12fd771");
  ASSERT_EQ(out.frames().size(), 1U);
  EXPECT_EQ(std::memcmp(out.frames()[0].bytes.data(), wanted.data(), wanted.size()), 0);
}

// The same capture, offsets 212 and 828: with magnetometer and attitude, and the filter's attitude.
TEST(Mip, EncodesFieldAndAttitudeToTheSameBytes) {
  Unit unit({{"sensor_rate_hz", std::int64_t{1000}},
             {"sensor_fields", std::vector<std::string>{"reference_time", "reference_delta", "acceleration", "rate",
                                                        "magnetic_field", "euler"}},
             {"filter_rate_hz", std::int64_t{500}},
             {"filter_fields", std::vector<std::string>{"filter_reference_time", "filter_euler"}}});
  const auto real = [](std::uint32_t bits) { return static_cast<double>(std::bit_cast<float>(bits)); };
  const auto encode = [&](std::int64_t ns, const Sample& made) {
    FrameBuffer out;
    std::vector<Bytes> all;
    for (const std::int64_t at : {ns - 8'000'000, ns}) {
      Sample s = made;
      s.time.ns = at;
      out.clear();
      unit.device->sample(s, out);
    }
    for (const Frame& frame : out.frames()) {
      Bytes bytes(frame.bytes.size());
      std::memcpy(bytes.data(), frame.bytes.data(), bytes.size());
      all.push_back(bytes);
    }
    return all;
  };
  Sample s;
  s.specific_force = units::standard_gravity * Vector3(real(0x3c896897), real(0xbbd28544), real(0xbf7c30f9));
  s.rate = {real(0xbb4aa21f), real(0x3a86a43a), real(0xbb8f0313)};
  s.magnetic_field = 1e-4 * Vector3(real(0x3d7affd6), real(0x3e919fe8), real(0x3e79ffd6));
  s.q_LP = Quaternion(dcm_from_yaw_pitch_roll(real(0xbf95119d), real(0x3cb6c513), real(0xbccc2078)).transpose());
  EXPECT_EQ(encode(282'833'000'000, s).at(0), hex("7565804c0ad500000041da2916400ad600000000007a12000e043c896897bbd285"
                                                  "44bf7c30f90e05bb4aa21f3a86a43abb8f03130e063d7affd63e"
                                                  "919fe83e79ffd60e0cbccc20783cb6c513bf95119d7ac2"));
  s.q_LP = Quaternion(dcm_from_yaw_pitch_roll(real(0xbf93b592), real(0x3c8edc20), real(0x3bdeb6ff)).transpose());
  EXPECT_EQ(encode(282'893'000'000, s).at(1),
            hex("7565821a0ad500000041ddbc9d4010053bdeb6ff3c8edc20bf93b59200014f07"));
}

// The same capture, offsets 422, 584 and 794: magnetometer and attitude alone, and with the rest.
TEST(Mip, EncodesThemAtTheirOwnRateToTheSameBytes) {
  const auto real = [](std::uint32_t bits) { return static_cast<double>(std::bit_cast<float>(bits)); };
  Sample s;
  s.magnetic_field = 1e-4 * Vector3(real(0x3d7affd6), real(0x3e913fe8), real(0x3e797fd6));
  const auto sent = [&](const std::vector<std::string>& fields, const Vector3& rpy) {
    const std::vector<std::string> none;
    Unit unit({{"sensor_rate_hz", std::int64_t{1000}}, {"sensor_fields", fields}, {"filter_fields", none}});
    unit.sample = s;
    unit.sample.q_LP = Quaternion(dcm_from_yaw_pitch_roll(rpy[2], rpy[1], rpy[0]).transpose());
    FrameBuffer out;
    for (const std::int64_t ns : {282'865'000'000, 282'873'000'000}) {
      unit.sample.time.ns = ns;
      out.clear();
      unit.device->sample(unit.sample, out);
    }
    Bytes bytes(out.frames()[0].bytes.size());
    std::memcpy(bytes.data(), out.frames()[0].bytes.data(), bytes.size());
    return bytes;
  };
  EXPECT_EQ(sent({"magnetic_field", "euler"}, {real(0xbccc2988), real(0x3cb6db9b), real(0xbf951475)}),
            hex("7565801c0e063d7affd63e913fe83e797fd60e0cbccc29883cb6db9bbf951475b05c"));
  EXPECT_EQ(sent({"magnetic_field", "euler"}, {real(0xbccc10a5), real(0x3cb6f8b8), real(0xbf951a38)}),
            hex("7565801c0e063d7affd63e913fe83e797fd60e0cbccc10a53cb6f8b8bf951a38b775"));
  s.specific_force = units::standard_gravity * Vector3(real(0x3c8c777f), real(0xbbd770fd), real(0xbf7c1415));
  s.rate = {real(0xbb6dd444), real(0x3943e8a0), real(0xbb8f1bf5)};
  EXPECT_EQ(
      sent({"reference_time", "reference_delta", "acceleration", "rate", "magnetic_field", "euler"},
           {real(0xbccc25ae), real(0x3cb6dce3), real(0xbf951762)}),
      hex("7565804c0ad500000041dc8b70400ad600000000007a12000e043c8c777fbbd770fdbf7c14150e05bb6dd4443943e8a0bb8f1bf5"
          "0e063d7affd63e913fe83e797fd60e0cbccc25ae3cb6dce3bf951762c2cb"));
}

// The same capture, offset 0: what a device answers to resume, the host's 0x01:0x06.
TEST(Mip, AnswersResumeWithTheSameBytes) {
  Unit unit;
  EXPECT_EQ(unit.send(command(0x01, 0x06)), (std::vector<Bytes>{hex("7565010404f10600da74")}));
}

// Shared fields occur in packets of any set: 0xA0 is the system's (mip_sdk e5a847d, data_system.h), and has no
// measurement.
TEST(Mip, DecodesNothingOfAnotherSet) {
  const auto decoder = find_protocol("mip")->make_decoder(Settings(find_protocol("mip")->settings));
  Recording recording;
  const Bytes other = packet(0xA0, hex("0ad500000041d8bae0400ad600000000007a1200"));
  const Bytes known = hex("7565801c0e063d7affd63e913fe83e797fd60e0cbccc29883cb6db9bbf951475b05c");
  for (const Bytes& bytes : {other, known, other}) decoder->feed({std::as_bytes(std::span(bytes))}, recording);
  const Bytes timed = packet(0x80, hex("0ad500000041d8bae040"));
  decoder->feed({std::as_bytes(std::span(timed))}, recording);
  ASSERT_EQ(recording.measurements.size(), 1U);
  EXPECT_EQ(recording.measurements[0].sample.time.ns, 282'809'000'000);
  EXPECT_EQ(decoder->errors().checksum + decoder->errors().malformed + decoder->errors().skipped_bytes, 0U);
}

// mip_sdk e5a847d, test/data/packet_example_cpp_check.txt. Its poll has the set and "no acknowledgement" in the
// opposite order of the library's function (commands_3dm.c, insert_mip_3dm_poll_data_command): set 0 has nothing to
// poll, and no NACK is sent either.
TEST(Mip, ExecutesTheLibrarysOwnCommands) {
  Unit unit;
  unit.run(10);
  EXPECT_EQ(unit.code(hex("75650c0e0e0f018003d5000a04000a05000a91ce")), 0) << "message format";
  const auto stream = unit.run(100);
  ASSERT_GE(stream.size(), 10U);
  EXPECT_EQ(field(stream[0], 0xD5).size(), 8U);
  EXPECT_TRUE(field(stream[0], 0x07).empty());
  unit.sample.specific_force = units::standard_gravity * Vector3(0.5, -1, 2);
  unit.sample.rate = {0.25, -4, 8};
  unit.run(1);
  EXPECT_TRUE(unit.send(hex("75650c08080d008003d504056446")).empty());
  const auto polled = unit.send(command(0x0C, 0x0D, {0x80, 0, 3, 0xD5, 0x04, 0x05}));
  ASSERT_EQ(polled.size(), 2U) << "poll";
  EXPECT_EQ(polled[0], packet(0x0C, {4, 0xF1, 0x0D, 0}));
  Bytes data = {10, 0xD5, 0, 0, 0, 0, 6, 0x8E, 0x77, 0x80};  // 110 ms
  const Bytes vectors =
      hex("0e043f000000bf80000040000000"
          "0e053e800000c080000041000000");
  data.insert(data.end(), vectors.begin(), vectors.end());
  EXPECT_EQ(polled[1], packet(0x80, data));
  const auto answers = unit.send(hex("7565011a0201080901010001c200080901010001c200080901010001c2007a91"));
  ASSERT_EQ(answers.size(), 1U) << "ping and three changes of speed in one packet";
  EXPECT_EQ(answers[0], packet(0x01, {4, 0xF1, 0x01, 0, 4, 0xF1, 0x09, 0, 4, 0xF1, 0x09, 0, 4, 0xF1, 0x09, 0}));
}

class MipModel : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Models, MipModel,
                         testing::Values("3dm-gx5-25", "3dm-gx5-45", "3dm-cv7-ahrs", "3dm-cv7-ins", "3dm-gq7"),
                         [](const auto& model) {
                           std::string name = model.param;
                           std::erase(name, '-');
                           return name;
                         });

TEST_P(MipModel, ReportsItsNameAndDescriptors) {
  Unit unit({{"model", std::string(GetParam())}});
  const auto info = unit.send(command(0x01, 0x03));
  ASSERT_EQ(info.size(), 1U);
  const Bytes text = field(info[0], 0x81);
  ASSERT_EQ(text.size(), 82U);
  std::string name(text.begin() + 2, text.begin() + 18);
  std::transform(name.begin(), name.end(), name.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
  EXPECT_EQ(name.substr(0, name.find(' ')), GetParam());
  // Everything in the list is answered, and nothing else.
  std::set<unsigned> known;
  for (const std::uint8_t asked : Bytes{0x04, 0x07}) {
    const Bytes list = field(unit.send(command(0x01, asked))[0], asked == 0x04 ? 0x82 : 0x86);
    for (std::size_t i = 0; i < list.size(); i += 2) EXPECT_TRUE(known.insert(list[i] * 256U + list[i + 1]).second);
  }
  for (const unsigned set : {0x01U, 0x0CU, 0x0DU, 0x0EU, 0x13U})
    for (unsigned descriptor = 1; descriptor < 0x80; ++descriptor) {
      if (set == 1 && descriptor == 0x7E) continue;
      const int code =
          unit.code(command(static_cast<std::uint8_t>(set), static_cast<std::uint8_t>(descriptor), {2, 0x80}));
      EXPECT_EQ(code == 1, !known.contains(set * 256 + descriptor)) << set << ' ' << descriptor;
    }
  // Every field in the list can be streamed alone, and no other field. The aiding summary is sent for each aid.
  const auto streams = [&](unsigned set, unsigned descriptor) {
    Unit one({{"model", std::string(GetParam())}});
    const Bytes format = {1, static_cast<std::uint8_t>(set), 1, static_cast<std::uint8_t>(descriptor), 0, 1};
    if (one.code(command(0x0C, 0x0F, format)) != 0) return false;
    const auto sent = one.run(251);
    return std::any_of(sent.begin(), sent.end(), [&](const Bytes& packet) {
      const int times = set != 0x82 || descriptor != 0x46 ? 1 : std::string_view(GetParam()) == "3dm-gq7" ? 5 : 4;
      return packet[2] == set && packet[5] == descriptor && packet.size() == 6U + packet[3] &&
             packet[3] == times * packet[4];
    });
  };
  for (const unsigned set : {0x80U, 0x81U, 0x82U, 0x91U, 0x92U, 0xA0U})
    for (unsigned descriptor = 1; descriptor < 256; ++descriptor)
      EXPECT_EQ(streams(set, descriptor), known.contains(set * 256 + descriptor)) << set << ' ' << descriptor;
}

TEST(Mip, IdleResumeAndStreamControl) {
  Unit unit;
  EXPECT_FALSE(unit.run(100).empty());
  EXPECT_EQ(unit.code(command(0x01, 0x02)), 0);
  EXPECT_TRUE(unit.run(1000).empty());
  EXPECT_EQ(unit.code(command(0x01, 0x01)), 0);
  EXPECT_EQ(unit.code(command(0x0C, 0x11, {1, 0x80, 0})), 0);
  EXPECT_EQ(unit.code(command(0x01, 0x06)), 0);
  for (const Bytes& sent : unit.run(1000)) EXPECT_EQ(sent[2], 0x82);
  EXPECT_EQ(field(unit.send(command(0x0C, 0x11, {2, 0x80}))[0], 0x85), (Bytes{0x80, 0}));
  EXPECT_EQ(unit.code(command(0x0C, 0x11, {5, 0x80})), 0);
  EXPECT_EQ(unit.run(1000).size(), 110U);
}

TEST(Mip, RatesAndFormatsAreReadSavedAndLoaded) {
  Unit unit;
  EXPECT_EQ(field(unit.send(command(0x0C, 0x06))[0], 0x83), (Bytes{0x03, 0xE8}));
  EXPECT_EQ(field(unit.send(command(0x0C, 0x0E, {0x82}))[0], 0x8E), (Bytes{0x82, 0x03, 0xE8}));
  EXPECT_EQ(unit.code(command(0x0C, 0x08, {1, 2, 0x05, 0, 4, 0x04, 0, 8})), 0);
  EXPECT_EQ(field(unit.send(command(0x0C, 0x0F, {2, 0x80}))[0], 0x8F), (Bytes{0x80, 2, 0x05, 0, 4, 0x04, 0, 8}));
  int rates = 0, forces = 0;
  for (const Bytes& sent : unit.run(1000)) {
    rates += !field(sent, 0x05).empty() && sent[2] == 0x80;
    forces += !field(sent, 0x04).empty();
  }
  EXPECT_EQ(rates, 250);
  EXPECT_EQ(forces, 125);
  EXPECT_EQ(unit.code(command(0x0C, 0x08, {3})), 0);
  EXPECT_EQ(unit.code(command(0x0C, 0x08, {5})), 0);
  EXPECT_EQ(field(unit.send(command(0x0C, 0x08, {2}))[0], 0x80)[0], 7);
  EXPECT_EQ(unit.code(command(0x0C, 0x30, {4})), 0);
  EXPECT_EQ(field(unit.send(command(0x0C, 0x08, {2}))[0], 0x80)[0], 2);
  // Wrong: an unknown field, no decimation, too short, too long, another function.
  for (const Bytes& data :
       {Bytes{1, 1, 0x33, 0, 1}, {1, 1, 0x05, 0, 0}, {1, 2, 0x05, 0, 1}, {1, 1, 0x05, 0, 1, 9}, {9}, {}})
    EXPECT_EQ(unit.code(command(0x0C, 0x08, data)), 3);
  EXPECT_EQ(field(unit.send(command(0x0C, 0x08, {2}))[0], 0x80)[0], 2);
}

TEST(Mip, SavesAndLoadsOfAllSetsAtOnce) {
  Unit unit;
  const auto formats = [&](std::uint8_t set) { return field(unit.send(command(0x0C, 0x0F, {2, set}))[0], 0x8F)[1]; };
  EXPECT_EQ(unit.code(command(0x0C, 0x0F, {1, 0x80, 1, 0x05, 0, 4})), 0);
  EXPECT_EQ(unit.code(command(0x0C, 0x0F, {1, 0x82, 0})), 0);
  EXPECT_EQ(unit.code(command(0x0C, 0x0F, {3, 0})), 0);
  EXPECT_EQ(unit.code(command(0x0C, 0x0F, {5, 0})), 0);
  EXPECT_EQ(formats(0x80), 7);
  EXPECT_EQ(formats(0x82), 3);
  EXPECT_EQ(unit.code(command(0x0C, 0x0F, {4, 0})), 0);
  EXPECT_EQ(formats(0x80), 1);
  EXPECT_EQ(formats(0x82), 0);
  EXPECT_EQ(unit.code(command(0x0C, 0x0F, {2, 0})), 3) << "one is read at a time";
  EXPECT_EQ(unit.code(command(0x0C, 0x0F, {1, 0, 0})), 3);
  EXPECT_EQ(unit.code(command(0x0C, 0x11, {1, 3, 0})), 0) << "filter, as older devices number it";
  EXPECT_EQ(unit.code(command(0x0C, 0x0F, {5, 0})), 0) << "a format's default leaves it off";
  EXPECT_EQ(field(unit.send(command(0x0C, 0x11, {2, 3}))[0], 0x85), (Bytes{3, 0}));
  EXPECT_EQ(unit.code(command(0x0C, 0x11, {5, 0})), 0);
  EXPECT_EQ(field(unit.send(command(0x0C, 0x11, {2, 0x82}))[0], 0x85), (Bytes{0x82, 1}));
}

TEST(Mip, AnswersThatFillMoreThanAPacket) {
  Unit unit;
  Bytes fields;
  for (const std::uint8_t command : Bytes{0x03, 0x03, 0x03, 0x04, 0x01}) fields.insert(fields.end(), {2, command});
  const auto answers = unit.send(packet(0x01, fields));
  std::vector<std::uint8_t> answered;
  for (const Bytes& answer : answers) {
    ASSERT_EQ(answer.size(), 6U + answer[3]);
    EXPECT_EQ(answer, packet(0x01, {answer.begin() + 4, answer.end() - 2}));
    for (std::size_t at = 4; at < answer.size() - 2; at += answer[at])
      if (answer[at + 1] == 0xF1) answered.push_back(answer[at + 2]);
  }
  EXPECT_EQ(answered, (Bytes{3, 3, 3, 4, 1}));
}

TEST(Mip, APollCanGoWithoutAcknowledgement) {
  Unit unit;
  const auto polled = unit.send(command(0x0C, 0x0D, {0x80, 1, 1, 0x05}));
  ASSERT_EQ(polled.size(), 1U);
  EXPECT_EQ(polled[0], packet(0x80, {14, 0x05, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}));
}

TEST(Mip, TheLineFollowsTheAnswer) {
  Unit unit;
  EXPECT_EQ(unit.device->uart().baud, 115200U);
  EXPECT_EQ(unit.code(command(0x0C, 0x40, {1, 0, 0x0E, 0x10, 0})), 0);  // 921600
  EXPECT_EQ(unit.device->uart().baud, 921600U);
  EXPECT_EQ(field(unit.send(command(0x0C, 0x40, {2}))[0], 0x87), (Bytes{0, 0x0E, 0x10, 0}));
  EXPECT_EQ(unit.code(command(0x01, 0x09, {1, 1, 0, 0, 0, 7})), 3) << "no such speed";
  EXPECT_EQ(unit.code(command(0x01, 0x7E)), 0);
  EXPECT_EQ(unit.device->uart().baud, 115200U) << "was not saved";
}

TEST(Mip, AttitudeAndIncrementsAreTheModels) {
  Unit unit({{"sensor_rate_hz", std::int64_t{250}},
             {"sensor_fields", std::vector<std::string>{"quaternion", "euler", "delta_angle", "delta_velocity",
                                                        "temperature", "overrange"}},
             {"filter_fields", std::vector<std::string>{"filter_quaternion", "filter_euler", "filter_status"}},
             {"filter_rate_hz", std::int64_t{250}}});
  unit.sample.q_LP = Quaternion(dcm_from_yaw_pitch_roll(1.0, -0.5, 2.0).transpose());
  unit.sample.delta_angle = {1e-3, 2e-3, -3e-3};
  unit.sample.delta_velocity = {0.01, -0.02, 0.0980665};
  unit.sample.temperature_c = 31.5;
  unit.sample.status = status::gyro_saturated_x << 2 | status::accelerometer_saturated_x << 1;
  unit.run(4);
  const auto sent = unit.run(4);
  ASSERT_EQ(sent.size(), 2U);
  for (const auto& [packet, descriptor] : {std::pair{sent[0], 0x0C}, {sent[1], 0x05}}) {
    const Bytes euler = field(packet, static_cast<std::uint8_t>(descriptor));
    EXPECT_FLOAT_EQ(number(euler, 0), 2.0F);
    EXPECT_FLOAT_EQ(number(euler, 1), -0.5F);
    EXPECT_FLOAT_EQ(number(euler, 2), 1.0F);
  }
  const Bytes q = field(sent[0], 0x0A);
  const Quaternion quaternion(number(q, 0), number(q, 1), number(q, 2), number(q, 3));
  EXPECT_TRUE((quaternion * Vector3::UnitX()).isApprox(unit.sample.q_LP * Vector3::UnitX(), 1e-6))
      << "v_ned = q v_veh q*";
  EXPECT_FLOAT_EQ(number(field(sent[0], 0x07), 2), -4 * 3e-3F);
  EXPECT_FLOAT_EQ(number(field(sent[0], 0x08), 2), 0.04F);
  EXPECT_FLOAT_EQ(number(field(sent[0], 0x14), 2), 31.5F);
  EXPECT_EQ(field(sent[0], 0x18), (Bytes{0, 0x42}));
  EXPECT_EQ(field(sent[1], 0x10), (Bytes{0, 3, 0, 1, 0, 1}));
}

// mip_sdk e5a847d, mip_parser.c, mip_parser_parse: a packet's time is counted from its first byte, by default 100 ms.
TEST(Mip, ACommandCutOffEndsThoughMoreIsSent) {
  Unit unit;
  const Bytes ping = hex("756501020201e0c6");
  const auto answers_in = [&](int milliseconds) {
    const auto sent = unit.run(milliseconds);
    return std::count(sent.begin(), sent.end(), hex("7565010404f10100d56a"));
  };
  EXPECT_EQ(unit.code(hex("756501020202e1c7")), 0) << "idle";
  EXPECT_TRUE(unit.send(hex("756501ff")).empty()) << "a packet of 261 bytes begins";
  unit.run(60);
  EXPECT_TRUE(unit.send(ping).empty()) << "is part of it so far";
  EXPECT_EQ(answers_in(39), 0);
  EXPECT_EQ(answers_in(10), 1) << "only its false start is discarded";
  for (int k = 0; k < 3; ++k) {
    unit.run(400);
    EXPECT_EQ(unit.code(ping), 0);
  }
  // A line of 9600 bit/s needs 272 ms for the longest packet.
  EXPECT_EQ(unit.code(command(0x0C, 0x40, {1, 0, 0, 0x25, 0x80})), 0);
  EXPECT_TRUE(unit.send({ping.begin(), ping.end() - 1}).empty());
  unit.run(272);
  EXPECT_EQ(unit.send({ping.back()}).size(), 1U);
}

TEST(Mip, ACommandCutOffIsDiscarded) {
  Unit unit;
  const Bytes ping = command(0x01, 0x01);
  EXPECT_TRUE(unit.send({ping.begin(), ping.begin() + 4}).empty());
  unit.run(600);
  EXPECT_EQ(unit.code(ping), 0);
  Bytes bad = ping;
  bad.back() ^= 1;
  EXPECT_TRUE(unit.send(bad).empty());
  EXPECT_EQ(unit.code(ping), 0);
}

}  // namespace
}  // namespace imud::mip_test
