// A client sets the servo outputs of a simulator with ArduPilot's JSON interface, in the bytes that it receives.
#include "tests/emulator/control/control_client.hpp"
#include "tests/emulator/run/run_test.hpp"
#include "tests/tools/loopback_socket.hpp"

namespace imud {
namespace {

class ServoOutputs : public RunTest {
 protected:
  // Returns the next servo packet as numbers of two bytes, without its frame count; empty if none comes. Those that
  // are sent again after a second are ignored.
  std::vector<unsigned> packet() {
    constexpr std::size_t count_at = 2;
    while (const auto bytes = simulator_.receive(30'000)) {
      std::vector<unsigned> numbers;
      for (std::size_t i = 0; i + 1 < bytes->size(); i += 2)
        numbers.push_back(std::to_integer<unsigned>((*bytes)[i]) + 256U * std::to_integer<unsigned>((*bytes)[i + 1]));
      if (numbers.size() < count_at + 2 || numbers[count_at] != count_) continue;
      ++count_;
      numbers.erase(numbers.begin() + count_at, numbers.begin() + count_at + 2);
      return numbers;
    }
    return {};
  }
  // Answers the last packet.
  void answer() {
    time_s_ += 0.01;
    const std::string text = fmt::format(
        "\n{{\"timestamp\": {:.2f}, \"imu\": {{\"gyro\": [0, 0, 0], \"accel_body\": [0, 0, -9.8]}}, \"attitude\": "
        "[0, 0, "
        "0], \"position\": [0, 0, 0], \"velocity\": [0, 0, 0]}}\n",
        time_s_);
    simulator_.answer(std::as_bytes(std::span(text)));
  }
  std::string lockstep(const std::string& format, const std::string& port, const std::string& more = {}) const {
    return write("c.toml", fmt::format("clock = \"lockstep\"\n[control]\nsocket = \"{0}/socket\"\n[truth]\n"
                                       "port = \"{1}\"\nformat = \"{2}\"\n{3}\n[[imu]]\nrate_hz = 1000\n"
                                       "protocol = \"native\"\nport = \"file:{0}/out\"\ngyro.max_rad_per_s = "
                                       "10\naccelerometer.max_m_per_s2 = 200\n",
                                       folder_, port, format, more));
  }

  LoopbackSocket simulator_;
  double time_s_ = 0;
  unsigned count_ = 0;  // of the next packet
};

TEST_F(ServoOutputs, AreThoseThatAClientHasSet) {
  Program imud("imud");
  imud.start({"run", lockstep("ardupilot-json", fmt::format("udp:127.0.0.1:0?peer=127.0.0.1:{}", simulator_.port()),
                              "speedup = 0.0\nframe_rate_hz = 400\npwm = [1500, 1600]")});
  std::vector<unsigned> expected(2 + 16, 1000);
  expected[0] = 18458;
  expected[1] = 400;
  expected[2] = 1500;
  expected[3] = 1600;
  EXPECT_EQ(packet(), expected) << imud.errors();
  ControlClient client(path("socket"));
  const auto answered = client.call("set", {{"truth.pwm", {1100, 1900, 1750}}});
  EXPECT_TRUE(answered.contains("result")) << answered;
  answer();
  expected[2] = 1100;
  expected[3] = 1900;
  expected[4] = 1750;
  EXPECT_EQ(packet(), expected);

  const ProgramResult by_ctl = run_program("imud", {"ctl", "--socket", path("socket"), "set", "truth.pwm=[2000]"});
  EXPECT_EQ(by_ctl.exit_code, 0) << by_ctl.errors;
  for (const nlohmann::json& wrong :
       {nlohmann::json(1500), nlohmann::json::array(), nlohmann::json({1500, 1500.5}), nlohmann::json({65536}),
        nlohmann::json({-1}), nlohmann::json(std::vector<int>(33, 1500))})
    EXPECT_EQ(client.call("set", {{"truth.pwm", wrong}})["error"]["message"],
              "Invalid params: truth.pwm: give a list of 1 to 32 whole numbers from 0 to 65535")
        << wrong;
  answer();
  expected[2] = 2000;
  EXPECT_EQ(packet(), expected) << "the others stay, and a refused list changes nothing";

  client.call("set", {{"truth.pwm", std::vector<int>(32, 1234)}});
  answer();
  expected.assign(2 + 32, 1234);
  expected[0] = 29569;
  expected[1] = 400;
  EXPECT_EQ(packet(), expected);
  client.call("quit");
  EXPECT_EQ(imud.wait(), 0) << imud.errors();
}

TEST_F(ServoOutputs, AreRefusedWhereThereAreNone) {
  Program imud("imud");
  imud.start({"run", lockstep("json", "udp:127.0.0.1:0")});
  ControlClient client(path("socket"));
  EXPECT_EQ(client.call("set", {{"truth.pwm", {1500}}})["error"]["message"],
            "truth.pwm: the truth format of this run sends no pulse widths");
  client.call("quit");
  EXPECT_EQ(imud.wait(), 0) << imud.errors();
}

}  // namespace
}  // namespace imud
