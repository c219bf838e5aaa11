// The settings of a MIP device. The packets in hex are those that mip_sdk e5a847d writes for the calls beside them.
#include <gtest/gtest.h>

#include <limits>

#include "core/attitude.hpp"
#include "core/units.hpp"
#include "tests/protocols/mip/mip_unit.hpp"

namespace imud::mip_test {
namespace {

Unit unit_of(const char* model) { return Unit({{"model", std::string(model)}}); }

// The only packet of set 0x80 of the next sample, which holds these fields.
Bytes next_of(Unit& unit, std::vector<std::uint8_t> descriptors) {
  Bytes format = {1, 0x80, static_cast<std::uint8_t>(descriptors.size())};
  for (const std::uint8_t descriptor : descriptors) format.insert(format.end(), {descriptor, 0, 1});
  EXPECT_EQ(unit.code(command(0x0C, 0x0F, format)), 0);
  for (const Bytes& packet : unit.run(1))
    if (packet[2] == 0x80) return packet;
  return {};
}
Vector3 vector_of(const Bytes& data) { return {number(data, 0), number(data, 1), number(data, 2)}; }

struct Call {
  const char* model;
  const char* packet;
  const char* call;
};
const Call executed[] = {
    {"3dm-gx5-25", "75650c0f0f37013c23d70abca3d70a3cf5c28f3ef9", "3dm_write_accel_bias"},
    {"3dm-gx5-25", "75650c0f0f38013c23d70abca3d70a3cf5c28f3f07", "3dm_write_gyro_bias"},
    {"3dm-gx5-25", "75650c030338022654", "3dm_read_gyro_bias"},
    {"3dm-gx5-25", "75650c030338032755", "3dm_save_gyro_bias"},
    {"3dm-gx5-25", "75650c030338042856", "3dm_load_gyro_bias"},
    {"3dm-gx5-25", "75650c030338052957", "3dm_default_gyro_bias"},
    {"3dm-gx5-25", "75650c04043e01012e94", "3dm_write_coning_sculling_enable"},
    {"3dm-gx5-25", "75650c0f0f3a013c23d70abca3d70a3cf5c28f4123", "3dm_write_mag_hard_iron_offset"},
    {"3dm-cv7-ahrs", "75650c131332013f3504f300000000000000003f3504f315d7",
     "3dm_write_sensor_2_vehicle_transform_quaternion"},
    {"3dm-cv7-ahrs", "75650c04042b03001c5e", "3dm_save_event_control(0)"},
    {"3dm-gx5-25", "75650d020201ecf6", "filter_reset"},
    {"3dm-cv7-ins", "75650d020205f0fa", "filter_run"},
    {"3dm-gx5-25", "75650d0e0e023f800000400000004040000084a3", "filter_set_initial_attitude"},
    {"3dm-gx5-25", "75650d0606033f800000b560", "filter_set_initial_heading"},
    {"3dm-gx5-25", "75650d0b0b173f8000003dcccccd017684", "filter_external_heading_update"},
    {"3dm-gx5-45",
     "75650d4848163ff000000000000000024008000000000000401000000000000040140000000000003c23d70abca3d70a3cf5c28f3c23d70"
     "abca3d7"
     "0a3cf5c28f3c23d70abca3d70a3cf5c28fb093",
     "filter_external_gnss_update"},
    {"3dm-cv7-ahrs", "75650d05055003ffff421d", "filter_save_aiding_measurement_enable(all)"},
    {"3dm-cv7-ins", "75651317173103010000000005f5e10001000000003a83126f00016be0", "aiding_heading_true"},
    {"3dm-cv7-ins", "75651317172303010000000005f5e100013f8000003f80000000019d1c", "aiding_height_above_ellipsoid"},
    {"3dm-cv7-ins", "75651317173303010000000005f5e10001447d40003f8000000001ef93", "aiding_pressure"},
    {"3dm-cv7-ins", "75651327272a03010000000005f5e100033c23d70abca3d70a3cf5c28f3c23d70abca3d70a3cf5c28f0007526a",
     "aiding_vel_body_frame"},
    {"3dm-cv7-ins",
     "75651333332203010000000005f5e100024046000000000000c052400000000000405e8000000000003c23d70abca3d70a3cf5c28f00075"
     "5d9",
     "aiding_pos_llh"},
};

TEST(MipSettings, ExecutesTheLibrarysCalls) {
  for (const Call& call : executed) EXPECT_EQ(unit_of(call.model).code(hex(call.packet)), 0) << call.call;
}

const Call kept[] = {
    {"3dm-gx5-25", "75650c27273b01000000003f80000000000000bf800000000000000000000000000000000000003f8000002d59",
     "3dm_write_mag_soft_iron_matrix"},
    {"3dm-cv7-ahrs", "75650c19192e010102820501013fe8000000000000bfe8000000000000a1b5", "3dm_write_event_trigger"},
    {"3dm-cv7-ahrs", "75650c0b0b2f0102010282000001d08458", "3dm_write_event_action"},
    {"3dm-cv7-ahrs", "75650c05052b0101011e82", "3dm_write_event_control"},
    {"3dm-gx5-25", "75650d04041801040c2b", "filter_write_heading_source"},
    {"3dm-gx5-25", "75650d0505140100070d31", "filter_write_estimation_control"},
    {"3dm-gx5-25", "75650d08084301033dcccccde084", "filter_write_magnetic_declination_source"},
    {"3dm-gx5-25", "75650d040447010138b5", "filter_write_altitude_aiding"},
    {"3dm-gx5-25", "75650d04044b01013cc1", "filter_write_pitch_roll_aiding"},
    {"3dm-gx5-25", "75650d1c1c2601013ff000000000000040000000000000004008000000000000fe82",
     "filter_write_reference_position"},
    {"3dm-gx5-45", "75650d0f0f13013c23d70abca3d70a3cf5c28f1b12", "filter_write_antenna_offset"},
    {"3dm-gx5-45", "75650d04041001030312", "filter_write_vehicle_dynamics_mode"},
    {"3dm-gx5-45", "75650d08081e01013dcccccdb977", "filter_write_auto_zupt"},
    {"3dm-gx5-45", "75650d08082001013dcccccdbb85", "filter_write_auto_angular_zupt"},
    {"3dm-cv7-ins",
     "75650d2b2b520100000a3f80000040000000404000003c23d70abca3d70a3cf5c28f3c23d70abca3d70a3cf5c28f021f61",
     "filter_write_initialization_configuration"},
    {"3dm-cv7-ins", "7565131e1e01010301013c23d70abca3d70a3cf5c28f00000000000000003fc0000031aa",
     "aiding_write_frame_config"},
};
std::size_t key_size(const Bytes& write) {
  const bool has_key = (write[2] == 0x0C && write[5] >= 0x2B && write[5] <= 0x2F) || write[2] == 0x13;
  return has_key ? 1 : 0;
}

TEST(MipSettings, AreReadSavedAndRestored) {
  for (const Call& call : kept) {
    SCOPED_TRACE(call.call);
    Unit unit = unit_of(call.model);
    const Bytes write = hex(call.packet), value(write.begin() + 7, write.end() - 2);
    const auto with = [&](std::uint8_t function) {
      Bytes data(value.begin(), value.begin() + static_cast<std::ptrdiff_t>(key_size(write)));
      data.insert(data.begin(), function);
      return command(write[2], write[5], data);
    };
    const auto read = [&] {
      const Bytes answer = unit.send(with(2)).at(0);
      EXPECT_EQ(answer[7], 0);
      return Bytes(answer.begin() + 10, answer.end() - 2);
    };
    const Bytes initial = read();
    ASSERT_NE(initial, value);
    EXPECT_EQ(unit.code(write), 0);
    EXPECT_EQ(read(), value);
    EXPECT_EQ(unit.code(with(4)), 0);
    EXPECT_EQ(read(), initial) << "was not saved";
    EXPECT_EQ(unit.code(write), 0);
    EXPECT_EQ(unit.code(with(3)), 0);
    EXPECT_EQ(unit.code(with(5)), 0);
    EXPECT_EQ(read(), initial) << "default";
    EXPECT_EQ(unit.code(command(0x01, 0x7E)), 0);
    EXPECT_EQ(read(), value) << "was saved";
    EXPECT_EQ(unit.code(command(0x0C, 0x30, {5})), 0);
    EXPECT_EQ(read(), initial) << "all to default";
    EXPECT_EQ(unit.code(with(9)), 3) << "no such function";
    Bytes longer(write.begin() + 6, write.end() - 2);
    longer.resize(64);
    EXPECT_EQ(unit.code(command(write[2], write[5], longer)), 3) << "too long";
    EXPECT_EQ(unit.code(command(write[2], write[5], {1, 1})), value.size() == 1 ? 0 : 3) << "too short";
    EXPECT_EQ(unit.code(command(write[2], write[5])), 3);
  }
}

TEST(MipSettings, KeysChooseOneOfSeveral) {
  Unit unit = unit_of("3dm-cv7-ins");
  const auto source = [&](std::uint8_t key) {
    return field(unit.send(command(0x0D, 0x50, {2, 0, key})).at(0), 0xD0);
  };
  EXPECT_EQ(unit.code(command(0x0D, 0x50, {1, 0, 5, 0})), 0);
  EXPECT_EQ(source(5), (Bytes{0, 5, 0}));
  EXPECT_EQ(source(4), (Bytes{0, 4, 1}));
  EXPECT_EQ(unit.code(command(0x0D, 0x50, {5, 0xFF, 0xFF})), 0);
  EXPECT_EQ(source(5), (Bytes{0, 5, 1}));
  EXPECT_EQ(unit.code(command(0x0D, 0x50, {1, 0, 9, 0})), 3) << "no such source";
  EXPECT_EQ(unit.code(command(0x0D, 0x50, {2, 0xFF, 0xFF})), 3) << "one at a time is read";
  // mip_aiding_read_frame_config sends the form of rotation that it requests.
  EXPECT_EQ(unit.code(hex("756513050501020301fe12")), 0);
  EXPECT_EQ(unit.code(command(0x13, 0x01, {2, 5})), 3) << "four frames";
  EXPECT_EQ(unit.code(command(0x0C, 0x2B, {1, 0, 1})), 3) << "event 0 stands for all, to save, load and default";
  EXPECT_EQ(unit.code(command(0x0C, 0x2B, {4, 0})), 0);
}

TEST(MipSettings, DynamicsModeIsReported) {
  Unit unit = unit_of("3dm-gx5-45");
  EXPECT_EQ(unit.code(hex("75650d04041001030312")), 0);
  EXPECT_EQ(field(unit.send(command(0x0C, 0x0D, {0x82, 0, 1, 0x10})).at(1), 0x10)[3], 3);
}

TEST(MipSettings, CapturesTheGyroBias) {
  Unit unit;
  unit.sample.rate = {0.25, -0.5, 0.125};
  unit.sample.delta_angle = unit.sample.rate / 1000;
  unit.run(1);
  EXPECT_TRUE(unit.send(hex("75650c04043903e81270")).empty())
      << "capture_gyro_bias(1000) is answered when it is done";
  EXPECT_EQ(unit.code(command(0x01, 0x01)), 0) << "others are answered meanwhile";
  EXPECT_EQ(unit.code(command(0x0C, 0x39, {0x03, 0xE8})), 4) << "but not another capture";
  for (const Bytes& packet : unit.run(500)) EXPECT_NE(packet[2], 0x0C);
  unit.sample.rate = {0.75, -0.5, 0.125};
  for (const Bytes& packet : unit.run(499)) EXPECT_NE(packet[2], 0x0C);
  const auto last = unit.run(1);
  ASSERT_FALSE(last.empty());
  Bytes answer = {4, 0xF1, 0x39, 0, 14, 0x9B};
  for (const char* number : {"3f000000", "bf000000", "3e000000"})
    for (const std::uint8_t byte : hex(number)) answer.push_back(byte);
  EXPECT_EQ(last.back(), packet(0x0C, answer)) << "the mean";
  next_of(unit, {0x07});
  const Bytes now = next_of(unit, {0x05, 0x07});
  EXPECT_TRUE(vector_of(field(now, 0x05)).isApprox(Vector3(0.25, 0, 0)));
  EXPECT_TRUE(vector_of(field(now, 0x07)).isApprox(Vector3(-0.25e-3, 0, 0), 1e-6));
  EXPECT_EQ(vector_of(field(unit.send(command(0x0C, 0x38, {2})).at(0), 0x9B)), Vector3(0.5, -0.5, 0.125));
  // The bias is in volatile memory only; a second capture is not affected by the first.
  EXPECT_EQ(unit.code(command(0x01, 0x7E)), 0);
  EXPECT_EQ(vector_of(field(unit.send(command(0x0C, 0x38, {2})).at(0), 0x9B)), Vector3::Zero());
  for (const Bytes& wrong : {Bytes{0x03, 0xE7}, {0x75, 0x31}, {0x03}, {0x03, 0xE8, 0}})  // 999 ms, 30 001 ms
    EXPECT_EQ(unit.code(command(0x0C, 0x39, wrong)), 3);
}

TEST(MipSettings, ACaptureEndsWithAReset) {
  Unit unit;
  EXPECT_TRUE(unit.send(hex("75650c04043903e81270")).empty());
  EXPECT_EQ(unit.code(command(0x01, 0x7E)), 0);
  for (const Bytes& packet : unit.run(2000)) EXPECT_NE(packet[2], 0x0C);
}

TEST(MipSettings, BiasesAreSubtracted) {
  Unit unit;
  EXPECT_EQ(unit.code(hex("75650c0f0f37013c23d70abca3d70a3cf5c28f3ef9")), 0);  // 0.01, -0.02, 0.03 g
  EXPECT_EQ(unit.code(hex("75650c0f0f38013c23d70abca3d70a3cf5c28f3f07")), 0);  // rad/s
  EXPECT_EQ(field(unit.send(command(0x0C, 0x37, {2})).at(0), 0x9A), hex("3c23d70abca3d70a3cf5c28f"));
  next_of(unit, {0x07, 0x08});
  const Bytes now = next_of(unit, {0x04, 0x05, 0x07, 0x08});
  const Vector3 bias(0.01, -0.02, 0.03);
  EXPECT_TRUE(vector_of(field(now, 0x04)).isApprox(-bias, 1e-6)) << "g";
  EXPECT_TRUE(vector_of(field(now, 0x05)).isApprox(-bias, 1e-6));
  EXPECT_TRUE(vector_of(field(now, 0x07)).isApprox(-bias / 1000, 1e-6));
  EXPECT_TRUE(vector_of(field(now, 0x08)).isApprox(-bias / 1000, 1e-6)) << "g s";
  EXPECT_EQ(unit.code(hex("75650c030338032755")), 0) << "save";
  EXPECT_EQ(unit.code(command(0x0C, 0x30, {4})), 0);
  EXPECT_TRUE(vector_of(field(next_of(unit, {0x05}), 0x05)).isApprox(-bias, 1e-6)) << "was saved";
  EXPECT_TRUE(vector_of(field(next_of(unit, {0x04}), 0x04)).isZero(0)) << "was not";
  EXPECT_EQ(unit.code(hex("75650c030338052957")), 0) << "default";
  EXPECT_TRUE(vector_of(field(next_of(unit, {0x05}), 0x05)).isZero(0));
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    std::uint8_t bits[4];
    std::memcpy(bits, &bad, 4);
    EXPECT_EQ(unit.code(command(0x0C, 0x38, {1, 0, 0, 0, 0, bits[3], bits[2], bits[1], bits[0], 0, 0, 0, 0})), 3);
  }
}

// The offset is subtracted first, and the matrix is by rows.
TEST(MipSettings, HardAndSoftIron) {
  Unit unit = unit_of("3dm-gx5-25");
  unit.sample.magnetic_field = 1e-4 * Vector3(1, 2, 3);
  const auto floats = [](std::initializer_list<float> values) {
    Bytes data = {1};
    for (const float value : values) {
      std::uint32_t bits = 0;
      std::memcpy(&bits, &value, sizeof bits);
      for (int shift = 24; shift >= 0; shift -= 8) data.push_back(static_cast<std::uint8_t>(bits >> shift));
    }
    return data;
  };
  EXPECT_EQ(unit.code(command(0x0C, 0x3A, floats({0.5F, 0, 0}))), 0);
  EXPECT_TRUE(vector_of(field(next_of(unit, {0x06}), 0x06)).isApprox(Vector3(0.5, 2, 3), 1e-6));
  EXPECT_EQ(unit.code(command(0x0C, 0x3B, floats({0, 2, 0, 1, 0, 0, 0, 0, 1}))), 0);
  EXPECT_TRUE(vector_of(field(next_of(unit, {0x06}), 0x06)).isApprox(Vector3(4, 0.5, 3), 1e-6));
  EXPECT_EQ(unit.code(command(0x0C, 0x3A, {5})), 0) << "default";
  EXPECT_TRUE(vector_of(field(next_of(unit, {0x06}), 0x06)).isApprox(Vector3(4, 1, 3), 1e-6));
}

// Four forms of one mounting: the vehicle's x is the sensor's y, v_V = (v_y, -v_x, v_z).
TEST(MipSettings, SensorToVehicle) {
  const auto check = [](Unit& unit) {
    unit.sample.rate = unit.sample.specific_force = unit.sample.magnetic_field = {1, 2, 3};
    unit.sample.specific_force *= units::standard_gravity;
    unit.sample.magnetic_field *= 1e-4;
    unit.sample.delta_angle = unit.sample.delta_velocity = {1, 2, 3};
    unit.sample.q_LP = Quaternion(dcm_from_yaw_pitch_roll(0.5, 0, 0).transpose());
    next_of(unit, {0x07, 0x08});
    const Bytes now = next_of(unit, {0x04, 0x05, 0x06, 0x07, 0x08, 0x0C});
    for (const std::uint8_t descriptor : Bytes{0x04, 0x05, 0x06, 0x07})
      EXPECT_TRUE(vector_of(field(now, descriptor)).isApprox(Vector3(2, -1, 3), 1e-6)) << unsigned{descriptor};
    EXPECT_TRUE(vector_of(field(now, 0x0C)).isApprox(Vector3(0, 0, 0.5 + units::pi / 2), 1e-6))
        << "heading of the vehicle";
  };
  Unit gx5 = unit_of("3dm-gx5-25");  // by 90 deg about z the sensor's axes turn into the vehicle's
  EXPECT_EQ(gx5.code(hex("75650d0f0f110100000000000000003fc90fda08c1")), 0);
  check(gx5);
  EXPECT_EQ(field(gx5.send(command(0x0D, 0x11, {2})).at(0), 0x81).size(), 12U);
  EXPECT_NEAR(number(field(gx5.send(command(0x0D, 0x11, {2})).at(0), 0x81), 2), units::pi / 2, 1e-6);

  Unit by_matrix = unit_of("3dm-cv7-ahrs");
  const char* write_dcm =
      "75650c27273301000000003f80000000000000bf800000000000000000000000000000000000003f8000002529";
  EXPECT_EQ(by_matrix.code(hex(write_dcm)), 0);
  check(by_matrix);
  const Bytes matrix = field(by_matrix.send(command(0x0C, 0x33, {2})).at(0), 0xB3);
  EXPECT_NEAR(number(matrix, 1), 1, 1e-6);
  EXPECT_NEAR(number(matrix, 3), -1, 1e-6);
  const Bytes quaternion = field(by_matrix.send(command(0x0C, 0x32, {2})).at(0), 0xB2);
  EXPECT_NEAR(number(quaternion, 0), std::sqrt(0.5), 1e-6);
  EXPECT_NEAR(number(quaternion, 3), std::sqrt(0.5), 1e-6);
  const Bytes euler = field(by_matrix.send(command(0x0C, 0x31, {2})).at(0), 0xB1);
  EXPECT_NEAR(number(euler, 2), -units::pi / 2, 1e-6) << "the inverse of 0D:11";

  Unit by_quaternion = unit_of("3dm-cv7-ahrs");
  EXPECT_EQ(by_quaternion.code(hex("75650c131332013f3504f300000000000000003f3504f315d7")), 0);
  check(by_quaternion);

  Unit by_euler = unit_of("3dm-cv7-ahrs");
  EXPECT_EQ(by_euler.code(command(0x0C, 0x31, {1, 0, 0, 0, 0, 0, 0, 0, 0, 0xBF, 0xC9, 0x0F, 0xDA})), 0);
  check(by_euler);
  EXPECT_EQ(by_euler.code(command(0x0C, 0x31, {3})), 0);
  EXPECT_EQ(by_euler.code(command(0x0C, 0x31, {5})), 0);
  EXPECT_EQ(field(by_euler.send(command(0x0C, 0x31, {2})).at(0), 0xB1), Bytes(12));
  EXPECT_EQ(by_euler.code(command(0x01, 0x7E)), 0);
  check(by_euler);

  Bytes no_rotation(37), no_unit(17);
  no_rotation[0] = no_unit[0] = 1;
  EXPECT_EQ(by_euler.code(command(0x0C, 0x33, no_rotation)), 3);
  EXPECT_EQ(by_euler.code(command(0x0C, 0x32, no_unit)), 3);
}

TEST(MipSettings, GpsTimeUpdate) {
  Unit unit;
  unit.run(1500);  // the newest sample is that of 1.499 s
  EXPECT_EQ(unit.code(hex("756501080872010100000968d008")), 0) << "mip_base_write_gps_time_update(week 2408)";
  Bytes time = field(next_of(unit, {0x12}), 0x12);
  EXPECT_DOUBLE_EQ(number_at<double>(time, 0), 1.5);
  EXPECT_EQ(number_at<std::uint16_t>(time, 8), 2408);
  EXPECT_EQ(number_at<std::uint16_t>(time, 10), 0x16) << "updated once, set, week valid";
  EXPECT_EQ(unit.code(command(0x01, 0x72, {1, 2, 0, 4, 0x3C, 0x51})), 0) << "second 277585, at 1.500 s";
  unit.run(499);
  time = field(next_of(unit, {0xD3}), 0xD3);
  EXPECT_DOUBLE_EQ(number_at<double>(time, 0), 277585.5);
  EXPECT_EQ(number_at<std::uint16_t>(time, 8), 2408);
  EXPECT_EQ(number_at<std::uint16_t>(time, 10), 3);
  for (const Bytes& wrong : {Bytes{1, 2, 0, 9, 0x3A, 0x80},
                             {1, 1, 0xFF, 0xFF, 0xFF, 0xFF},
                             {1, 3, 0, 0, 0, 0},
                             {2, 1, 0, 0, 0, 0},
                             {1, 1}})
    EXPECT_EQ(unit.code(command(0x01, 0x72, wrong)), 3);
  EXPECT_EQ(unit.code(command(0x01, 0x7E)), 0);
  EXPECT_EQ(number_at<std::uint16_t>(field(next_of(unit, {0xD3}), 0xD3), 10), 0) << "forgotten";
}

}  // namespace
}  // namespace imud::mip_test
