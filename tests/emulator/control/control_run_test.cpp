// Commands in lockstep: each takes effect at the sample that the answer states, exactly, and at no other.
#include <algorithm>

#include "tests/emulator/control/control_client.hpp"
#include "tests/emulator/run/live_test.hpp"
#include "tests/support/environment.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

using nlohmann::json;

class ControlRun : public LiveTest {
 protected:
  // Two imus at 1 kHz with noise.
  std::string two_imus(const std::string& more = {}) {
    std::string text =
        fmt::format("seed = 5\nclock = \"lockstep\"\n{}[control]\nsocket = \"{}\"\n[truth]\nport = \"{}\"\n", more,
                    path("socket"), simulator_.port());
    for (const int i : {1, 2})
      text += fmt::format(
          "[[imu]]\nname = \"imu{0}\"\nrate_hz = 1000\nprotocol = \"csv\"\nport = \"file:{1}/out{0}\"\n"
          "gyro.max_rad_per_s = 100\naccelerometer.max_m_per_s2 = 1000\n"
          "gyro.angle_random_walk_deg_per_rt_hr = 0.5\n",
          i, folder_);
    return write("config.toml", text);
  }
  // Plays truths at 10 ms steps; `at[i]` is called when the truth of 10 i ms has been answered. Returns both files.
  using Script = std::map<int, std::function<void(ControlClient&)>>;
  std::pair<std::string, std::string> play(const std::string& config, const Script& at, int last = 6,
                                           const std::vector<std::string>& more = {}) {
    Program imud("imud");
    start(imud, config, more);
    ControlClient client(path("socket"));
    for (int i = 0; i <= last; ++i) {
      EXPECT_TRUE(simulator_.exchange(Simulator::truth(10 * i, static_cast<std::uint32_t>(i), true)));
      if (const auto action = at.find(i); action != at.end()) action->second(client);
    }
    client.call("quit");
    EXPECT_EQ(imud.wait(), 0) << imud.errors();
    EXPECT_FALSE(std::filesystem::exists(path("socket")));
    return {read_file(path("out1")), read_file(path("out2"))};
  }
  // Returns the rows from `first` until before `end`, by their counters.
  static std::vector<std::vector<std::string>> rows_of(const std::string& csv, int first, int end) {
    std::vector<std::vector<std::string>> chosen;
    for (const auto& row : rows(csv))
      if (std::stoi(row[1]) >= first && std::stoi(row[1]) < end) chosen.push_back(row);
    return chosen;
  }
};

// The answer of a change to both imus after the truth of 10 i ms.
json applied_after(int i) {
  json all = json::array();
  for (const char* name : {"imu1", "imu2"})
    all.push_back({{"imu", name}, {"sample", 10 * i + 1}, {"time_ns", (10 * i + 1) * 1'000'000}});
  return all;
}

TEST_F(ControlRun, SetsABiasFromTheSampleThatItAnswers) {
  const auto plain = play(two_imus(), {});
  EXPECT_EQ(summary()["ended_by"], "control");
  const Script set = {{2, [](ControlClient& client) {
                         const json answer = client.call("set", {{"imu.*.gyro.bias_rad_per_s", {0.25, 0, 0}}});
                         EXPECT_EQ(answer["result"]["applied"], applied_after(2)) << answer;
                       }}};
  const auto changed = play(two_imus(), set);
  const std::string config = two_imus();
  const auto biased = [&] {
    std::string text = read_file(config);
    for (std::size_t at = 0; (at = text.find("gyro.angle", at)) != text.npos; at += 60)
      text.insert(at, "gyro.bias_rad_per_s = [0.25, 0, 0]\n");
    return play(write("config.toml", text), {});
  }();
  for (const auto imu : {&std::pair<std::string, std::string>::first, &std::pair<std::string, std::string>::second}) {
    EXPECT_EQ(rows_of(changed.*imu, 0, 21), rows_of(plain.*imu, 0, 21));
    EXPECT_EQ(rows_of(changed.*imu, 21, 1000), rows_of(biased.*imu, 21, 1000));
    EXPECT_NE(rows_of(changed.*imu, 21, 22), rows_of(plain.*imu, 21, 22));
    EXPECT_EQ(rows_of(changed.*imu, 21, 1000).size(), 40U);
  }
}

TEST_F(ControlRun, ChangesOfABatchTakeEffectAtOneSample) {
  const Script script = {
      {2,
       [](ControlClient& client) {
         const json answer = client.call(
             "batch", {{"changes",
                        {{{"method", "pause"}, {"params", {{"imu", "imu1"}}}},
                         {{"method", "set"}, {"params", {{"imu.imu2.accelerometer.bias_m_per_s2", 1}, {"seed", 6}}}},
                         {{"method", "mark"}, {"params", {{"text", "both"}}}}}}});
         EXPECT_EQ(answer["result"]["applied"], applied_after(2)) << answer;
       }},
      {4, [](ControlClient& client) {
         const json answer = client.call("resume", {{"imu", "imu1"}});
         EXPECT_EQ(answer["result"]["applied"], json::array({applied_after(4)[0]})) << answer;
       }}};
  const auto plain = play(two_imus(), {});
  const auto changed = play(two_imus(), script);
  EXPECT_EQ(summary()["imus"][0]["paused"], 20);
  EXPECT_EQ(summary()["imus"][0]["samples"], 61);
  EXPECT_EQ(rows_of(changed.first, 0, 21), rows_of(plain.first, 0, 21));
  EXPECT_EQ(rows_of(changed.first, 21, 41).size(), 0U) << "paused";
  EXPECT_EQ(rows_of(changed.first, 41, 1000).size(), 20U);
  EXPECT_EQ(rows_of(changed.second, 0, 21), rows_of(plain.second, 0, 21));
  // The numbers of the seed 6 from sample 21 on, as in a run with it; imu1 has its white noise alone.
  std::string text = read_file(two_imus());
  text.replace(text.find("seed = 5"), 8, "seed = 6");
  const auto of_seed_6 = play(write("config.toml", text), {});
  EXPECT_EQ(rows_of(changed.first, 41, 1000), rows_of(of_seed_6.first, 41, 1000));
  const auto biased = rows_of(changed.second, 21, 1000), unbiased = rows_of(of_seed_6.second, 21, 1000);
  ASSERT_EQ(biased.size(), 40U);
  for (std::size_t i = 0; i < biased.size(); ++i)
    for (std::size_t axis = 5; axis < 8; ++axis)
      EXPECT_NEAR(std::stod(biased[i][axis]), std::stod(unbiased[i][axis]) + 1, 1e-12);
  // All of it again: the same bytes.
  EXPECT_EQ(play(two_imus(), script), changed);
}

std::string without_faults(std::string text) {
  const std::string table = "[control]\n";
  return text.insert(text.find(table) + table.size(), "faults = false\n");
}

// By control at sample k the bytes are those of a scenario at sample k, also where they are drawn by the seed.
TEST_F(ControlRun, AFaultIsThatOfAScenario) {
  const std::string plain = read_file(two_imus());
  const std::string faults =
      "[[fault]]\nimu = \"imu1\"\ntarget = \"gyro.x\"\nkind = \"noise\"\nvalue = 0.5\nat_sample = 21\nfor_samples = "
      "10\n"
      "[[fault]]\ntarget = \"accelerometer\"\nkind = \"bias\"\nvalue_g = {uniform = [0.5, 1.5]}\nat_sample = 21\n";
  const auto clean = play(write("clean.toml", plain), {});
  const auto scenario = play(write("scenario.toml", plain + faults), {});
  json answer;
  const auto control = play(
      write("control.toml", plain),
      {{2, [&](ControlClient& client) {
          answer = client.call(
              "batch",
              {{"changes",
                {{{"method", "fault.begin"},
                  {"params",
                   {{"imu", "imu1"}, {"target", "gyro.x"}, {"kind", "noise"}, {"value", 0.5}, {"for_samples", 10}}}},
                 {{"method", "fault.begin"},
                  {"params",
                   {{"target", "accelerometer"}, {"kind", "bias"}, {"value_g", {{"uniform", {0.5, 1.5}}}}}}}}}});
        }}});
  ASSERT_EQ(answer["result"]["applied"].size(), 2U) << answer;
  EXPECT_EQ(answer["result"]["applied"][0]["sample"], 21);
  EXPECT_EQ(control, scenario);
  EXPECT_NE(control, clean);
  EXPECT_EQ(rows_of(control.first, 0, 21), rows_of(clean.first, 0, 21));
  // A run that must not fail does not, and what is wrong is explained.
  std::vector<std::string> refusals;
  const auto refused = [&](ControlClient& client, const json& params) {
    refusals.push_back(client.call("fault.begin", params)["error"]["message"].get<std::string>());
  };
  play(write("without.toml", without_faults(plain)), {{1, [&](ControlClient& client) {
                                                         refused(client, {{"target", "gyro"}, {"kind", "dead"}});
                                                       }}});
  play(write("wrong.toml", plain),
       {{1, [&](ControlClient& client) {
           refused(client, {{"target", "gyro"}, {"kind", "bais"}, {"value", 1}});
           refused(client, {{"target", "truth"}, {"kind", "lost"}});
           refused(client, {{"target", "wire"}, {"kind", "bus_off"}});
           refused(client, {{"target", "gyro"}, {"kind", "bias"}, {"value", nullptr}});
           refused(client, {{"target", "gyro"}, {"kind", "bias"}, {"value", "much"}});
           refused(client, {{"target", ""}, {"kind", ""}});
           refused(client, {{"target", "gyro"}, {"kind", "bias"}, {"value", 1}, {"for_s", ~std::uint64_t{0}}});
           refused(client, {{"target", "gyro"}, {"kind", "dead"}, {"imu", json::array()}});
           refused(client, {{"target", "gyro"}, {"kind", "dead"}, {"name", "two\nlines"}});
           EXPECT_EQ(client.call("fault.end", {{"name", "none"}})["error"]["code"], -32602);
           client.call("fault.begin", {{"target", "gyro"}, {"kind", "dead"}, {"name", "a"}});
           EXPECT_TRUE(client.call("fault.end", {{"name", "a"}}).contains("result"));
           EXPECT_TRUE(client.call("fault.clear").contains("result"));
         }}});
  ASSERT_EQ(refusals.size(), 10U);
  EXPECT_TRUE(contains(refusals[0], "give faults = true in [control]")) << refusals[0];
  EXPECT_TRUE(refusals[1].starts_with("Invalid params: kind: ") && contains(refusals[1], "did you mean \"bias\"?"))
      << refusals[1];
  EXPECT_TRUE(contains(refusals[2], "lost needs another clock than \"lockstep\"")) << refusals[2];
  EXPECT_TRUE(contains(refusals[3], "is on a line of bytes")) << refusals[3];
  EXPECT_EQ(refusals[4], "Invalid params: value: null is no value");
  EXPECT_TRUE(refusals[5].starts_with("Invalid params: value: ")) << refusals[5];
  EXPECT_TRUE(refusals[6].starts_with("Invalid params: target: empty")) << refusals[6];
  EXPECT_TRUE(refusals[7].starts_with("Invalid params: for_s: ")) << refusals[7];
  EXPECT_EQ(refusals[8], "Invalid params: imu: is an empty list; give \"*\" or of: imu1, imu2");
  EXPECT_TRUE(refusals[9].starts_with("Invalid params: name: has a line feed")) << refusals[9];
}

// A fault of truth that begins after truth 2 acts from truth 3 on, as that of a scenario.
TEST_F(ControlRun, AFaultOfTruthIsThatOfAScenario) {
  const std::string plain = two_imus();
  const auto with_faults = [text = read_file(plain)](const std::string& faults) {
    const std::string table = "[control]\n";
    std::string all = text;
    return all.insert(all.find(table) + table.size(), "faults = true\n") + faults;
  };
  const std::string frozen = "[[fault]]\ntarget = \"truth\"\nkind = \"frozen\"\nat_sample = 3\n";
  const json params = {{"target", "truth"}, {"kind", "frozen"}, {"name", "a"}};
  const auto begin = [&](ControlClient& client) {
    const json answer = client.call("fault.begin", params);
    EXPECT_EQ(answer["result"]["applied"], applied_after(2)) << answer;
  };
  const auto clean = play(write("clean.toml", with_faults("")), {});
  const auto scenario = play(write("scenario.toml", with_faults(frozen)), {});
  const auto ended = play(write("ended.toml", with_faults(frozen + "for_samples = 2\n")), {});
  EXPECT_EQ(play(write("control.toml", with_faults("")), {{2, begin}}), scenario);
  for (const std::string method : {"fault.end", "fault.clear"}) {
    const auto end = [&](ControlClient& client) {
      EXPECT_TRUE(
          client.call(method, method == "fault.end" ? json{{"name", "a"}} : json::object()).contains("result"));
    };
    EXPECT_EQ(play(write("control.toml", with_faults("")), {{2, begin}, {4, end}}), ended) << method;
  }
  EXPECT_EQ(rows_of(scenario.first, 0, 21), rows_of(clean.first, 0, 21));
  EXPECT_NE(scenario, clean);
  EXPECT_NE(scenario, ended);
}

TEST_F(ControlRun, SwitchesThePowerOfOneImu) {
  const Script script = {{2,
                          [](ControlClient& client) {
                            EXPECT_EQ(client.call("power", {{"imu", "imu2"}, {"state", "off"}})["result"]["applied"],
                                      json::array({applied_after(2)[1]}));
                            const json status = client.call("status")["result"];
                            EXPECT_EQ(status["api"], 1);
                            EXPECT_EQ(status["imus"][0]["power"], "on");
                            EXPECT_EQ(status["imus"][1]["power"], "off");
                          }},
                         {3, [](ControlClient& client) {
                            client.call("power", {{"imu", "imu2"}, {"state", "on"}});
                          }}};
  const auto plain = play(two_imus(), {});
  const auto changed = play(two_imus(), script);
  EXPECT_EQ(changed.first, plain.first);
  EXPECT_EQ(rows_of(changed.second, 21, 31).size(), 0U);
  EXPECT_EQ(rows_of(changed.second, 31, 1000), rows_of(plain.second, 31, 1000)) << "nothing is drawn at power on";
}

// A record repeats what the commands did, and the faults that they began, with the labels of the run.
TEST_F(ControlRun, ARecordRepeatsTheCommands) {
  const Script script = {
      {1,
       [](ControlClient& client) {
         client.call("set", {{"imu.imu1.gyro.bias_deg_per_s", 3}});
         client.call("fault.begin", {{"imu", "imu1"}, {"target", "gyro.y"}, {"kind", "noise"}, {"value", 0.5}});
       }},
      {2,
       [](ControlClient& client) {
         client.call("pause", {{"imu", "imu2"}});
         client.call("fault.begin", {{"name", "both"},
                                     {"imu", {"imu1", "imu2"}},
                                     {"target", "accelerometer"},
                                     {"kind", "bias"},
                                     {"value_g", {{"uniform", {0.5, 1.5}}}}});
         client.call(
             "fault.begin",
             {{"imu", "imu1"}, {"target", "wire"}, {"kind", "bit_errors"}, {"value", 0.001}, {"for_s", 0.015}});
       }},
      {3,
       [](ControlClient& client) {
         client.call("resume");
         client.call("mark", {{"text", "here"}});
         client.call("seed", {{"seed", 77}});
         client.call("power", {{"imu", "imu1"}, {"state", "off"}});
       }},
      {4, [](ControlClient& client) {
         client.call("power", {{"imu", "imu1"}, {"state", "on"}});
         client.call("fault.end", {{"name", "both"}});
       }}};
  const std::string plain = read_file(two_imus());
  const std::string config = write("recorded.toml", (plain + "[[fault]]\ntarget = \"gyro.z\"\nkind = "
                                                             "\"bias\"\nvalue = 0.1\nat_s = 0.055\n"));
  const auto [first, second] =
      play(config, script, 6, {"--record", path("record.pcapng"), "--labels", path("labels.csv")});
  EXPECT_EQ(lines_of(second).size(), 1U + 51) << "paused for ten samples";
  EXPECT_NE(read_file(path("record.pcapng")).find("here"), std::string::npos);
  const std::string labels = read_file(path("labels.csv"));
  EXPECT_EQ(lines_of(labels).size(), 1U + 6) << labels;
  const auto replay = [&](const std::string& of) {
    return run_program("imud", {"replay", of, path("record.pcapng"), "--fast", "--labels", path("labels.csv")});
  };
  for (const std::string& of : {config, path("record.pcapng")}) {
    const ProgramResult repeated = replay(of);
    EXPECT_EQ(repeated.exit_code, 0) << repeated.errors;
    EXPECT_EQ(read_file(path("out1")), first);
    EXPECT_EQ(read_file(path("out2")), second);
    EXPECT_EQ(read_file(path("labels.csv")), labels);
  }
  // A configuration that does not permit faults by control cannot repeat them.
  const ProgramResult without =
      run_program("imud", {"replay", config, path("record.pcapng"), "--fast", "--set", "control.faults=false"});
  EXPECT_EQ(without.exit_code, 3) << without.errors;
  EXPECT_TRUE(contains(without.errors, "3 faults that were begun by control cannot be repeated: give faults = true"))
      << without.errors;
}

// A refused batch leaves no fault behind: the numbers of the faults in the record have no gap.
TEST_F(ControlRun, ARecordRepeatsTheFaultsAfterARefusedBatch) {
  const auto fault = [](const std::string& name) {
    return json{{"method", "fault.begin"},
                {"params", {{"name", name}, {"target", "gyro.x"}, {"kind", "bias"}, {"value", 0.1}}}};
  };
  const json nosuch = {{"method", "pause"}, {"params", {{"imu", "nosuch"}}}};
  json refused, accepted, names;
  const auto begin = [&](ControlClient& client) {
    refused = client.call("batch", {{"changes", {fault("a"), nosuch}}});
    const json end = {{"method", "fault.end"}, {"params", {{"name", "a"}}}};
    accepted = client.call("batch", {{"changes", {fault("a"), fault("b"), fault("a"), end}}});
  };
  const auto look = [&](ControlClient& client) {
    const json status = client.call("status");
    for (const json& one : status["result"]["faults"]) names.push_back(one["name"]);
  };
  const auto [first, second] = play(two_imus(), {{2, begin}, {3, look}}, 6, {"--record", path("record.pcapng")});
  EXPECT_TRUE(contains(refused["error"]["message"].get<std::string>(), "there is no such imu")) << refused;
  EXPECT_TRUE(accepted.contains("result")) << accepted;
  EXPECT_EQ(names, json({"b", "b"})) << "on each imu";
  const ProgramResult repeated =
      run_program("imud", {"replay", path("record.pcapng"), path("record.pcapng"), "--fast"});
  EXPECT_EQ(repeated.exit_code, 0) << repeated.errors;
  EXPECT_EQ(read_file(path("out1")), first);
  EXPECT_EQ(read_file(path("out2")), second);
}

TEST_F(ControlRun, OfTwoNamesThatFitTheLongerIsMeant) {
  std::string config = read_file(two_imus());
  config.replace(config.find("\"imu2\""), 6, "\"imu1.b\"");
  const auto set_both = [](ControlClient& client) {
    for (const char* key : {"imu.imu1.b.gyro.bias_deg_per_s", "imu.imu1.gyro.bias_deg_per_s"}) {
      const json answer = client.call("set", {{key, 5}});
      EXPECT_TRUE(answer.contains("result")) << answer;
    }
  };
  play(write("dots.toml", config), {{0, set_both}}, 0);
}

TEST_F(ControlRun, RefusesWhatIsWrongWithClearWords) {
  const Script script = {
      {0, [](ControlClient& client) {
         const auto message = [&](const std::string& method, const json& params) {
           const json error = client.call(method, params)["error"];
           return fmt::format("{} {}", error["code"].get<int>(), error["message"].get<std::string>());
         };
         EXPECT_TRUE(message("begin", json::object()).starts_with("-32601 Method not found"));
         EXPECT_EQ(message("pause", {{"imu", "imu9"}}),
                   "-32602 Invalid params: there is no such imu; there are imu1, imu2");
         EXPECT_EQ(message("pause", {{"imo", "imu1"}}),
                   "-32602 Invalid params: there is no \"imo\"; did you mean \"imu\"?");
         EXPECT_EQ(message("power", {{"state", "of"}}), "-32602 Invalid params: state: give one of off, on, cycle");
         EXPECT_EQ(message("set", {{"truth.when_stopped", "stop"}}),
                   "-32602 Invalid params: truth.when_stopped: give one of hold, flag, silence");
         EXPECT_EQ(message("set", {{"truth.delay_ms", 5}}),
                   "-32001 truth.delay_ms: needs clock = \"realtime\" and live truth");
         EXPECT_TRUE(
             message("set", {{"imu.imu1.rate_hz", 5}})
                 .starts_with("-32602 Invalid params: imu.imu1.rate_hz: cannot change while the run goes on"));
         EXPECT_EQ(message("set", {{"imu.imu1.gyro.bais_rad_per_s", 5}}),
                   "-32602 Invalid params: imu.imu1.gyro.bais_rad_per_s: there is no such key; did you mean "
                   "\"imu.imu1.gyro.bias_rad_per_s\"?");
         EXPECT_EQ(message("set", {{"truth.extrapolate", 5}}),
                   "-32602 Invalid params: truth.extrapolate: there is no such key; did you mean "
                   "\"truth.extrapolate_ms\"?");
         EXPECT_EQ(message("set", {{"imu.imu1.gyro.bias_deg_per_s", 5}, {"imu.imu1.gyro.bias_rad_per_s", 5}}),
                   "-32602 Invalid params: imu.imu1.gyro.bias_rad_per_s: another key of this request sets the same "
                   "value; give one of them");
         EXPECT_EQ(message("subscribe", {{"what", "samples"}, {"decimate", 1.5}}),
                   "-32602 Invalid params: decimate: give a whole number, of so many samples one");
         EXPECT_EQ(message("set", {{"weather", 5}}),
                   "-32602 Invalid params: weather: there is no such key; imud check CONFIG lists all");
         EXPECT_EQ(message("mark", {{"text", "two\nlines"}}), "-32602 text: give one line of 1 to 120 bytes");
         // One wrong change refuses them all.
         EXPECT_TRUE(message("set", {{"truth.extrapolate_ms", 5}, {"seed", -1}}).starts_with("-32602"));
         EXPECT_TRUE(message("batch", {{"changes", {{{"method", "quit"}}}}}).starts_with("-32601"));
         EXPECT_EQ(
             client.call("set", {{"truth.extrapolate_ms", 5}, {"truth.when_stopped", "silence"}})["result"]["applied"]
                 .size(),
             2U);
       }}};
  play(two_imus(), script, 0);
}

TEST_F(ControlRun, SubscribersGetSamplesTruthAndEvents) {
  Program imud("imud");
  start(imud, two_imus());
  ControlClient client(path("socket")), other(path("socket"));
  EXPECT_EQ(client.call("subscribe", {{"what", "samples"}, {"imu", "imu1"}, {"decimate", 5}})["result"],
            json::parse(R"({"subscribed": [{"what": "samples", "imu": "imu1", "decimate": 5}]})"));
  EXPECT_EQ(other.call("subscribe", {{"what", "truth"}, {"rate_hz", 500}})["result"]["subscribed"].size(), 2U);
  EXPECT_TRUE(client.call("subscribe", {{"what", "events"}}).contains("result"));
  for (int i = 0; i <= 2; ++i) simulator_.exchange(Simulator::truth(10 * i, static_cast<std::uint32_t>(i), true));
  json k = json::array();
  while (k.size() < 5) {
    const json samples = client.notification("samples");
    ASSERT_FALSE(samples.is_null());
    EXPECT_EQ(samples["imu"], "imu1");
    EXPECT_EQ(samples["rate"].size(), samples["k"].size());
    for (std::size_t i = 0; i < samples["k"].size(); ++i) {
      // The noise of a sample is below 6 sigma of 0.0046 rad/s; the truth is the analytic motion.
      const int ms = samples["k"][i].get<int>();
      const Truth truth = Simulator::truth(ms, 0, false);
      EXPECT_NEAR(samples["rate"][i][0].get<double>(), samples["true_rate"][i][0].get<double>(), 0.03);
      EXPECT_NEAR(samples["true_rate"][i][0].get<double>(), truth.omega_BN_B[0], 1e-4);
      EXPECT_NEAR(samples["time_s"][i].get<double>(), 1e-3 * ms, 1e-9);
      EXPECT_EQ(samples["attitude"][i].size(), 4U);
      EXPECT_EQ(samples["held"][i], 0);
    }
    k.insert(k.end(), samples["k"].begin(), samples["k"].end());
  }
  EXPECT_EQ(k, json::parse("[0, 5, 10, 15, 20]"));
  json truth_k = json::array();
  while (truth_k.size() < 2) {
    const json truths = other.notification("truth");
    ASSERT_FALSE(truths.is_null());
    truth_k.insert(truth_k.end(), truths["k"].begin(), truths["k"].end());
  }
  EXPECT_EQ(truth_k[1], 2);
  other.call("mark", {{"text", "climb"}});
  json event = client.notification("event");
  if (event["event"] == "run") event = client.notification("event");
  EXPECT_EQ(event["event"], "mark");
  EXPECT_EQ(event["text"], "climb");
  EXPECT_EQ(event["applied"], applied_after(2));
  EXPECT_EQ(client.call("unsubscribe")["result"]["removed"], 2);
  EXPECT_EQ(imud.stop(), 0);
}

TEST_F(ControlRun, SubscribersGetEachBeginningAndEndOfAFault) {
  Program imud("imud");
  const std::string text = read_file(two_imus());
  start(imud, write("faulty.toml", text + "[[fault]]\nname = \"short\"\nimu = \"imu1\"\ntarget = \"gyro.x\"\nkind = "
                                          "\"bias\"\nvalue = 0.1\nat_sample = 5\nfor_samples = 10\n"
                                          "[[fault]]\nname = \"long\"\nimu = \"imu2\"\ntarget = \"gyro.y\"\nkind = "
                                          "\"bias\"\nvalue = 0.2\nat_sample = 21\n"));
  ControlClient client(path("socket"));
  EXPECT_TRUE(client.call("subscribe", {{"what", "events"}}).contains("result"));
  for (int i = 0; i <= 4; ++i) simulator_.exchange(Simulator::truth(10 * i, static_cast<std::uint32_t>(i), true));
  std::vector<std::string> events;
  while (events.size() < 3) {
    const json event = client.notification("event");
    ASSERT_FALSE(event.is_null());
    if (event["event"] == "run") continue;
    events.push_back(fmt::format("{} {} {} {} {}", event["event"].get<std::string>(),
                                 event["name"].get<std::string>(), event["imu"].get<std::string>(),
                                 event["sample"].get<int>(), event["parameters"].dump()));
  }
  EXPECT_EQ(events, (std::vector<std::string>{"fault.begin short imu1 5 {\"value\":0.1}",
                                              "fault.end short imu1 14 {\"value\":0.1}",
                                              "fault.begin long imu2 21 {\"value\":0.2}"}));
  EXPECT_EQ(imud.stop(), 0);
}

TEST_F(ControlRun, CtlFindsTheRunByItsName) {
  const SetVariable runtime("XDG_RUNTIME_DIR", folder_), service("RUNTIME_DIRECTORY", {});
  const auto ctl = [&](std::vector<std::string> arguments) {
    Program program("imud");
    arguments.insert(arguments.begin(), "ctl");
    program.start(arguments);
    const int exit_code = program.wait();
    return std::pair(exit_code, program.output() + program.errors());
  };
  const auto [none, words] = ctl({"list", "--name", "bench"});
  EXPECT_EQ(none, 1);
  // Other tests may run imud meanwhile.
  EXPECT_TRUE(words.starts_with("imud: no imud of this user runs") || words.starts_with("imud: there is no bench"))
      << words;
  Program imud("imud");
  std::string text = read_file(two_imus());
  text.replace(text.find("socket = \"" + path("socket")), 10 + path("socket").size(),
               "name = \"bench\"\nsocket = \"auto");
  start(imud, write("config.toml", text));
  ASSERT_TRUE(imud.wait_for_errors("ready")) << imud.errors();
  EXPECT_TRUE(std::filesystem::is_socket(path("imud-bench.sock")));
  EXPECT_EQ(std::filesystem::status(path("imud-bench.sock")).permissions(),
            std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  simulator_.exchange(Simulator::truth(0, 0, true));
  EXPECT_EQ(ctl({"--name", "bench", "mark", "text=climb begins"}),
            std::pair(0, std::string("imu1: from sample 1, 0.001000 s\nimu2: from sample 1, 0.001000 s\n")));
  EXPECT_EQ(ctl({"--name", "bench", "pause", "imu=imu3"}),
            std::pair(2, std::string("imud: Invalid params: there is no such imu; there are imu1, imu2\n")));
  const auto [listed, list] = ctl({"--name", "bench", "list", "--json"});
  EXPECT_EQ(listed, 0);
  EXPECT_GE(json::parse(list)["keys"].size(), 8U);
  Program second("imud");
  second.start({"run", path("config.toml"), "--set", "imu.0.port=file:" + path("a"), "--set",
                "imu.1.port=file:" + path("b"), "--set", "truth.port=udp:127.0.0.1:0"});
  EXPECT_EQ(second.wait(), 2);
  EXPECT_NE(second.errors().find("an imud of that name runs already"), std::string::npos) << second.errors();
  EXPECT_EQ(ctl({"--name", "bench", "quit"}).first, 0);
  EXPECT_EQ(imud.wait(), 0);
  EXPECT_FALSE(std::filesystem::exists(path("imud-bench.sock")));
}

}  // namespace
}  // namespace imud
