// `reload`: the file of a running configuration is read again. Each change takes effect at the sample that the answer
// states, exactly; a file that is wrong, or changes what cannot change, changes nothing.
#include "emulator/imu/reload.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <fstream>
#include <thread>

#include "emulator/config/load_config.hpp"
#include "tests/emulator/control/control_client.hpp"
#include "tests/emulator/run/live_test.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

using nlohmann::json;

class ReloadTest : public LiveTest {
 protected:
  // Two imus at 1 kHz with white noise. `more` stands in the first, `top` at the begin of the file.
  std::string text(const std::string& more = {}, const std::string& truth = {}, const std::string& top = {}) {
    std::string all = fmt::format("{}clock = \"lockstep\"\n[control]\nsocket = \"{}\"\n[truth]\nport = \"{}\"\n{}",
                                  top.empty() ? "seed = 5\n" : top, path("socket"), simulator_.port(), truth);
    for (const int i : {1, 2})
      all += fmt::format(
          "[[imu]]\nname = \"imu{0}\"\nrate_hz = 1000\nprotocol = \"csv\"\nport = \"file:{1}/out{0}\"\n"
          "accelerometer.max_m_per_s2 = 1000\n{2}",
          i, folder_, i == 1 ? more : std::string());
    for (const std::string_view key : {"gyro.max_rad_per_s = 100\n", "gyro.angle_random_walk_deg_per_rt_hr = 0.5\n"})
      for (std::size_t at = 0; (at = all.find("accelerometer.max", at)) != all.npos; at += key.size() + 20) {
        const std::size_t end = std::min(all.find("[[imu]]", at), all.size());
        if (all.substr(at, end - at).find(key.substr(0, key.find(' '))) == key.npos) all.insert(at, key);
      }
    return all;
  }
  std::string config(const std::string& content) const { return write("config.toml", content); }
  // Plays truths at 10 ms steps; `at[i]` is called when the truth of 10 i ms has been answered, at[-1] before the
  // first. Returns both files.
  using Script = std::map<int, std::function<void(ControlClient&)>>;
  std::pair<std::string, std::string> play(const std::string& content, const Script& at,
                                           const std::vector<std::string>& more = {}) {
    constexpr int last = 6;
    Program imud("imud");
    start(imud, config(content), more);
    ControlClient client(path("socket"));
    if (at.contains(-1)) at.at(-1)(client);
    for (int i = 0; i <= last; ++i) {
      EXPECT_TRUE(simulator_.exchange(Simulator::truth(10 * i, static_cast<std::uint32_t>(i), true)));
      if (const auto action = at.find(i); action != at.end()) action->second(client);
    }
    client.call("quit");
    EXPECT_EQ(imud.wait(), 0) << imud.errors();
    log_ = imud.errors();
    return {read_file(path("out1")), read_file(path("out2"))};
  }
  static std::string message(const json& answer) { return answer["error"]["message"].get<std::string>(); }
  // Writes the file, reads it again by `reload`, and returns the answer.
  json reload(ControlClient& client, const std::string& content) const {
    config(content);
    return client.call("reload");
  }
  static std::vector<std::vector<std::string>> rows_of(const std::string& csv, int first, int end = 1000) {
    std::vector<std::vector<std::string>> chosen;
    for (const auto& row : rows(csv))
      if (std::stoi(row[1]) >= first && std::stoi(row[1]) < end) chosen.push_back(row);
    return chosen;
  }
  static json applied_at(int sample) {
    json all = json::array();
    for (const char* name : {"imu1", "imu2"})
      all.push_back({{"imu", name}, {"sample", sample}, {"time_ns", sample * 1'000'000}});
    return all;
  }
  std::string log_;
};

constexpr const char* other_errors =
    "gyro.bias_rad_per_s = [0.25, 0, 0]\ngyro.scale_factor = [1.5, 1, 1]\ngyro.angle_random_walk_deg_per_rt_hr = 5\n"
    "accelerometer.bias_m_per_s2 = [1, 2, 3]\nmounting.position_m = [1, 0, 0]\n";

TEST_F(ReloadTest, ErrorsOfAnImuChangeAtTheSampleThatItAnswers) {
  const auto plain = play(text(), {});
  const auto other = play(text(other_errors), {});
  const auto changed = play(text(), {{2, [&](ControlClient& client) {
                                        const json answer = reload(client, text(other_errors));
                                        EXPECT_EQ(answer["result"]["applied"], applied_at(21)) << answer;
                                        json keys = json::array();
                                        for (const json& one : answer["result"]["changed"])
                                          keys.push_back(one["key"]);
                                        EXPECT_EQ(keys.size(), 5U) << answer;
                                        const json bias = {{"key", "imu.imu1.gyro.bias_rad_per_s"},
                                                           {"from", "[ 0.0, 0.0, 0.0 ]"},
                                                           {"to", "[ 0.25, 0.0, 0.0 ]"}};
                                        const json& all = answer["result"]["changed"];
                                        EXPECT_EQ(std::count(all.begin(), all.end(), bias), 1) << answer;
                                      }}});
  EXPECT_EQ(rows_of(changed.first, 0, 21), rows_of(plain.first, 0, 21));
  EXPECT_EQ(rows_of(changed.first, 22), rows_of(other.first, 22));
  EXPECT_NE(rows_of(changed.first, 21, 22), rows_of(plain.first, 21, 22));
  EXPECT_EQ(rows_of(changed.first, 22).size(), 39U);
  EXPECT_EQ(changed.second, plain.second);
  EXPECT_TRUE(contains(log_, "reload: ") && contains(log_, "imu1 from sample 21")) << log_;
}

// 5 % faster from the period after sample 21: 40 of its periods lie in 39 ms.
TEST_F(ReloadTest, ClockAndStampsChange) {
  const auto changed = play(text(), {{2, [&](ControlClient& client) {
                                        const json answer =
                                            reload(client, text("stamp_offset_us = 250\ntemperature_c = 75\n"
                                                                "clock.temperature_ppm_per_c = 1000\n"));
                                        EXPECT_EQ(answer["result"]["applied"], applied_at(21)) << answer;
                                      }}});
  for (const auto& row : rows_of(changed.first, 0))
    EXPECT_EQ(std::stoll(row[0]), std::stoi(row[1]) * 1'000'000LL + (std::stoi(row[1]) < 21 ? 0 : 250'000));
  EXPECT_EQ(rows_of(changed.first, 0).size(), 62U);
}

TEST_F(ReloadTest, IsRefusedWholeWithEachKeyThatCannotChange) {
  const auto plain = play(text(), {});
  const auto refused =
      play(text(), {{2, [&](ControlClient& client) {
                       std::string wrong = text(other_errors, "max_gap_ms = 5\n", "seed = 6\n");
                       wrong.replace(wrong.find("protocol = \"csv\""), 16, "protocol = \"native\"");
                       const json answer = reload(client, wrong);
                       EXPECT_EQ(answer["error"]["code"], -32001);
                       const std::string why = answer["error"]["message"];
                       for (const char* one : {"nothing has changed",
                                               "seed: cannot change while the run goes on; it is 5, in the file 6",
                                               "truth.max_gap_ms: cannot change",
                                               "imu.imu1.protocol: cannot change while the run goes on; it is 'csv', "
                                               "in the file 'native'"})
                         EXPECT_TRUE(contains(why, one)) << one << " is not in:\n" << why;
                       EXPECT_FALSE(contains(why, "bias")) << why;
                       EXPECT_EQ(client.call("status")["result"]["seed"], 5);
                     }}});
  EXPECT_EQ(refused, plain);
}

TEST_F(ReloadTest, OtherImusAreRefused) {
  play(text(), {{2, [&](ControlClient& client) {
                   std::string wrong = text();
                   wrong.replace(wrong.find("name = \"imu2\""), 13, "name = \"imu3\"");
                   const std::string why = reload(client, wrong)["error"]["message"];
                   EXPECT_TRUE(contains(why, "it is imu1, imu2, in the file imu1, imu3")) << why;
                 }}});
}

TEST_F(ReloadTest, AWrongFileIsRefusedWithAllItsFaults) {
  const auto plain = play(text(), {});
  const auto refused =
      play(text(), {{2, [&](ControlClient& client) {
                       const std::string why =
                           reload(client, text("gyro.biass_rad_per_s = 1\nrate_hzz = 2\n"))["error"]["message"];
                       EXPECT_TRUE(contains(why, "biass_rad_per_s") && contains(why, "rate_hzz")) << why;
                       EXPECT_TRUE(contains(why, "config.toml:")) << why;
                       EXPECT_TRUE(contains(message(reload(client, "[[imu")), "TOML"));
                       std::filesystem::remove(path("config.toml"));
                       EXPECT_TRUE(contains(message(client.call("reload")), "cannot be read"));
                     }}});
  EXPECT_EQ(refused, plain);
}

// A FIFO may be the configuration of a start. A reload would wait for its next writer, and the run for the reload.
TEST_F(ReloadTest, AFifoIsReadAtTheStartOnly) {
  ASSERT_EQ(::mkfifo(path("fifo").c_str(), 0600), 0);
  std::thread writer([&] { std::ofstream(path("fifo")) << text(); });
  Program imud("imud");
  start(imud, path("fifo"));
  writer.join();
  ControlClient client(path("socket"));
  const std::string why = message(client.call("reload"));
  EXPECT_TRUE(contains(why, "/fifo is no regular file")) << why;
  imud.kill(SIGHUP);
  EXPECT_TRUE(imud.wait_for_errors("SIGHUP: reload refused, nothing has changed: ")) << imud.errors();
  client.call("quit");
  EXPECT_EQ(imud.wait(), 0) << imud.errors();
}

TEST_F(ReloadTest, TwoInARowLeadBack) {
  const auto plain = play(text(), {});
  const auto changed = play(
      text(),
      {{2,
        [&](ControlClient& client) {
          EXPECT_EQ(reload(client, text())["result"], (json{{"changed", json::array()}, {"applied", json::array()}}));
          EXPECT_TRUE(reload(client, text("gyro.bias_rad_per_s = 1\n")).contains("result"));
          EXPECT_TRUE(reload(client, text(other_errors)).contains("result"));
        }},
       {4, [&](ControlClient& client) { EXPECT_EQ(reload(client, text())["result"]["applied"], applied_at(41)); }}});
  EXPECT_EQ(rows_of(changed.first, 42), rows_of(plain.first, 42));
  EXPECT_NE(rows_of(changed.first, 40, 41), rows_of(plain.first, 40, 41));
  EXPECT_TRUE(contains(log_, "no key differs")) << log_;
}

TEST_F(ReloadTest, BeforeTheFirstTruthItActsFromSample0On) {
  const auto other = play(text(other_errors), {});
  const auto changed = play(text(), {{-1, [&](ControlClient& client) {
                                        const json answer = reload(client, text(other_errors));
                                        EXPECT_EQ(answer["result"]["applied"][0]["sample"], 0) << answer;
                                        EXPECT_TRUE(answer["result"]["applied"][0]["time_ns"].is_null()) << answer;
                                      }}});
  EXPECT_EQ(changed, other);
}

// The named sample keeps its instant; the increments of the next one are those of its own, other period.
TEST_F(ReloadTest, ARateChangesAfterTheSampleThatItAnswers) {
  const auto with_rate = [&](int hz) {
    std::string all = text();
    return all.replace(all.find("rate_hz = 1000"), 14, fmt::format("rate_hz = {}", hz));
  };
  const auto plain = play(text(), {});
  const auto changed =
      play(text(), {{2,
                     [&](ControlClient& client) {
                       EXPECT_EQ(reload(client, with_rate(500))["result"]["applied"], applied_at(21));
                       EXPECT_EQ(client.call("status")["result"]["imus"][0]["rate_hz"], 500);
                     }},
                    {4, [&](ControlClient& client) {
                       const json applied = reload(client, with_rate(2000))["result"]["applied"];
                       EXPECT_EQ(applied[0], (json{{"imu", "imu1"}, {"sample", 31}, {"time_ns", 41'000'000}}));
                       EXPECT_EQ(applied[1], applied_at(41)[1]);
                     }}});
  EXPECT_EQ(changed.second, plain.second);
  EXPECT_EQ(rows_of(changed.first, 0, 21), rows_of(plain.first, 0, 21));
  const auto after = rows_of(changed.first, 21);
  ASSERT_EQ(after.size(), 49U);
  for (std::size_t i = 0; i < after.size(); ++i) {
    const std::size_t us = i <= 10 ? 21'000 + 2'000 * i : 41'000 + 500 * (i - 10);
    EXPECT_EQ(after[i][0], fmt::to_string(1000 * us)) << i;
    EXPECT_EQ(after[i][1], fmt::to_string(21 + i));
    const double step = i == 0 ? 0.001 : i <= 10 ? 0.002 : 0.0005;
    double force = 0, velocity = 0;
    for (const std::size_t axis : {0U, 1U, 2U}) {
      force += std::pow(std::stod(after[i][5 + axis]), 2);
      velocity += std::pow(std::stod(after[i][11 + axis]), 2);
    }
    EXPECT_NEAR(std::sqrt(velocity / force), step, 0.02 * step) << i;
  }
}

// What `set` has changed, and what the command line has set, is not the file's.
TEST_F(ReloadTest, KeepsWhatTheFileDoesNotChange) {
  const auto both = play(text("gyro.bias_rad_per_s = 0.5\naccelerometer.bias_m_per_s2 = 2\n"), {});
  const auto changed = play(text(), {{-1,
                                      [](ControlClient& client) {
                                        client.call("set", {{"imu.imu1.gyro.bias_rad_per_s", 0.5}});
                                      }},
                                     {0, [&](ControlClient& client) {
                                        const json answer = reload(client, text("accelerometer.bias_m_per_s2 = 2\n"));
                                        EXPECT_EQ(answer["result"]["changed"].size(), 1U) << answer;
                                      }}});
  EXPECT_EQ(rows_of(changed.first, 1), rows_of(both.first, 1));
  const auto overridden =
      play(text(),
           {{0,
             [&](ControlClient& client) {
               EXPECT_EQ(reload(client, text("gyro.bias_rad_per_s = 1\n"))["result"]["changed"].size(), 0U);
             }}},
           {"--set", "imu.imu1.gyro.bias_rad_per_s=0.5"});
  EXPECT_EQ(rows_of(overridden.first, 1, 2)[0][2], rows_of(both.first, 1, 2)[0][2]);
}

TEST_F(ReloadTest, SighupReloadsAndOpensTheFileOfFiguresAgain) {
  Program imud("imud");
  start(imud, config(text()), {"--quality", path("quality.jsonl")});
  ControlClient client(path("socket"));
  const auto sha = [&] { return client.call("status")["result"]["config_sha256"]; };
  const json before = sha();
  ASSERT_TRUE(eventually([&] { return std::filesystem::exists(path("quality.jsonl")); }));
  std::filesystem::rename(path("quality.jsonl"), path("quality.1"));
  config(text(other_errors));
  imud.kill(SIGHUP);
  EXPECT_TRUE(eventually([&] { return std::filesystem::exists(path("quality.jsonl")); }));
  EXPECT_TRUE(eventually([&] { return sha() != before; })) << imud.errors();
  EXPECT_TRUE(imud.wait_for_errors("imu1 from sample 0")) << imud.errors();
  config(text({}, {}, "seed = 7\n"));
  imud.kill(SIGHUP);
  EXPECT_TRUE(imud.wait_for_errors("SIGHUP: reload refused")) << imud.errors();
  EXPECT_EQ(imud.stop(), 0);
}

// The datagrams are shorter from the named sample on, and in the repetition of the record, too.
TEST_F(ReloadTest, SettingsOfTheDeviceChangeAsAtAPowerOn) {
  const auto unit = [&](const std::string& settings) {
    return fmt::format(
        "clock = \"lockstep\"\n[control]\nsocket = \"{}\"\n[truth]\nport = \"{}\"\n[[imu]]\nname = "
        "\"imu1\"\nprotocol = "
        "\"stim300\"\nport = \"file:{}/out1\"\n[imu.device]\nstart_up = false\n{}",
        path("socket"), simulator_.port(), folder_, settings);
  };
  std::size_t before = 0;
  const auto plain = play(unit(""), {});
  const auto other = play(unit("temperature = false\n"), {});
  ASSERT_LT(other.first.size(), plain.first.size());
  const auto changed = play(unit(""),
                            {{3,
                              [&](ControlClient& client) {
                                const json answer = reload(client, unit("temperature = false\n"));
                                ASSERT_TRUE(answer.contains("result")) << answer;
                                EXPECT_EQ(answer["result"]["changed"][0]["key"], "imu.imu1.device.temperature");
                                before = answer["result"]["applied"][0]["sample"];
                              }}},
                            {"--record", path("run.pcapng")});
  // A datagram for each other sample: its size is that of the whole over their number.
  const auto size_of = [&](const std::string& bytes) { return bytes.size() / 61; };
  const std::size_t first = size_of(plain.first) * (before / 2 + before % 2);
  ASSERT_GT(first, 0U);
  ASSERT_LT(first, changed.first.size());
  EXPECT_EQ(changed.first.substr(0, first), plain.first.substr(0, first));
  EXPECT_NE(changed.first.substr(first, 10), plain.first.substr(first, 10));
  EXPECT_EQ((changed.first.size() - first) % size_of(other.first), 0U);
  write("out1", "");
  config(unit(""));
  const auto again = run_program("imud", {"replay", path("config.toml"), path("run.pcapng"), "--fast"});
  EXPECT_EQ(again.exit_code, 0) << again.errors;
  EXPECT_EQ(read_file(path("out1")), changed.first);
}

TEST_F(ReloadTest, IdentifiersOnACanBusCannotChange) {
  const auto with_id = [&](int id) {
    return load_config(config(
        fmt::format("[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nname = \"a.b\"\nrate_hz = 100\nprotocol = "
                    "\"native-can\"\nport = "
                    "\"can:vcan0\"\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\ndevice.can_id = {}\n",
                    id)));
  };
  const std::vector<KeyChange> changes = key_changes(with_id(256), with_id(300));
  ASSERT_EQ(changes.size(), 1U);
  EXPECT_EQ(changes[0].key, "imu.a.b.device.can_id");
  EXPECT_STREQ(changes[0].refusal, "the identifiers on a CAN bus cannot change while the run goes on");
  EXPECT_TRUE(key_changes(with_id(256), with_id(256)).empty());
}

// By the host's clock: rates and clocks of both, and settings of one.
TEST_F(ReloadTest, ARecordOfARealTimeRunRepeatsTheBytes) {
  const auto two = [&](int rate_hz, int sample_rate, int error_ppm) {
    return fmt::format(
        "clock = \"realtime\"\nrealtime.priority = 0\nrealtime.lock_memory = false\n[control]\nsocket = "
        "\"{0}\"\n[truth]\n"
        "port = \"{1}\"\ndelay_ms = 0\n[[imu]]\nname = \"imu1\"\nprotocol = \"csv\"\nport = "
        "\"file:{2}/out1\"\nrate_hz = {3}\n"
        "clock_error_ppm = {5}\nbefore_first = \"rest\"\nmodel = \"stim300\"\n[[imu]]\nname = \"imu2\"\nprotocol = "
        "\"stim300\"\nport = \"file:{2}/out2\"\ndevice.sample_rate = {4}\n",
        path("socket"), simulator_.port(), folder_, rate_hz, sample_rate, error_ppm);
  };
  Program imud("imud");
  start(imud, config(two(200, 500, 50)), {"--record", path("run.pcapng")});
  ControlClient client(path("socket"));
  const auto wait_for_samples = [&](std::uint64_t n) {
    const auto samples = [&] { return client.call("status")["result"]["imus"][0]["samples"].get<std::uint64_t>(); };
    const std::uint64_t before = samples();
    EXPECT_TRUE(eventually([&] { return samples() > before + n; }));
  };
  auto truths = [&, k = std::uint32_t{0}]() mutable {
    for (const std::uint32_t until = k + 20; k < until; ++k) {
      simulator_.send(Simulator::encode(Simulator::truth(10 * std::int64_t{k}, k, false)));
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  };
  wait_for_samples(20);
  EXPECT_TRUE(reload(client, two(500, 500, 50)).contains("result"));
  truths();
  wait_for_samples(50);
  EXPECT_TRUE(reload(client, two(500, 1000, -200)).contains("result"));
  wait_for_samples(50);
  EXPECT_TRUE(reload(client, two(100, 1000, -200)).contains("result"));
  truths();
  wait_for_samples(10);
  client.call("quit");
  EXPECT_EQ(imud.wait(), 0) << imud.errors();
  const std::string first = read_file(path("out1")), second = read_file(path("out2"));
  EXPECT_GT(rows(first).size(), 130U);
  for (const char* file : {"out1", "out2"}) write(file, "");
  config(two(200, 500, 50));
  run_program("imud", {"replay", path("config.toml"), path("run.pcapng"), "--fast"});
  EXPECT_EQ(read_file(path("out1")), first);
  EXPECT_TRUE(read_file(path("out2")) == second);
}

// Random walk, flicker noise and a filter go on in the repetition as in the run.
TEST_F(ReloadTest, ARecordRepeatsTheBytes) {
  const std::string memory =
      "gyro.bias_instability_deg_per_hr = 100\ngyro.rate_random_walk_deg_per_hr_per_rt_hr = 1e4\ngyro.low_pass_hz = "
      "50\n";
  const Script script = {
      {2,
       [&](ControlClient& client) { EXPECT_TRUE(reload(client, text(memory + other_errors)).contains("result")); }},
      {3,
       [&](ControlClient& client) {
         EXPECT_TRUE(client.call("set", {{"imu.imu1.gyro.bias_rad_per_s", 2}}).contains("result"));
       }},
      {4, [&](ControlClient& client) {
         EXPECT_TRUE(reload(client, text(memory +
                                         "vibration.frequencies_hz = [20]\nvibration.force_m_per_s2 = "
                                         "[[1, 1, 1]]\n" +
                                         other_errors))
                         .contains("error"))
             << "a key that does not exist";
         EXPECT_TRUE(reload(client, text(memory, "when_stopped = \"silence\"\n")).contains("result"));
       }}};
  const auto sent = play(text(memory), script, {"--record", path("run.pcapng")});
  for (const char* file : {"out1", "out2"}) write(file, "");
  config(text(memory));
  const auto again = run_program("imud", {"replay", path("config.toml"), path("run.pcapng"), "--fast"});
  EXPECT_EQ(again.exit_code, 0) << again.errors;
  EXPECT_EQ(read_file(path("out1")), sent.first);
  EXPECT_EQ(read_file(path("out2")), sent.second);
}

}  // namespace
}  // namespace imud
