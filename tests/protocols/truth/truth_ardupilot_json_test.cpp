// The flight stack's side of ArduPilot's JSON interface: servo packets, answers, repetitions, pace.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/units.hpp"
#include "tests/support/decode_truth.hpp"

namespace imud {
namespace {

// As libraries/SITL/examples/JSON/pybullet/robot.py of ArduPilot writes it: "\n" + json.dumps(...) + "\n".
std::string answer_at(double time_s, const std::string& attitude = R"("attitude": [0.1, -0.2, 3.0])") {
  return "\n{\"timestamp\": " + std::to_string(time_s) +
         R"(, "imu": {"gyro": [0.01, 0.02, 0.03], "accel_body": [0.1, 0.2, -9.8]}, "position": [1.0, 2.0, -3.0], )" +
         attitude + R"(, "velocity": [4.0, 5.0, -6.0], "rng_1": 3.5, "no_time_sync": 1})" + "\n";
}

// libraries/SITL/examples/JSON/python/velocity_controlled_robot.py of ArduPilot at b6f464f: its Vehicle(tau=0.2)
// after 100 steps of 1/400 s with the pulse widths 1750, 1500, 1625.
constexpr std::string_view robots_answer =
    "\n{\"timestamp\": 0.25000000000000017, \"imu\": {\"gyro\": [0.0, 0.0, 0.10736152249573322], \"accel_body\": "
    "[0.8095913450177239, 0.043224361922256836, -9.80665]}, \"position\": [0.06110761012628982, "
    "0.0005039814762246597, 0.0], \"attitude\": [0.0, 0.0, 0.016296099307094636], \"velocity\": "
    "[0.4025522519817089, 0.006560612236504011, 0.0]}\n";
// SendState() of libraries/SITL/examples/JSON/C++/libAP_JSON.cpp at 0cd281b: time 1700000000.123456, gyro .01 -.02
// .03, accelerometer .1 .2 -9.8, position 1 2 -3, roll .1, pitch -.2, yaw 3, velocity 4 5 -6, and all options.
constexpr std::string_view libraries_answer =
    "\n{\"timestamp\":1700000000.123456,\"imu\":{\"gyro\":[0.010000,-0.020000,0.030000],\"accel_body\":[0.100000,"
    "0.200000,-9.800000]},\"position\":[1.000000,2.000000,-3.000000],\"attitude\":[0.100000,-0.200000,3.000000],"
    "\"velocity\":[4.000000,5.000000,-6.000000],\"airspeed\":1.000000,\"windvane\":{\"direction\":1.000000,"
    "\"speed\":1.000000},\"rng_1\":1.000000,\"rng_2\":2.000000,\"rng_3\":3.000000,\"rng_4\":4.000000,"
    "\"rng_5\":5.000000,\"rng_6\":6.000000}\n";

using Packets = std::vector<std::vector<unsigned>>;

class ArdupilotJson : public testing::Test {
 protected:
  void make(std::initializer_list<std::pair<std::string_view, SettingValue>> values = {}) {
    const TruthFormat& format = *find_truth_format("ardupilot-json");
    Settings settings(format.settings);
    for (const auto& [key, value] : values) settings.set(key, value);
    decoder_ = format.make(settings);
  }
  static HostTime at_ms(std::int64_t ms) { return HostTime{ms * 1'000'000}; }
  TruthResult feed(const std::string& text, std::int64_t ms) {
    text_ = text;
    decoder_->feed(std::as_bytes(std::span(text_)), TruthInput::datagram, at_ms(ms));
    TruthResult last = TruthResult::no_state;
    while (const auto result = decoder_->next(truth_)) last = *result;
    return last;
  }
  // Returns the datagrams that are sent, as numbers of two bytes.
  Packets sent() {
    Packets all;
    for (const Frame& frame : out_->frames()) {
      EXPECT_EQ(frame.bytes.size() % 2, 0U);
      auto& packet = all.emplace_back();
      for (std::size_t i = 0; i + 1 < frame.bytes.size(); i += 2)
        packet.push_back(std::to_integer<unsigned>(frame.bytes[i]) +
                         256U * std::to_integer<unsigned>(frame.bytes[i + 1]));
    }
    out_->clear();
    return all;
  }
  Packets poll(std::int64_t ms) {
    decoder_->poll(at_ms(ms), *out_);
    return sent();
  }
  Packets acknowledge() {
    decoder_->acknowledge(truth_, truth_.time, 0, *out_);
    return sent();
  }

  std::unique_ptr<TruthDecoder> decoder_;
  std::unique_ptr<FrameBuffer> out_ = std::make_unique<FrameBuffer>();
  Truth truth_;
  std::string text_;
};

TEST_F(ArdupilotJson, AnAnswerIsATruth) {
  make();
  ASSERT_EQ(feed(answer_at(12.5), 0), TruthResult::ok);
  EXPECT_TRUE(truth_.acknowledge);
  EXPECT_EQ(truth_.time.ns, 12'500'000'000);
  EXPECT_EQ(truth_.omega_BN_B, Vector3(0.01, 0.02, 0.03));
  EXPECT_EQ(truth_.specific_force_B, Vector3(0.1, 0.2, -9.8));
  EXPECT_EQ(truth_.r_BN_N, Vector3(1, 2, -3));
  EXPECT_EQ(truth_.v_BN_N, Vector3(4, 5, -6));
  // v_N of the body's x axis: cos(yaw) cos(pitch), sin(yaw) cos(pitch), -sin(pitch).
  const Vector3 x_N(std::cos(3.0) * std::cos(-0.2), std::sin(3.0) * std::cos(-0.2), -std::sin(-0.2));
  EXPECT_LE((truth_.q_NB * Vector3(1, 0, 0) - x_N).norm(), 1e-15);
  // A quaternion is preferred. Half a turn about z: x is south.
  ASSERT_EQ(feed(answer_at(12.6, R"("attitude": [0, 0, 0], "quaternion": [0, 0, 0, 1])"), 0), TruthResult::ok);
  EXPECT_LE((truth_.q_NB * Vector3(1, 0, 0) - Vector3(-1, 0, 0)).norm(), 1e-15);
  ASSERT_EQ(feed(answer_at(12.7, R"("quaternion": [1, 0, 0, 0])"), 0), TruthResult::ok);
  EXPECT_EQ(feed("{\"timestamp\": 1, \"imu\": {\"gyro\": [0, 0, 0]}}\n", 0), TruthResult::too_short);
  EXPECT_EQ(remark(*decoder_, TruthResult::too_short),
            "an object lacks \"imu.accel_body.0\" (specific_force_x_m_per_s2), \"imu.accel_body.1\" "
            "(specific_force_y_m_per_s2), \"imu.accel_body.2\" (specific_force_z_m_per_s2)");
}

TEST_F(ArdupilotJson, AnswersOfArdupilotsExamples) {
  make();
  ASSERT_EQ(feed(std::string(robots_answer), 0), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 250'000'000);
  // Speed and turn rate approach 0.5625 m/s and 0.15 rad/s by 1/80 of the difference each step of 1/400 s.
  const double left = std::pow(79.0 / 80, 100), speed = 0.5625 * (1 - left), turn_rate = 0.15 * (1 - left);
  const double yaw = 0.15 * (100 - 79 * (1 - left)) / 400;
  EXPECT_LE((truth_.omega_BN_B - Vector3(0, 0, turn_rate)).norm(), 1e-14);
  const double forward = 0.5625 * left / 79 * 400;
  EXPECT_LE((truth_.specific_force_B - Vector3(forward, speed * turn_rate, -9.80665)).norm(), 1e-12);
  EXPECT_LE((truth_.q_NB * Vector3(1, 0, 0) - Vector3(std::cos(yaw), std::sin(yaw), 0)).norm(), 1e-14);
  EXPECT_LE((truth_.v_BN_N - speed * Vector3(std::cos(yaw), std::sin(yaw), 0)).norm(), 1e-14);
  EXPECT_EQ(truth_.r_BN_N, Vector3(0.06110761012628982, 0.0005039814762246597, 0));

  make();
  ASSERT_EQ(feed(std::string(libraries_answer), 0), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 1'700'000'000'123'456'000);
  EXPECT_EQ(truth_.omega_BN_B, Vector3(0.01, -0.02, 0.03));
  EXPECT_EQ(truth_.specific_force_B, Vector3(0.1, 0.2, -9.8));
  EXPECT_EQ(truth_.r_BN_N, Vector3(1, 2, -3));
  EXPECT_EQ(truth_.v_BN_N, Vector3(4, 5, -6));
  const Vector3 x_N(std::cos(3.0) * std::cos(-0.2), std::sin(3.0) * std::cos(-0.2), -std::sin(-0.2));
  EXPECT_LE((truth_.q_NB * Vector3(1, 0, 0) - x_N).norm(), 1e-15);
}

TEST_F(ArdupilotJson, ServoPacketsAreThoseOfTheDocument) {
  make({{"pwm", std::vector<std::string>{"1500", "1600"}}, {"frame_rate_hz", std::int64_t{400}}});
  decoder_->start(at_ms(0));
  std::vector<unsigned> packet(4 + 16, 1000);
  packet[0] = 18458;
  packet[1] = 400;
  packet[2] = packet[3] = 0;
  packet[4] = 1500;
  packet[5] = 1600;
  EXPECT_EQ(poll(0), (Packets{packet}));
  make({{"pwm", std::vector<std::string>(17, "1234")}});
  decoder_->start(at_ms(0));
  packet.assign(4 + 32, 1000);
  std::fill_n(packet.begin() + 4, 17, 1234U);
  packet[0] = 29569;
  packet[2] = packet[3] = 0;
  EXPECT_EQ(poll(0), (Packets{packet}));
  EXPECT_THROW(make({{"pwm", std::vector<std::string>(33, "1500")}}), std::invalid_argument);
  EXPECT_THROW(make({{"pwm", std::vector<std::string>{"65536"}}}), std::invalid_argument);
  EXPECT_THROW(make({{"pwm", std::vector<std::string>{"fast"}}}), std::invalid_argument);
}

TEST_F(ArdupilotJson, AServoThatIsSetIsInTheNextPacket) {
  make({{"pwm", std::vector<std::string>{"1500", "1600"}}, {"speedup", 0.0}});
  decoder_->start(at_ms(0));
  std::vector<unsigned> packet = poll(0).at(0);
  decoder_->set_servo(1, 1750);
  decoder_->set_servo(15, 65535);
  packet[5] = 1750;
  packet[19] = 65535;
  EXPECT_EQ(poll(1000), (Packets{packet})) << "also if it is sent again";
  decoder_->set_servo(31, 1234);
  packet.resize(4 + 32, 1000);
  packet[0] = 29569;
  packet[2] = 1;
  packet[35] = 1234;
  ASSERT_EQ(feed(answer_at(0.001), 1001), TruthResult::ok);
  EXPECT_EQ(acknowledge(), (Packets{packet}));
  decoder_->set_servo(32, 1);
}

TEST_F(ArdupilotJson, APacketIsSentAgainUntilItIsAnsweredAndTheNextOneAfterTheSamples) {
  make({{"speedup", 0.0}});
  EXPECT_FALSE(decoder_->deadline());
  decoder_->start(at_ms(5));
  EXPECT_EQ(decoder_->deadline(), at_ms(5));
  EXPECT_EQ(poll(5).at(0).at(2), 0U);
  EXPECT_EQ(decoder_->deadline(), at_ms(1005));
  EXPECT_EQ(poll(1004).size(), 0U);
  EXPECT_EQ(poll(1005).at(0).at(2), 0U) << "the frame count is that of the first packet";
  ASSERT_EQ(feed(answer_at(0.001), 1006), TruthResult::ok);
  EXPECT_EQ(decoder_->deadline(), at_ms(2005)) << "nothing is sent before the samples";
  EXPECT_EQ(acknowledge().at(0).at(2), 1U);
  EXPECT_EQ(decoder_->deadline(), at_ms(2006));
  EXPECT_EQ(feed("{}", 1007), TruthResult::no_state);
  ASSERT_EQ(feed(answer_at(0.002), 1008), TruthResult::ok);
  EXPECT_EQ(acknowledge().at(0).at(2), 2U);
  decoder_->start(at_ms(9000));
  EXPECT_EQ(poll(9000).at(0).at(2), 0U) << "a new start resets the simulator";
}

TEST_F(ArdupilotJson, PacketsAreSentAtTheSimulatorsTime) {
  make();
  decoder_->start(at_ms(0));
  EXPECT_EQ(poll(0).size(), 1U);
  ASSERT_EQ(feed(answer_at(100.0), 3), TruthResult::ok);
  EXPECT_EQ(acknowledge().size(), 1U) << "the first truth has no time to wait for";
  for (int i = 1; i <= 3; ++i) {  // 0.25 s a truth, answered within 1 ms
    const int due = 3 + 250 * i;
    ASSERT_EQ(feed(answer_at(100.0 + 0.25 * i), due - 249), TruthResult::ok);
    EXPECT_EQ(acknowledge().size(), 0U);
    EXPECT_EQ(decoder_->deadline(), at_ms(due));
    EXPECT_EQ(poll(due).at(0).at(2), static_cast<unsigned>(i + 1));
  }
  // After a jump ahead, back, or of the host, the pace begins again.
  for (const auto& [time_s, ms] : {std::pair{500.0, 760}, {1.0, 770}, {1.001, 5000}}) {
    ASSERT_EQ(feed(answer_at(time_s), ms), TruthResult::ok);
    EXPECT_EQ(acknowledge().size(), 1U) << time_s;
  }
}

}  // namespace
}  // namespace imud
