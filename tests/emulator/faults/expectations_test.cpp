// Expectations of a scenario on the host: times, patterns, results, JUnit.
#include "emulator/faults/expectations.hpp"

#include <gtest/gtest.h>

#include <boost/property_tree/ptree.hpp>
#include <boost/property_tree/xml_parser.hpp>
#include <sstream>

#include "emulator/config/load_config.hpp"
#include "tests/emulator/faults/faulty_run.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

const std::string stuck_gyro =
    "[[fault]]\nname = \"stuck gyro\"\ntarget = \"gyro\"\nkind = \"stuck\"\nat_s = 2\nfor_s = 1\n";

class ExpectationsTest : public FaultyRunTest {
 protected:
  Config read(const std::string& text, const std::string& port = "pty:host") {
    std::string config = config_text(text, "native", 1,
                                     "rate_hz = 100\nmodel = \"ideal\"\ngyro.max_rad_per_s = 10\n"
                                     "accelerometer.max_m_per_s2 = 100\n");
    config.replace(config.find("file:1"), 6, port);
    return load_config(write("expect.toml", config));
  }
  // An act of the host after the sample of this number, at 100 Hz.
  struct Done {
    int sample;
    std::string bytes;
  };
  std::vector<Expected> results(const std::string& text, const std::vector<Done>& host, int samples = 600) {
    const Config config = read(text);
    FaultLog log;
    const std::vector<Normals> normals = fault_normals("imu1", 1, config.faults.size());
    FaultSchedule schedule(config.faults, normals, "imu1", 0, 100, log);
    Expectations expectations(config.expectations, "imu1");
    for (int k = 0; k < samples; ++k) {
      schedule.take(Sample{}, std::chrono::milliseconds(10 * k));
      expectations.take(schedule, 0.01 * k);
      for (const Done& done : host) {
        if (done.sample != k) continue;
        if (done.bytes == "close") expectations.port_is(PortState::no_reader);
        if (done.bytes == "open") expectations.port_is(PortState::ready);
        // Byte by byte: a pattern may come in pieces.
        for (const char c : done.bytes) expectations.host_sent(std::as_bytes(std::span(&c, 1)));
      }
    }
    return expectations.results();
  }
};

TEST_F(ExpectationsTest, BytesWithinATime) {
  const std::string reset =
      stuck_gyro + "[[expect]]\nwhat = \"host_sends\"\nhex = \"01 01 02\"\nafter = \"stuck gyro\"\nwithin_s = 2\n";
  const std::string pattern = "\x01\x01\x02";
  const auto at = [&](int sample, const std::string& bytes) { return results(reset, {{sample, bytes}}).at(0); };
  EXPECT_TRUE(at(350, pattern).holds);
  EXPECT_TRUE(at(350, pattern).text.ends_with(", from the begin of fault stuck gyro")) << at(350, pattern).text;
  EXPECT_TRUE(contains(at(350, pattern).seen, "sent 1.5 s after the begin of its time, at 3.5 s"));
  EXPECT_TRUE(at(350, "\x01" + pattern).holds) << "a pattern may begin within what looked like it";
  EXPECT_TRUE(at(400, pattern).holds);
  EXPECT_FALSE(at(150, pattern).holds) << "too early";
  EXPECT_FALSE(at(402, pattern).holds) << "too late";
  EXPECT_FALSE(at(350, "\x01\x02\x02").holds);
  EXPECT_EQ(at(350, "\x01\x02\x02").seen, "not seen in its time");
  EXPECT_EQ(results(reset, {}, 300).at(0).seen, "the run ended 1.01 s before the end of its time");
  EXPECT_EQ(results(reset, {}, 100).at(0).seen, "its time has never begun");
  EXPECT_FALSE(results(reset, {}, 100).at(0).holds);
}

TEST_F(ExpectationsTest, Silence) {
  const std::string silent =
      stuck_gyro + "[[expect]]\nwhat = \"host_is_silent\"\nafter_end_of = \"stuck gyro\"\nwithin_s = 1\n";
  EXPECT_TRUE(results(silent, {}).at(0).holds);
  EXPECT_TRUE(results(silent, {{250, "x"}, {299, "x"}, {402, "x"}}).at(0).holds);
  EXPECT_FALSE(results(silent, {{301, "x"}}).at(0).holds);
  EXPECT_FALSE(results(silent, {}, 350).at(0).holds) << "it is not known";
}

TEST_F(ExpectationsTest, APortThatIsOpenedAgain) {
  const std::string reopens = "[[expect]]\nwhat = \"host_reopens\"\nat_s = 1\nwithin_s = 2\n";
  EXPECT_TRUE(results(reopens, {{120, "close"}, {200, "open"}}).at(0).holds);
  EXPECT_FALSE(results(reopens, {{120, "close"}, {320, "open"}}).at(0).holds);
  EXPECT_FALSE(results(reopens, {{200, "open"}}).at(0).holds) << "it was open all the time";
  EXPECT_FALSE(results(reopens, {{20, "close"}, {50, "open"}}).at(0).holds) << "before its time";
  EXPECT_FALSE(results(reopens, {{20, "close"}, {50, "open"}, {120, "close"}}).at(0).holds);
  EXPECT_FALSE(results(reopens, {{20, "close"}, {50, "open"}, {150, "open"}}).at(0).holds)
      << "once open, it stays so";
  EXPECT_TRUE(results(reopens, {{20, "close"}, {50, "open"}, {120, "close"}, {150, "open"}}).at(0).holds);
}

TEST_F(ExpectationsTest, APortIsOpenedAgainOnlyIfItHasReaders) {
  const std::string reopens = "[[expect]]\nwhat = \"host_reopens\"\nat_s = 1\nwithin_s = 2\n";
  const auto fault_of = [&](const std::string& text, const std::string& port) -> std::string {
    try {
      read(text, port);
      return {};
    } catch (const ConfigError& error) {
      return error.what();
    }
  };
  for (const std::string port : {"pty:host", "tcp:127.0.0.1:9001", "tcp-listen:127.0.0.1:9001", "unix-listen:host"})
    EXPECT_EQ(fault_of(reopens, port), "") << port;
  for (const std::string port : {"file:out", "udp:127.0.0.1:9001", "serial:/dev/ttyS0?baud=921600"}) {
    EXPECT_TRUE(contains(fault_of(reopens, port),
                         "expect.0.what: \"host_reopens\" needs a port that its host opens; " + port))
        << port << fault_of(reopens, port);
    EXPECT_EQ(fault_of("[[expect]]\nwhat = \"host_is_silent\"\nwithin_s = 2\n", port), "") << port;
  }
}

// fault.repeat adds the fault again, under another number and with its name.
TEST_F(ExpectationsTest, TheTimeBeginsWithARepetitionOfTheFault) {
  const Config config = read(
      "[[fault]]\nname = \"later\"\ntarget = \"gyro\"\nkind = \"stuck\"\nat_s = 5000\nfor_s = 1\n"
      "[[expect]]\nwhat = \"host_sends\"\nafter_end_of = \"later\"\nwithin_s = 1\n");
  FaultConfig again = config.faults[0];
  again.begin_s.a = 0;
  for (const int sends : {250, 350, 450}) {
    FaultLog log;
    const std::vector<Normals> normals = fault_normals("imu1", 1, 2);
    FaultSchedule schedule(config.faults, normals, "imu1", 0, 100, log);
    Expectations expectations(config.expectations, "imu1");
    for (int k = 0; k < 600; ++k) {
      if (k == 200) schedule.add(again, 1);
      schedule.take(Sample{}, std::chrono::milliseconds(10 * k));
      expectations.take(schedule, 0.01 * k);
      if (k == sends) expectations.host_sent(std::as_bytes(std::span("x", 1)));
    }
    EXPECT_EQ(expectations.results().at(0).holds, sends == 350) << sends << expectations.results().at(0).seen;
  }
}

// A simulator that starts again does not take away what was met, or was decided otherwise.
TEST_F(ExpectationsTest, WhatIsDecidedStaysSoInTheNextRun) {
  const Config config = read("[[expect]]\nwhat = \"host_sends\"\nat_s = 1\nwithin_s = 1\n");
  for (const int sends : {150, 250, 650}) {
    FaultLog log;
    FaultSchedule schedule(config.faults, {}, "imu1", 0, 100, log);
    Expectations expectations(config.expectations, "imu1");
    for (int k = 0; k < 800; ++k) {
      if (k == 500) expectations.begin_run();
      expectations.take(schedule, 0.01 * (k % 500));
      if (k == sends) expectations.host_sent(std::as_bytes(std::span("x", 1)));
    }
    EXPECT_EQ(expectations.results().at(0).holds, sends == 150) << sends;
  }
}

TEST_F(ExpectationsTest, WhatIsWrongIsExplained) {
  const auto fault_of = [&](const std::string& text) -> std::string {
    try {
      read(text);
      return {};
    } catch (const ConfigError& error) {
      return error.what();
    }
  };
  const std::string sends = "[[expect]]\nwhat = \"host_sends\"\nwithin_s = 1\n";
  EXPECT_EQ(fault_of(sends), "");
  for (const auto& [text, expected] : std::vector<std::pair<std::string, std::string>>{
           {"[[expect]]\nwithin_s = 1\n", "expect.0.what: missing"},
           {"[[expect]]\nwhat = \"host_sends\"\n", "expect.0.within_s: missing"},
           {sends + "name = \"\"\n", "expect.0.name: give a name that is not empty"},
           {sends + "name = \"a\\u0001\"\n", "expect.0.name: has a line feed or another control character"},
           {sends + fmt::format("name = \"{}\"\n", std::string(65, 'a')), "expect.0.name: has 65 characters"},
           {sends + "after = \"fault1\"\n", "no fault \"fault1\" acts on imu1"},
           {sends + "hex = \"0g\"\n", "give bytes as hexadecimal digits"},
           {sends + "hex = \"00\"\ntext = \"a\"\n", "give either text or hex"},
           {sends + "imu = \"imu3\"\n", "there is no imu \"imu3\"; of: imu1"},
           {stuck_gyro + sends + "at_s = 1\nafter = \"stuck gyro\"\n", "give one of after, after_end_of and at_s"},
           {"[[expect]]\nwhat = \"host_reopens\"\nwithin_s = 1\ntext = \"a\"\n", "is not about bytes"},
       })
    EXPECT_TRUE(contains(fault_of(text), expected)) << text << fault_of(text);
}

TEST_F(ExpectationsTest, DecideTheExitCode) {
  const std::string text = config_text(
      "[[expect]]\nname = \"a <quiet> host\"\nwhat = \"host_is_silent\"\nwithin_s = 1\n"
      "[[expect]]\nname = \"a reset\"\nwhat = \"host_sends\"\ntext = \"R\"\nwithin_s = 1\n",
      "native", 1,
      "rate_hz = 100\nmodel = \"ideal\"\ngyro.max_rad_per_s = 10\n"
      "accelerometer.max_m_per_s2 = 100\n");
  const std::string flight = IMUD_TEST_DATA "/captures/jsbsim_c172_10s.pcap?port=5140";
  const ProgramResult result =
      run_program("imud", {"replay", write("run.toml", text), flight, "--set", "imu.0.port=file:" + path("out"),
                           "--junit", path("junit.xml"), "--summary", path("summary.json")});
  EXPECT_EQ(result.exit_code, 3) << result.errors;
  EXPECT_TRUE(contains(result.output,
                       "expected a <quiet> host: the host of imu1 does not send bytes for 1 s, from 0 s: holds"))
      << result.output;
  const auto s = summary();
  ASSERT_EQ(s["expected"].size(), 2U);
  EXPECT_TRUE(s["expected"][0]["holds"]);
  EXPECT_FALSE(s["expected"][1]["holds"]);
  EXPECT_TRUE(s["complete"]);
  boost::property_tree::ptree xml;
  std::istringstream file(read_file(path("junit.xml")));
  boost::property_tree::read_xml(file, xml);
  const auto& suite = xml.get_child("testsuites.testsuite");
  EXPECT_EQ(suite.get<int>("<xmlattr>.tests"), 2);
  EXPECT_EQ(suite.get<int>("<xmlattr>.failures"), 1);
  EXPECT_EQ(suite.get<std::string>("testcase.<xmlattr>.name"), "a <quiet> host");
}

}  // namespace
}  // namespace imud
