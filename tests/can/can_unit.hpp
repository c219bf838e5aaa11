// Shared by the tests of units on vcan0 and the nodes that they work with.
#pragma once

#include <string>

#include "tests/can/can_node.hpp"
#include "tests/emulator/run/live_test.hpp"

namespace imud {

class CanUnitTest : public LiveTest {
 protected:
  // Returns the table [[imu]] of a unit, with further keys.
  static std::string unit(const std::string& protocol, const std::string& keys = "",
                          const std::string& interface = "vcan0") {
    return fmt::format(
        "[[imu]]\nname = \"{0}\"\nprotocol = \"{0}\"\nport = \"can:{2}?bitrate=1000000\"\n"
        "before_first = \"rest\"\n{1}\n",
        protocol, keys, interface);
  }
  std::string write_config(const std::string& clock, const std::string& units) {
    return write("config.toml",
                 fmt::format("seed = 1\nclock = \"{}\"\n[truth]\nport = \"{}\"\nformat = \"native\"\n{}", clock,
                             simulator_.port(), units));
  }
  void start_unit(const std::string& protocol, const std::string& keys = "") {
    start(imud_, write_config("realtime", unit(protocol, keys)));
  }
  // Lets 20 ms of a run in lockstep pass. Returns false if imud does not answer.
  bool pass_20_ms() {
    const auto answer = simulator_.exchange(Simulator::truth(20 * step_, step_, true));
    ++step_;
    return answer.has_value();
  }
  // Ends the run; returns each unit's part of the summary.
  nlohmann::json end() {
    if (imud_.is_running()) {
      EXPECT_EQ(imud_.stop(), 0) << imud_.errors();
    }
    return summary()["imus"];
  }

  Program imud_{"imud"};

 private:
  std::uint32_t step_ = 0;
};

}  // namespace imud
