// `imud check`: the value of every key, in TOML that is the same configuration, and a fault for each configuration
// that could not run as it is meant.
#include "emulator/commands/check.hpp"

#include <gtest/gtest.h>
#include <toml++/toml.h>

#include "emulator/config/load_config.hpp"
#include "emulator/config/presets.hpp"
#include "emulator/plan/config.hpp"
#include "emulator/report/clock_watch.hpp"
#include "tests/emulator/run/run_test.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class CheckTest : public RunTest {
 protected:
  // A configuration with the keys that `protocol` requires.
  std::string minimal(const Protocol& protocol, const std::string& format = "native") const {
    std::string text = fmt::format(
        "[truth]\nport = \"udp:127.0.0.1:9810\"\nformat = \"{}\"\n[[imu]]\nport = \"{}\"\n"
        "protocol = \"{}\"\n",
        format, protocol.link == Link::can ? "can:vcan0" : "pty:imu1", protocol.name);
    if (protocol.product == nullptr)
      text += "rate_hz = 100\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n";
    return text;
  }
  std::string resolved(const std::string& text, const std::vector<std::string>& overrides = {}) const {
    return load_config(write("c.toml", text), overrides).resolved();
  }
};

TEST_F(CheckTest, TheResolvedConfigurationIsTheSame) {
  std::size_t settings = 0;
  for (const Protocol* protocol : protocols()) {
    SCOPED_TRACE(protocol->name);
    const std::string all = resolved(minimal(*protocol));
    EXPECT_EQ(resolved(all), all);
    const toml::table table = toml::parse(all);
    const toml::node_view imu = table["imu"][0];
    ASSERT_TRUE(imu.is_table());
    for (const Setting& setting : protocol->settings) EXPECT_TRUE(imu["device"][setting.key]) << setting.key;
    settings += protocol->settings.size();
    EXPECT_EQ(table["truth"]["max_gap_ms"].value<double>(), 60000.0);
    if (protocol->product == nullptr) continue;
    const Product product = protocol->product(Settings(protocol->settings));
    EXPECT_EQ(imu["rate_hz"].value<double>(), product.rate_hz);
    EXPECT_EQ(imu["gyro"]["max_rad_per_s"].value<double>(), product.gyro.max);
    EXPECT_EQ(imu["model"].value<std::string>(), default_model(*protocol, Settings(protocol->settings)));
    const toml::table white = toml::parse(resolved(minimal(*protocol), {"imu.0.model=white"}));
    EXPECT_EQ(white["imu"][0]["accelerometer"]["walk_sqrt_cov"][2][2].value<double>(),
              product.accelerometer.walk_sqrt_cov(2, 2));
  }
  EXPECT_GT(settings, 30U);
}

TEST_F(CheckTest, TheJsonOfAFileWhoseNameIsNoUtf8IsValid) {
  const std::string text = minimal(*find_protocol("native"));
  for (const bool is_good : {true, false}) {
    const std::string file = write("caf\xE9.toml", is_good ? text : text + "x = 1\n");
    const ProgramResult result = run_program("imud", {"check", file, "--json"});
    EXPECT_EQ(result.exit_code, is_good ? 0 : 2) << result.errors;
    const auto json = nlohmann::json::parse(result.output, nullptr, false);
    ASSERT_FALSE(json.is_discarded()) << result.output;
    EXPECT_EQ(json["path"], path("caf\xEF\xBF\xBD.toml"));
    EXPECT_EQ(json["good"], is_good);
  }
}

TEST_F(CheckTest, EveryKeyThatIsGivenIsResolved) {
  std::size_t formats = 0;
  for (const TruthFormat* format : truth_formats()) {
    ++formats;
    const std::string all = resolved(minimal(*find_protocol("native"), std::string(format->name)));
    EXPECT_EQ(resolved(all), all) << format->name;
  }
  EXPECT_GT(formats, 2U);
  const std::vector<std::string> given = {"seed=\"18446744073709551615\"",
                                          "truth.stream=4294967295",
                                          "truth.delay_ms=auto",
                                          "truth.auto_delay_percent=80",
                                          "earth.frame=inertial",
                                          "earth.start=2026-02-28T23:59:59+01:00",
                                          "earth.angle_deg=-12.5",
                                          "earth.rest_height_m=100.25",
                                          "imu.0.mounting.yaw_pitch_roll_deg=[1,2,3]",
                                          "imu.0.gyro.lsb_rad_per_s=1e-4",
                                          "imu.0.gyro.carry=true",
                                          "imu.0.gyro.rounding=nearest",
                                          "imu.0.phase_us=12.5",
                                          "imu.0.name=nose",
                                          "imu.0.gyro.walk_transition=[0.5, 1, 1]"};
  const std::string all = resolved(minimal(*find_protocol("native")), given);
  EXPECT_EQ(resolved(all), all);
  const toml::table table = toml::parse(all);
  EXPECT_EQ(table["seed"].value<std::string>(), "18446744073709551615");
  EXPECT_EQ(table["truth"]["stream"].value<std::int64_t>(), 4294967295);
  EXPECT_EQ(table["truth"]["delay_ms"].value<std::string>(), "auto");
  EXPECT_EQ(table["earth"]["start"].value<toml::date_time>()->offset->minutes, 60);
  EXPECT_EQ(table["imu"][0]["gyro"]["walk_transition"][0][0].value<double>(), 0.5);
  const std::string rotated =
      resolved(minimal(*find_protocol("native")), {"imu.0.mounting.dcm_PB=[[0,1,0],[-1,0,0],[0,0,1]]"});
  EXPECT_EQ(resolved(rotated), rotated);
  EXPECT_TRUE(contains(rotated, "dcm_PB"));
  EXPECT_FALSE(contains(rotated, "yaw_pitch_roll_deg = [ 0.0, 0.0, 0.0 ]\n\n[[") ||
               contains(rotated, "mounting.yaw"));
}

// The latency that the delay of live truth adds, in words and as numbers.
TEST_F(CheckTest, NamesTheDelayAndItsLatency) {
  const std::string c = write("live.toml", minimal(*find_protocol("native")));
  const auto output = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"check", c});
    return run_program("imud", more).output;
  };
  const auto delay = [&](const std::string& set) {
    return nlohmann::json::parse(output({"--json", "--set", set}))["delay"];
  };
  EXPECT_TRUE(contains(output({}), "an automatic delay, which adds a truth interval"));
  EXPECT_TRUE(contains(output({"--set", "truth.delay_ms=0"}), "no latency is added, and motion is extrapolated"));
  EXPECT_TRUE(contains(output({"--set", "truth.delay_ms=20"}), "which adds 20 ms of latency"));
  EXPECT_FALSE(contains(output({"--set", "clock=lockstep"}), "the sensors sample"));
  EXPECT_EQ(delay("seed=1")["automatic"], true);
  EXPECT_TRUE(delay("seed=1")["delay_ms"].is_null());
  EXPECT_EQ(delay("truth.delay_ms=20")["delay_ms"], 20.0);
  EXPECT_EQ(delay("truth.delay_ms=0")["automatic"], false);
  EXPECT_TRUE(delay("clock=lockstep").is_null());
}

// The clock of the grids; "tai" and "utc" need a synchronised one.
TEST_F(CheckTest, NamesTheEpochAndWhatItLacks) {
  const std::string c = write("live.toml", minimal(*find_protocol("native")));
  const auto checked = [&](const std::string& epoch) {
    return nlohmann::json::parse(
        run_program("imud", {"check", c, "--json", "--set", "realtime.epoch=" + epoch}).output);
  };
  EXPECT_TRUE(contains(run_program("imud", {"check", c, "--set", "realtime.epoch=monotonic"}).output,
                       "\nepoch    samples are on the grid of monotonic\n"));
  EXPECT_EQ(checked("none")["epoch"], "");
  EXPECT_TRUE(checked("monotonic")["warnings"].empty());
  const auto utc = checked("utc");
  EXPECT_TRUE(contains(utc["epoch"].get<std::string>(), "samples are on the grid of utc, clock ")) << utc["epoch"];
  RealtimeConfig realtime;
  realtime.epoch = Epoch::utc;
  EXPECT_EQ(utc["warnings"].empty(), epoch_fault(realtime, read_clock_state()).empty()) << utc["warnings"];
}

// A file with a secret need not be on the machine that checks: a warning, not a fault.
TEST_F(CheckTest, ATokenFileThatARunRefusesIsAWarning) {
  const std::string c = write("live.toml", minimal(*find_protocol("native"))), token = write("token", "short\n");
  std::filesystem::permissions(token, std::filesystem::perms::owner_read);
  for (const std::string listen : {"control.listen=127.0.0.1:7700", "web.listen=127.0.0.1:8080"}) {
    const std::string key = listen.substr(0, listen.find('.')) + ".token_file=";
    const auto warnings = [&](const std::string& file) {
      return nlohmann::json::parse(
          run_program("imud", {"check", c, "--json", "--set", listen, "--set", key + file}).output)["warnings"];
    };
    EXPECT_EQ(warnings(path("none")),
              nlohmann::json::array({"imud run does not begin: " + path("none") + ": the token cannot be read"}));
    ASSERT_EQ(warnings(token).size(), 1U);
    EXPECT_TRUE(contains(warnings(token)[0].get<std::string>(), "must have at least 16 characters"));
  }
  EXPECT_TRUE(
      nlohmann::json::parse(
          run_program("imud", {"check", c, "--json", "--set", "web.token_file=" + path("none")}).output)["warnings"]
          .empty())
      << "it is not read";
  const std::string good = write("good", "0123456789abcdef\n");
  std::filesystem::permissions(good, std::filesystem::perms::owner_read);
  EXPECT_TRUE(nlohmann::json::parse(run_program("imud", {"check", c, "--json", "--set", "web.listen=127.0.0.1:8080",
                                                         "--set", "web.token_file=" + good})
                                        .output)["warnings"]
                  .empty());
}

TEST_F(CheckTest, TheResolvedConfigurationGivesTheSameBytes) {
  const ProgramResult made = run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--for", "1"});
  ASSERT_EQ(made.exit_code, 0) << made.errors;
  const std::string stim = write("stim.toml", minimal(*find_protocol("stim300"), "csv"));
  const ProgramResult checked = run_program("imud", {"check", stim, "--toml"});
  ASSERT_EQ(checked.exit_code, 0) << checked.errors;
  const auto bytes = [&](const std::string& config) {
    const ProgramResult run = run_program(
        "imud", {"replay", config, path("truth.csv"), "--fast", "--set", "imu.0.port=file:" + path("out")});
    EXPECT_EQ(run.exit_code, 0) << run.errors;
    return read_file(path("out"));
  };
  const std::string expected = bytes(stim);
  EXPECT_GT(expected.size(), 10'000U);
  EXPECT_EQ(bytes(write("resolved.toml", checked.output)), expected);
}

TEST_F(CheckTest, PrintsTextOrJson) {
  const std::string c = write("stim.toml", minimal(*find_protocol("stim300")));
  const ProgramResult text = run_program("imud", {"check", c});
  EXPECT_EQ(text.exit_code, 0) << text.errors;
  EXPECT_TRUE(contains(text.output, "64.0 % of the line's 921600 bit/s")) << text.output;
  EXPECT_FALSE(contains(text.output, "bit_rate =")) << text.output;  // every key: --toml

  const auto json = [&](const std::vector<std::string>& more, int code) {
    std::vector<std::string> arguments = {"check", c, "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramResult result = run_program("imud", arguments);
    EXPECT_EQ(result.exit_code, code) << result.errors;
    return nlohmann::json::parse(result.output);
  };
  const nlohmann::json good = json({"--require", "imu1.samples>=1000", "--set", "earth.frame=inertial", "--set",
                                    "earth.start=2031-01-01T00:00:00Z"},
                                   0);
  EXPECT_EQ(good["good"], true);
  EXPECT_EQ(good["config"]["imu"][0]["device"]["bit_rate"], 921600);
  EXPECT_EQ(good["imus"][0]["lines"][0]["line_bits_per_s"], 921600.0);
  ASSERT_EQ(good["warnings"].size(), 1U);
  EXPECT_TRUE(contains(good["warnings"][0].get<std::string>(), "IGRF-14"));
  const nlohmann::json bad = json({"--set", "imu.0.rate_hz=1", "--set", "sed=1"}, 2);
  EXPECT_EQ(bad["good"], false);
  EXPECT_EQ(bad["faults"].size(), 2U);
  EXPECT_EQ(run_program("imud", {"check", c, "--require", "imu2.samples>=1"}).exit_code, 2);
  EXPECT_EQ(json({"--require", "imu2.samples>=1"}, 2)["faults"].size(), 1U);
}

// Each would fail, or run otherwise than it is meant; all of these were found good once.
TEST_F(CheckTest, WhatCannotRunAsItIsMeantIsAFault) {
  const std::string native = minimal(*find_protocol("native")), stim = minimal(*find_protocol("stim300"));
  const std::string two = native + "[[imu]]\nprotocol = \"stim300\"\nport = \"pty:imu2\"\n";
  std::filesystem::create_symlink("/dev/null", path("alias"));
  std::filesystem::create_hard_link(write("truth", ""), path("hard"));
  const std::string here = path("x"), there = folder_ + "/../" + folder_.substr(folder_.rfind('/') + 1) + "/x";
  struct Case {
    std::string text;
    std::vector<std::string> overrides;
    std::string key;
  };
  const std::vector<Case> cases = {
      {native, {"truth.port="}, "truth.port"},
      {native, {"truth.format="}, "truth.format"},
      {native, {"imu.0.protocol="}, "imu.0.protocol"},
      {native, {"imu.0.port="}, "imu.0.port"},
      {native, {"imu.0.port=udp:127.0.0.1:9810"}, "imu.0.port"},
      {native, {"truth.port=udp:0.0.0.0:9810", "imu.0.port=udp:127.0.0.1:9810"}, "imu.0.port"},
      {native, {"truth.port=udp:[::]:9810", "imu.0.port=udp:[::1]:9810"}, "imu.0.port"},
      {native, {"truth.port=udp:0.0.0.0:9810", "imu.0.port=udp:127.0.0.2:9810"}, "imu.0.port"},
      {native, {"imu.0.port=udp:0.0.0.0:9810"}, "imu.0.port"},
      {native, {"truth.port=udp:[::]:9810", "imu.0.port=udp:127.0.0.1:9810"}, "imu.0.port"},
      {two, {"imu.0.port=file:-", "imu.1.port=file:/dev/stdout"}, "imu.1.port"},
      {native,
       {"clock=fast", "truth.format=csv", "truth.port=file:" + path("truth"), "imu.0.port=file:" + path("hard")},
       "imu.0.port"},
      {stim, {"imu.0.sync.tov_port=udp:127.0.0.1:9810"}, "imu.0.sync.tov_port"},
      {stim, {"imu.0.sync.tov_port="}, "imu.0.sync.tov_port"},
      {two, {"imu.0.port=pty:" + here, "imu.1.port=pty:" + there}, "imu.1.port"},
      {two, {"imu.0.port=file:" + here, "imu.1.port=file:" + there}, "imu.1.port"},
      {two, {"imu.0.rate_hz=50", "imu.0.port=serial:/dev/null", "imu.1.port=serial:" + path("alias")}, "imu.1.port"},
      {native, {"imu.0.gyro.walk_transition=[1.01, 1, 1]"}, "imu.0.gyro.walk_transition"},
      {native,
       {"imu.0.accelerometer.walk_transition=[[0, 2, 0], [1, 0, 0], [0, 0, 1]]"},
       "imu.0.accelerometer.walk_transition"},
      {native, {"clock=lockstep", "truth.delay_ms=5"}, "truth.delay_ms"},
      {native, {"clock=lockstep", "truth.delay_ms=auto"}, "truth.delay_ms"},
      {stim, {"imu.0.device.sample_rate=2000", "imu.0.device.bit_rate=374400"}, "imu.0.device.sample_rate"},
      {stim, {"imu.0.device.bit_rate=9600"}, "imu.0.device.bit_rate"},
      {native, {"imu.0.name=\"*\""}, "imu.0.name"},
      {native, {"imu.0.name=\"1\""}, "imu.0.name"},
  };
  for (const Case& wrong : cases) {
    SCOPED_TRACE(fmt::format("{} of {}", fmt::join(wrong.overrides, " "), wrong.text));
    try {
      load_config(write("c.toml", wrong.text), wrong.overrides);
      ADD_FAILURE() << "is good";
    } catch (const ConfigError& error) {
      ASSERT_EQ(error.faults.size(), 1U) << error.what();
      EXPECT_TRUE(contains(error.faults[0], " " + wrong.key + ": ")) << error.what();
    }
  }
}

TEST_F(CheckTest, WhatIsUnusualIsGoodOrAWarning) {
  const std::string native = minimal(*find_protocol("native"));
  const auto warnings = [&](const std::vector<std::string>& overrides) {
    return load_config(write("c.toml", native), overrides).warnings;
  };
  EXPECT_TRUE(warnings({"imu.0.gyro.walk_transition=[1, 1, 1]"}).empty());
  EXPECT_TRUE(warnings({"imu.0.gyro.walk_transition=[[0, 1, 0], [-1, 0, 0], [0, 0, 1]]"}).empty()) << "a rotation";
  const auto bounded = warnings({"imu.0.gyro.walk_transition=[1.01, 1, 1]", "imu.0.gyro.walk_bound=[1, 1, 1]"});
  ASSERT_EQ(bounded.size(), 1U);
  EXPECT_TRUE(contains(bounded[0], "imu.0.gyro.walk_transition: its spectral radius is 1.01")) << bounded[0];
  EXPECT_TRUE(warnings({"truth.port=udp:0.0.0.0:9810", "imu.0.port=udp:192.0.2.1:9810"}).empty()) << "another host";
  EXPECT_TRUE(warnings({"truth.port=udp:0.0.0.0:9810", "imu.0.port=udp:[::1]:9810"}).empty()) << "IPv4 alone";
  EXPECT_TRUE(warnings({"clock=lockstep", "truth.delay_ms=0"}).empty());
}

}  // namespace
}  // namespace imud
