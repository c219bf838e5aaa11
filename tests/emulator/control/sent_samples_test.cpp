// `sent` of the samples for those who watch: which of them have left the imu.
#include <atomic>

#include "tests/emulator/control/controlled_run.hpp"

namespace imud {
namespace {

using nlohmann::json;

class SentSamples : public ControlledRun {
 protected:
  // Sends truth at 100 Hz by the host's clock while `has_truth`, until it is destroyed.
  std::jthread truth() {
    return std::jthread([this](const std::stop_token& stop) {
      const auto begin = std::chrono::steady_clock::now();
      for (std::uint32_t i = 0; !stop.stop_requested(); ++i) {
        if (has_truth_) simulator_.send(Simulator::encode(Simulator::truth(10 * std::int64_t{i}, i, false)));
        std::this_thread::sleep_until(begin + (i + 1) * std::chrono::milliseconds(10));
      }
    });
  }
  std::atomic<bool> has_truth_ = true;
};

// Reads samples until `count` of them are after `first`; each of these is `sent` or not.
void expect_from(ControlClient& client, std::uint64_t first, bool sent, int count = 30) {
  while (count > 0) {
    const json samples = client.notification("samples");
    ASSERT_FALSE(samples.is_null());
    ASSERT_EQ(samples["sent"].size(), samples["k"].size());
    for (std::size_t i = 0; i < samples["k"].size(); ++i) {
      const auto k = samples["k"][i].get<std::uint64_t>();
      if (k < first) {
        EXPECT_NE(samples["sent"][i].get<bool>(), sent) << k << " before " << first;
        continue;
      }
      EXPECT_EQ(samples["sent"][i].get<bool>(), sent) << k << " from " << first;
      --count;
    }
  }
}

TEST_F(SentSamples, NothingLeavesWhilePausedAndWithoutPower) {
  Program imud("imud");
  start(imud, running());
  ControlClient client(path("socket")), commands(path("socket"));
  ASSERT_TRUE(client.call("subscribe", {{"what", "samples"}, {"decimate", 10}}).contains("result"));
  expect_from(client, 0, true);
  const auto from = [&](const char* method, const json& params = json::object()) {
    return commands.call(method, params)["result"]["applied"][0]["sample"].get<std::uint64_t>();
  };
  expect_from(client, from("pause"), false);
  expect_from(client, from("resume"), true);
  expect_from(client, from("power", {{"state", "off"}}), false);
  expect_from(client, from("power", {{"state", "on"}}), true);
  EXPECT_EQ(imud.stop(), 0);
}

TEST_F(SentSamples, NothingLeavesWhileASensorIsSilentForWantOfTruth) {
  Program imud("imud");
  start(imud, running({}, "extrapolate_ms = 50\nwhen_stopped = \"silence\"\n"));
  ControlClient client(path("socket"));
  const std::jthread sender = truth();
  ASSERT_TRUE(client.call("subscribe", {{"what", "samples"}, {"decimate", 10}}).contains("result"));
  // Returns true if a sample comes that is sent, or not, in agreement with the count of silent ones.
  const auto comes = [&](bool sent) {
    for (int i = 0; i < 200; ++i) {
      const json samples = client.notification("samples");
      if (samples.is_null()) return false;
      if (samples["sent"].back() == sent && (samples["silent"].back() > 0) != sent) return true;
    }
    return false;
  };
  EXPECT_TRUE(comes(true));
  has_truth_ = false;
  EXPECT_TRUE(comes(false));
  EXPECT_EQ(imud.stop(), 0);
}

}  // namespace
}  // namespace imud
