// The setting `columns` of the truth in a configuration: a list, a table, or a table of the format's own.
#include <gtest/gtest.h>
#include <toml++/toml.h>

#include "emulator/config/load_config.hpp"
#include "emulator/plan/config.hpp"
#include "tests/emulator/run/run_test.hpp"

namespace imud {
namespace {

class TruthColumns : public RunTest {
 protected:
  Config load(const std::string& truth) const {
    return load_config(write("columns.toml", "[truth]\nport = \"udp:127.0.0.1:9810\"\nformat = \"csv\"\n" + truth +
                                                 "\n[[imu]]\nrate_hz = 200\nprotocol = \"native\"\n"
                                                 "port = \"pty:imu1\"\ngyro.max_rad_per_s = 10\n"
                                                 "accelerometer.max_m_per_s2 = 200\n"));
  }
  // Returns the only fault, without the name of the file.
  std::string fault(const std::string& truth) const {
    try {
      load(truth);
    } catch (const ConfigError& error) {
      EXPECT_EQ(error.faults.size(), 1U) << error.what();
      return error.faults[0].substr(error.faults[0].find(".toml") + 5);
    }
    return "none";
  }
};

TEST_F(TruthColumns, ATableIsAListOfPairs) {
  const std::vector<std::string> pairs = {"pitch_deg=p", "roll_deg=r", "time_s=t", "yaw_deg=y"};
  const std::string table = "{time_s = \"t\", yaw_deg = \"y\", pitch_deg = \"p\", roll_deg = \"r\"}";
  EXPECT_EQ(load("columns = " + table).truth.settings.list("columns"), pairs);
  const Config own = load("level = \"enu\"\n[truth.csv]\nbody = \"flu\"\ncolumns = " + table);
  EXPECT_EQ(own.truth.settings.list("columns"), pairs);
  EXPECT_EQ(own.truth.settings.text("level"), "enu");
  EXPECT_EQ(own.truth.settings.text("body"), "flu");
  const Config again = load_config(write("again.toml", own.resolved()));
  EXPECT_EQ(again.truth.settings.list("columns"), pairs);
  EXPECT_EQ(again.resolved(), own.resolved());
  const std::vector<std::string> numbers = {"pitch_deg=2", "roll_deg=3", "time_s=0", "yaw_deg=1"};
  EXPECT_EQ(load("columns = {time_s = 0, yaw_deg = 1, pitch_deg = 2, roll_deg = 3}").truth.settings.list("columns"),
            numbers);
}

TEST_F(TruthColumns, FaultsAreThoseOfTheKey) {
  EXPECT_EQ(fault("columns = {time_s = \"t\"}"),
            ":4: truth.columns: the attitude is missing; give q_NB_w to _z, yaw, pitch and roll, or another");
  EXPECT_EQ(fault("[truth.csv]\ncolumns = {time_s = \"t\", time_ms = \"T\"}"),
            ":5: truth.csv.columns: the quantity time is named twice, as time_ms and as time_s; give one of them");
  EXPECT_EQ(fault("columns = {}"),
            ":4: truth.columns: give a list of texts, or a table of texts such as {time_s = \"t\"}");
  EXPECT_EQ(fault("columns = {time_s = 1.5}"),
            ":4: truth.columns: give a list of texts, or a table of texts such as {time_s = \"t\"}");
  EXPECT_EQ(fault("level = \"ned\"\n[truth.csv]\nlevel = \"enu\""),
            ":6: truth.csv.level: is given twice, here and in the table around it");
  EXPECT_EQ(fault("[truth.csv]\nlevels = \"enu\""), ":5: truth.csv.levels: unknown key; did you mean \"level\"?");
  EXPECT_EQ(fault("level = {ned = \"enu\"}"), ":4: truth.level: give a single value");
}

}  // namespace
}  // namespace imud
