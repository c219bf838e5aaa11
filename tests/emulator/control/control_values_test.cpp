// Keys that change a run in real time, and its figures for those who watch.
#include <fmt/format.h>

#include <atomic>

#include "emulator/control/running_keys.hpp"
#include "emulator/truth/truth_clock.hpp"
#include "tests/emulator/control/controlled_run.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

using nlohmann::json;

class ControlValues : public ControlledRun {
 protected:
  // Sends truth at 100 Hz by the host's clock until it is destroyed.
  std::jthread truth() {
    return std::jthread([this](const std::stop_token& stop) {
      const auto begin = std::chrono::steady_clock::now();
      for (std::uint32_t i = 0; !stop.stop_requested(); ++i) {
        simulator_.send(Simulator::encode(Simulator::truth(10 * std::int64_t{i}, i, false)));
        std::this_thread::sleep_until(begin + (i + 1) * std::chrono::milliseconds(10));
      }
    });
  }
};

TEST_F(ControlValues, TheDelayIsSlewedToItsNewValue) {
  Program imud("imud");
  std::string config = read_file(running());
  config.replace(config.find("delay_ms = 0"), 12, "delay_ms = 30");
  start(imud, write("delay.toml", config));
  ControlClient client(path("socket"));
  const std::jthread sender = truth();
  const auto delay_us = [&] { return client.call("status")["result"]["counters"]["truth"].value("delay_us", 0.0); };
  ASSERT_TRUE(eventually([&] { return std::abs(delay_us() - 30'000) < 1; })) << delay_us();
  EXPECT_EQ(client.call("set", {{"truth.delay_ms", 40}})["result"]["applied"].size(), 1U);
  EXPECT_TRUE(eventually([&] { return std::abs(delay_us() - 40'000) < 1; })) << delay_us();
  for (const json& wrong : {json(-1), json(1001), json("automatic"), json(nullptr)})
    EXPECT_EQ(client.call("set", {{"truth.delay_ms", wrong}})["error"]["message"],
              "Invalid params: truth.delay_ms: give a number from 0 to 1000, or \"auto\"");
  EXPECT_NEAR(delay_us(), 40'000, 1);
  // By the arrivals, which are a few ms late at most on a machine that is not overloaded: any other value.
  EXPECT_TRUE(client.call("set", {{"truth.delay_ms", "auto"}}).contains("result"));
  EXPECT_TRUE(eventually([&] { return std::abs(delay_us() - 40'000) > 10; })) << delay_us();
  EXPECT_EQ(imud.stop(), 0);
}

TEST(RunningKeys, TheDelayIsSlewedAsItsMeaningSays) {
  EXPECT_TRUE(contains(running_keys_json().dump(),
                       fmt::format("by at most {:g} % of the time that passes", 100 * TruthClock::largest_slew)));
}

TEST_F(ControlValues, TheLogHasWhatItsLevelAdmits) {
  Program imud("imud");
  start(imud, running());
  ControlClient client(path("socket"));
  const auto mark = [&](const std::string& text) {
    EXPECT_TRUE(client.call("mark", {{"text", text}}).contains("result"));
  };
  mark("before");
  EXPECT_TRUE(client.call("set", {{"log.level", "quiet"}}).contains("result"));
  mark("unheard");
  EXPECT_TRUE(client.call("set", {{"log.level", "normal"}}).contains("result"));
  mark("after");
  ASSERT_TRUE(imud.wait_for_errors("mark: after"));
  EXPECT_TRUE(contains(imud.errors(), "mark: before"));
  EXPECT_FALSE(contains(imud.errors(), "unheard")) << imud.errors();
  EXPECT_EQ(client.call("set", {{"log.level", "loud"}})["error"]["message"],
            "Invalid params: log.level: give one of quiet, normal, verbose");
  EXPECT_EQ(imud.stop(), 0);
}

// As `--quality` has them: what was counted since the notification before.
TEST_F(ControlValues, CountersAreThoseOfTheInterval) {
  Program imud("imud");
  start(imud, running());
  ControlClient client(path("socket"));
  ASSERT_TRUE(eventually([&] { return samples(client) > 1000; }));
  const std::uint64_t before = samples(client);
  EXPECT_EQ(client.call("subscribe", {{"what", "counters"}})["result"]["subscribed"],
            json::parse(R"([{"what": "counters"}])"));
  std::uint64_t sum = 0;
  for (int i = 0; i < 2; ++i) {
    const json counters = client.notification("counters");
    ASSERT_FALSE(counters.is_null());
    const auto counted = counters["imus"][0]["samples"].get<std::uint64_t>();
    EXPECT_GT(counted, 0U);
    EXPECT_GE(counters["duration_s"].get<double>(), 0.99);
    EXPECT_EQ(counters["truth"]["accepted"], 0);
    sum += counted;
  }
  EXPECT_LE(sum, samples(client) - before);
  EXPECT_EQ(client.call("unsubscribe", {{"what", "counters"}})["result"]["removed"], 1);
  EXPECT_EQ(imud.stop(), 0);
}

}  // namespace
}  // namespace imud
