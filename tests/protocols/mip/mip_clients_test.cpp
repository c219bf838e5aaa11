// Dialogues of programs in the field with a MIP device, byte for byte, and what the programs need of its answers.
#include <gtest/gtest.h>

#include <array>
#include <map>

#include "core/earth/earth.hpp"
#include "core/units.hpp"
#include "tests/protocols/mip/mip_unit.hpp"

namespace imud::mip_test {
namespace {

using Names = std::vector<std::string>;

Sample flying() {
  Sample sample = over_boulder();
  sample.q_LP = Quaternion(0.8, 0, 0, 0.6);
  return sample;
}

std::vector<std::uint8_t> descriptors(const Bytes& packet) {
  std::vector<std::uint8_t> all;
  for (std::size_t at = 4; at < packet.size() - 2; at += packet[at]) all.push_back(packet[at + 1]);
  return all;
}

// --- KumarRobotics/imu_3dm_gx4 f8351ad, src/imu.cpp and src/imu_3dm_gx4.cpp ---

// The program ends at a field that is none of these (Imu::processPacket), also before it has configured anything.
bool is_known_to_gx4(const Bytes& packet) {
  const Bytes known = packet[2] == 0x80 ? Bytes{0x04, 0x05, 0x06, 0x17} : Bytes{0x03, 0x06, 0x0A, 0x0B};
  return (packet[2] == 0x80 || packet[2] == 0x82) && std::ranges::all_of(descriptors(packet), [&](std::uint8_t one) {
           return std::ranges::count(known, one) > 0;
         });
}

TEST(MipClients, Imu3dmGx4) {
  Unit unit({{"model", std::string("3dm-gx5-25")}});
  unit.sample = flying();
  const auto delivered = unit.run(1000);
  EXPECT_EQ(delivered.size(), 100U);
  for (const Bytes& packet : delivered) EXPECT_TRUE(is_known_to_gx4(packet));
  const auto answer = [&](const char* packet, std::uint8_t descriptor) {
    const auto answers = unit.send(hex(packet));
    return answers.empty() ? Bytes() : field(answers[0], descriptor);
  };
  EXPECT_EQ(unit.code(hex("756501020201e0c6")), 0) << "ping";
  EXPECT_EQ(unit.code(hex("75650c070740010001c200f8da")), 0) << "115200 bit/s";
  EXPECT_EQ(unit.code(hex("756501020201e0c6")), 0);
  const Bytes info = answer("756501020203e2c8", 0x81);
  ASSERT_EQ(info.size(), 82U);
  EXPECT_EQ(std::string(info.begin() + 18, info.begin() + 22), "6253") << "the model number in its later commands";
  EXPECT_EQ(unit.code(hex("756501020202e1c7")), 0) << "idle";
  EXPECT_EQ(answer("75650c020206f0f7", 0x83), (Bytes{0x03, 0xE8})) << "1000 Hz";
  EXPECT_EQ(unit.send(hex("75650c02020bf5fc")).at(0), packet(0x0C, {4, 0xF1, 0x0B, 0, 4, 0x8A, 0x01, 0xF4}))
      << "it reads the rate at a fixed place";
  EXPECT_EQ(unit.code(hex("75650c101008010404000a05000a06000a17000a61e7")), 0) << "IMU format, 100 Hz";
  EXPECT_EQ(unit.code(hex("75650c10100a01040300050600050a00050b00054788")), 0) << "filter format, 100 Hz";
  EXPECT_EQ(unit.code(hex("75650c050511010101041a")), 0) << "IMU stream on";
  EXPECT_EQ(unit.code(hex("75650c050511010301061e")), 0) << "filter stream on";
  EXPECT_EQ(unit.code(hex("75650d05054101000134df")), 0) << "the accelerometer aids";
  EXPECT_EQ(unit.code(hex("75650d05051401ffff0427")), 0) << "bias estimation";
  EXPECT_EQ(unit.code(hex("756501020206e5cb")), 0) << "resume";
  int imu = 0, filter = 0;
  for (const Bytes& packet : unit.run(1000)) {
    ASSERT_TRUE(is_known_to_gx4(packet));
    ++(packet[2] == 0x80 ? imu : filter);
    if (packet[2] != 0x82) continue;
    const Bytes quaternion = field(packet, 0x03), euler = field(packet, 0x0A), bias = field(packet, 0x0B);
    EXPECT_FLOAT_EQ(number(quaternion, 0), 0.8F);
    EXPECT_GT(number(euler, 2), 0) << "it squares these for a covariance";
    EXPECT_GT(number(bias, 0), 0);
    for (const Bytes& one : {euler, bias, field(packet, 0x06)}) EXPECT_EQ(one.back(), 1) << "valid";
  }
  EXPECT_EQ(imu, 100);
  EXPECT_EQ(filter, 100);
}

// Its updater polls the diagnostic structure; its layout is that of DiagnosticFields (imu.hpp). The basic one is the
// example in the manual of the 3DM-GX5-45 (8500-0064 C, p. 81).
TEST(MipClients, Imu3dmGx4ReadsTheStatus) {
  Unit unit({{"model", std::string("3dm-gx5-25")}});
  unit.run(2500);
  unit.device->pps(unit.now);
  const Bytes ping = hex("756501020201e0c6");
  EXPECT_EQ(unit.code(ping), 0);
  EXPECT_EQ(unit.code(packet(0x0C, {5, 0x11, 1, 3, 0})), 0) << "filter stream off";
  const Bytes basic = field(unit.send(hex("75650c050564186d01da83")).at(0), 0x90);
  EXPECT_EQ(basic, hex("186d0100000000000009c3")) << "model, selector, flags, system timer: 2499 ms";
  const Bytes status = field(unit.send(hex("75650c050564186d02db84")).at(0), 0x90);
  ASSERT_EQ(status.size(), 73U);
  const auto at = [&](std::size_t offset) { return number_at<std::uint32_t>(status, offset); };
  EXPECT_EQ(number_at<std::uint16_t>(status, 0), 6253);
  EXPECT_EQ(status[2], 2);
  EXPECT_EQ(at(7), 2499U) << "ms";
  EXPECT_EQ(at(11), 1U) << "pulses";
  EXPECT_EQ(at(15), 2499U) << "the last one";
  EXPECT_EQ(status[19], 1) << "IMU stream";
  EXPECT_EQ(status[20], 0) << "filter stream";
  EXPECT_EQ(at(29), 250U * 54 + 10 + 10 + 23) << "bytes written, without this answer";
  EXPECT_EQ(at(33), ping.size() + 11 + 11) << "bytes read, without this command";
  EXPECT_EQ(at(65), 2499U) << "IMU messages";
  EXPECT_EQ(at(69), 2499U) << "the last one";
  EXPECT_EQ(unit.code(command(0x0C, 0x64, {0x18, 0x6B, 2})), 3) << "another model";
  EXPECT_EQ(unit.code(command(0x0C, 0x64, {0x18, 0x6D, 3})), 3) << "another structure";
  Unit seventh;
  EXPECT_EQ(seventh.code(hex("75650c050564186d02db84")), 1);
}

// --- ArduPilot 0787455, libraries/AP_ExternalAHRS: sends nothing ---

// The arrival of packets at the end of a line, ms, by their set.
struct Arrivals {
  std::map<std::uint8_t, std::vector<double>> ends;
  std::map<std::uint8_t, Bytes> last;

  Arrivals(Unit& unit, int milliseconds, double baud) {
    double free = 0;
    for (int k = 0; k < milliseconds; ++k)
      for (const Bytes& packet : unit.run(1)) {
        free = std::max<double>(free, k) + 1e4 * static_cast<double>(packet.size()) / baud;
        ends[packet[2]].push_back(free);
        last[packet[2]] = packet;
      }
  }
  // The longest time between two packets of any of these sets; huge if there are none.
  double longest_gap(const Bytes& sets, int milliseconds) const {
    std::vector<double> all = {0};
    for (const std::uint8_t set : sets)
      if (ends.contains(set)) all.insert(all.end(), ends.at(set).begin(), ends.at(set).end());
    all.push_back(milliseconds);
    std::ranges::sort(all);
    double gap = 0;
    for (std::size_t i = 1; i < all.size(); ++i) gap = std::max(gap, all[i] - all[i - 1]);
    return gap;
  }
};

// AP_ExternalAHRS_MicroStrain7.cpp, times_healthy() and filter_healthy(): EAHRS_TYPE 7.
TEST(MipClients, ArduPilotMicroStrain7) {
  Unit unit({{"model", std::string("3dm-gq7")}});
  unit.sample = flying();
  EXPECT_EQ(unit.device->uart().baud, 115200U);
  unit.run(5000);  // as long as its constructor waits
  constexpr int milliseconds = 20'000;
  const Arrivals arrived(unit, milliseconds, 115'200);
  EXPECT_LT(arrived.longest_gap({0x80}, milliseconds), 40) << "of 44 ms";
  EXPECT_LT(arrived.longest_gap({0x82}, milliseconds), 40) << "of 44 ms";
  EXPECT_LT(arrived.longest_gap({0x91}, milliseconds), 520) << "of 550 ms";
  EXPECT_LT(arrived.longest_gap({0x92}, milliseconds), 540);
  ASSERT_EQ(arrived.last.size(), 4U);
  for (const std::uint8_t descriptor : Bytes{0x04, 0x05, 0x06, 0x17})
    EXPECT_FALSE(field(arrived.last.at(0x80), descriptor).empty()) << unsigned{descriptor};
  const Bytes filter = arrived.last.at(0x82);
  EXPECT_EQ(number_at<std::uint16_t>(field(filter, 0x10), 0), 4) << "GQ7_FULL_NAV";
  for (const std::uint8_t descriptor : Bytes{0x01, 0x02, 0x03, 0xD3})
    EXPECT_FALSE(field(filter, descriptor).empty()) << unsigned{descriptor};
  EXPECT_FLOAT_EQ(number(field(filter, 0x03), 3), 0.6F);
  for (const std::uint8_t receiver : Bytes{0x91, 0x92}) {
    const Bytes packet = arrived.last.at(receiver);
    EXPECT_EQ(field(packet, 0x0B)[0], 0) << "3D";
    EXPECT_DOUBLE_EQ(number_at<double>(field(packet, 0x03), 0), 40);
    EXPECT_GT(number_at<float>(field(packet, 0x03), 32), 0) << "accuracy";
    EXPECT_GT(number(field(packet, 0x05), 6), 0);
    EXPECT_GT(number(field(packet, 0x07), 2), 0) << "HDOP";
  }
}

// AP_ExternalAHRS_MicroStrain5.cpp, EAHRS_TYPE 2, wants IMU packets within 40 ms, others within 500 ms, and the
// attitude from 0x80/0x0A. A 3DM-GX5-45 has to be configured for it.
TEST(MipClients, ArduPilotMicroStrain5) {
  const auto arrivals = [](std::initializer_list<std::pair<std::string_view, SettingValue>> recipe) {
    Unit unit(recipe);
    unit.sample = flying();
    return Arrivals(unit, 10'000, 115'200);
  };
  const Arrivals delivered = arrivals({{"model", std::string("3dm-gx5-45")}});
  EXPECT_EQ(delivered.last.size(), 1U) << "without filter and GNSS data it is not initialised";
  const Arrivals recipe = arrivals(
      {{"model", std::string("3dm-gx5-45")},
       {"sensor_fields", Names{"acceleration", "rate", "magnetic_field", "quaternion", "pressure"}},
       {"filter_fields",
        Names{"filter_status", "filter_position", "filter_velocity", "filter_quaternion", "filter_shared_gps_time"}},
       {"filter_rate_hz", std::int64_t{25}},
       {"gnss_fields", Names{"gnss_position", "gnss_velocity", "gnss_dop", "gnss_fix", "gnss_shared_gps_time"}}});
  ASSERT_EQ(recipe.last.size(), 3U);
  EXPECT_LT(recipe.longest_gap({0x80}, 10'000), 35);
  EXPECT_LT(recipe.longest_gap({0x81}, 10'000), 300);
  EXPECT_LT(recipe.longest_gap({0x82}, 10'000), 100);
  EXPECT_FLOAT_EQ(number(field(recipe.last.at(0x80), 0x0A), 3), 0.6F);
  EXPECT_EQ(number_at<std::uint16_t>(field(recipe.last.at(0x82), 0x10), 0), 2) << "GX5_RUN_SOLUTION_VALID";
}

// The GQ7's manual, "Filter States": each state needs the conditions of the one before, and more.
TEST(MipClients, StatesOfTheFilterOfAGq7) {
  Unit unit({{"model", std::string("3dm-gq7")}});
  const auto state = [&] {
    return number_at<std::uint16_t>(field(unit.send(command(0x0C, 0x0D, {0x82, 0, 1, 0x10})).at(1), 0x10), 0);
  };
  const auto flags = [&] {
    return number_at<std::uint16_t>(field(unit.send(command(0x0C, 0x0D, {0x82, 0, 1, 0x10})).at(1), 0x10), 4);
  };
  unit.run(10'000);
  EXPECT_EQ(state(), 1) << "no pulse per second";
  EXPECT_EQ(flags(), 0x402);
  unit.sample = flying();
  unit.run(1000);
  EXPECT_EQ(state(), 1);
  EXPECT_EQ(flags(), 0x002);
  unit.run(1);
  EXPECT_EQ(state(), 2) << "vertical gyro";
  EXPECT_EQ(field(unit.send(command(0x0C, 0x0D, {0x82, 0, 2, 0x01, 0x03})).at(1), 0x01)[25], 0) << "no position yet";
  EXPECT_EQ(field(unit.send(command(0x0C, 0x0D, {0x82, 0, 2, 0x01, 0x03})).at(1), 0x03)[17], 1);
  unit.run(2000);
  EXPECT_EQ(state(), 4);
  EXPECT_EQ(flags(), 0x001);
  EXPECT_EQ(field(unit.send(command(0x0C, 0x0D, {0x82, 0, 2, 0x01, 0x03})).at(1), 0x01)[25], 1);
  const Bytes antennas = field(unit.send(command(0x0C, 0x0D, {0x82, 0, 1, 0x49})).at(1), 0x49);
  EXPECT_FLOAT_EQ(number(antennas, 1), 2 * std::asin(0.6F)) << "heading, rad";
  EXPECT_EQ(Bytes(antennas.begin() + 12, antennas.end()), (Bytes{2, 0, 7, 0, 1}));
  EXPECT_EQ(unit.code(hex("75650d020201ecf6")), 0) << "filter reset";
  unit.run(1);
  EXPECT_EQ(state(), 1);
  unit.run(4000);
  EXPECT_EQ(state(), 4);
  unit.sample.navigation.is_known = false;
  unit.run(1);
  EXPECT_EQ(state(), 2) << "its receivers have lost their fix";
  // Heading from the magnetometer.
  EXPECT_EQ(
      unit.code(hex("75650d2b2b5201000004000000000000000000000000000000000000000000000000000000000000000000000000"
                    "0296be")),
      0);
  EXPECT_EQ(state(), 3) << "AHRS";
  unit.device->power_on(unit.now);
  unit.sample = flying();
  unit.run(500);
  EXPECT_EQ(state(), 1);
}

// --- PX4 00c59fa, src/drivers/ins/microstrain/MicroStrain.cpp ---

struct Px4Call {
  const char* packet;
  const char* call;
};

// The mip_sdk calls of initializeIns() with its parameters' defaults, for a 3DM-CV7-INS.
TEST(MipClients, Px4InitializesACv7Ins) {
  Unit unit({{"model", std::string("3dm-cv7-ins")}});
  unit.sample = flying();
  unit.run(100);
  EXPECT_EQ(unit.code(hex("756501020202e1c7")), 0) << "set_idle";
  std::vector<unsigned> supported;
  for (const auto& [asked, listed] : {std::pair{"756501020204e3c9", 0x82}, {"756501020207e6cc", 0x86}}) {
    const Bytes list = field(unit.send(hex(asked)).at(0), static_cast<std::uint8_t>(listed));
    for (std::size_t i = 0; i + 1 < list.size(); i += 2) supported.push_back(list[i] * 256U + list[i + 1]);
  }
  for (const unsigned needed :
       {0x0109U, 0x0C0EU, 0x0C0FU, 0x0D50U, 0x1322U, 0x1329U, 0x8004U, 0x8005U, 0x8006U, 0x8017U, 0x80D3U,
        0x8201U, 0x8202U, 0x8203U, 0x8208U, 0x8209U, 0x820AU, 0x820DU, 0x820EU, 0x8210U, 0x82D3U})
    EXPECT_EQ(std::ranges::count(supported, needed), 1) << std::hex << needed;
  EXPECT_EQ(unit.code(hex("7565010808090101000e100014f9")), 0) << "write_comm_speed(1, 921600)";
  EXPECT_EQ(unit.device->uart().baud, 921600U);
  const Px4Call calls[] = {
      {"756501020202e1c7", "set_idle"},
      {"75650c03030e807a7e", "get_base_rate(sensor)"},
      {"75650c14140f018005040002050002060014170014d30002ca03", "write_message_format(sensor)"},
      {"75650c03030e827c80", "get_base_rate(filter)"},
      {"75650c23230f01820a0100040300040200040d00040800040900040a00040e0004100004d300040fb1",
       "write_message_format(filter)"},
      {"75650d060650010004014972", "write_aiding_measurement_enable(magnetometer, true)"},
      {"75650d060650010007004b77", "(external magnetometer, false)"},
      {"75650d060650010008004c79", "(body frame velocity, false)"},
      {"75650d060650010005004973", "(external heading, false)"},
      {"75650d06065001000001456a", "(GNSS position and velocity, true)"},
      {"7565131e1e01010101000000000000000000000000000000000000000000000000002d83", "aiding_write_frame_config"},
      {"75650d2b2b5201000004000000000000000000000000000000000000000000000000000000000000000000000000"
       "0296be",
       "write_initialization_configuration"},
      {"75650c0f0f31010000000000000000000000003621", "write_sensor_2_vehicle_transform_euler"},
      {"75650d020201ecf6", "filter_reset"},
      {"75650c0505110100010318", "write_datastream_control(all, true)"},
      {"756501020206e5cb", "resume"}};
  for (const Px4Call& call : calls) EXPECT_EQ(unit.code(hex(call.packet)), 0) << call.call;
  for (const char* receiver : {"75650c03030e918b8f", "75650c03030e928c90"})
    EXPECT_EQ(unit.code(hex(receiver)), 3) << "it has none; the driver goes on";
  std::map<std::uint8_t, int> count;
  Bytes filter;
  for (const Bytes& packet : unit.run(1000)) {
    ++count[packet[2]];
    if (packet[2] == 0x82) filter = packet;
  }
  EXPECT_EQ(count, (std::map<std::uint8_t, int>{{0x80, 500}, {0x82, 250}}));
  EXPECT_EQ(descriptors(filter), (Bytes{0x01, 0x03, 0x02, 0x0D, 0x08, 0x09, 0x0A, 0x0E, 0x10, 0xD3}));
  EXPECT_EQ(number_at<std::uint16_t>(field(filter, 0x10), 0), 4) << "MIP_FILTER_MODE_FULL_NAV";
  for (const std::uint8_t uncertainty : Bytes{0x08, 0x09, 0x0A}) {
    EXPECT_GT(number(field(filter, uncertainty), 0), 0) << "it publishes these as eph, epv and variances";
    EXPECT_EQ(field(filter, uncertainty).back(), 1);
  }
}

// A device without GNSS refuses it as an aiding source; the driver takes this NACK as the "AR and AHRS edge case".
TEST(MipClients, Px4FindsThatAnAhrsIsNotAidedByGnss) {
  Unit unit({{"model", std::string("3dm-cv7-ahrs")}});
  EXPECT_EQ(unit.code(hex("75650d060650010004014972")), 0) << "magnetometer";
  EXPECT_EQ(unit.code(hex("75650d06065001000001456a")), 3);
  EXPECT_EQ(unit.code(hex("75650c0505110100010318")), 0);
}

// Where two receivers are, it asks each for these, and the filter for the dual-antenna status, too.
TEST(MipClients, Px4ConfiguresTwoReceivers) {
  Unit unit({{"model", std::string("3dm-gq7")}});
  unit.sample = flying();
  EXPECT_EQ(unit.send(hex("75650c03030e918b8f")).at(0), packet(0x0C, {4, 0xF1, 0x0E, 0, 5, 0x8E, 0x91, 0, 2}))
      << "2 Hz, as its manual says";
  const Px4Call calls[] = {
      {"75650c26260f01820b0100040300040200040d00040800040900040a00040e0004100004490004d300046328",
       "write_message_format(filter)"},
      {"75650c17170f019106030001070001050001d300011100010b0001bf23", "write_message_format(GNSS 1)"},
      {"75650c17170f019206030001070001050001d300011100010b0001c037", "write_message_format(GNSS 2)"},
      {"75650d0404150101061f", "write_gnss_source(all internal)"},
      {"75650d10105401013f80000000000000bf8000005b94", "write_multi_antenna_offset(1)"},
      {"75650d1010540102bf80000000000000bf800000dca1", "write_multi_antenna_offset(2)"},
      {"75650d06065001000101466c", "write_aiding_measurement_enable(GNSS heading, true)"}};
  for (const Px4Call& call : calls) EXPECT_EQ(unit.code(hex(call.packet)), 0) << call.call;
  std::map<std::uint8_t, int> count;
  for (const Bytes& packet : unit.run(1000)) {
    ++count[packet[2]];
    if (packet[2] < 0x91) continue;
    EXPECT_EQ(descriptors(packet), (Bytes{0x03, 0x07, 0x05, 0xD3, 0x11, 0x0B}));
    EXPECT_EQ(field(packet, 0x11), (Bytes{18, 0, 2}));
  }
  EXPECT_EQ(count[0x91], 2);
  EXPECT_EQ(count[0x92], 2);
  EXPECT_EQ(count[0x82], 250);
}

}  // namespace
}  // namespace imud::mip_test
