// Samples for those who watch: whether a sample has left the imu, and the solution of a unit that computes its
// own.
#include <algorithm>
#include <atomic>
#include <cmath>

#include "core/units.hpp"
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
  // After a stall the automatic delay may be seconds, in which samples still have truth.
  const auto comes = [&](bool sent) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (std::chrono::steady_clock::now() < end) {
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

// At rest the inclinometers of a STIM300 measure gravity, with errors of their own; a MIP unit has none.
TEST_F(SentSamples, AUnitWithInclinometersShowsWhatTheyMeasure) {
  std::string config = fmt::format("clock = \"lockstep\"\n[control]\nsocket = \"{}\"\n[truth]\nport = \"{}\"\n",
                                   path("socket"), simulator_.port());
  for (const char* const protocol : {"stim300", "mip"})
    config += fmt::format("[[imu]]\nname = \"{0}\"\nprotocol = \"{0}\"\nport = \"udp:127.0.0.1:9\"\n", protocol);
  Program imud("imud");
  start(imud, write("config.toml", config));
  Truth truth;
  truth.acknowledge = truth.has_specific_force = true;
  truth.specific_force_B = {0, 0, -units::standard_gravity};
  json samples[2];
  for (const std::size_t imu : {0U, 1U}) {
    ControlClient client(path("socket"));
    const json wanted = {{"what", "samples"}, {"imu", imu == 0 ? "stim300" : "mip"}};
    ASSERT_TRUE(client.call("subscribe", wanted).contains("result"));
    for (int i = 0; i < 10; ++i, ++truth.sequence, truth.time.ns += 20'000'000)
      ASSERT_TRUE(simulator_.exchange(truth)) << truth.sequence;
    samples[imu] = client.notification("samples");
    ASSERT_FALSE(samples[imu].is_null());
  }
  ASSERT_TRUE(samples[0].contains("inclination")) << samples[0];
  ASSERT_EQ(samples[0]["inclination"].size(), samples[0]["k"].size());
  const json inclination = samples[0]["inclination"].back(), force = samples[0]["specific_force"].back();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(inclination.at(axis).get<double>(), axis == 2 ? -units::standard_gravity : 0, 0.2) << axis;
    // Single precision rounds this by less than 1e-6 m/s^2.
    EXPECT_GT(std::abs(inclination.at(axis).get<double>() - force.at(axis).get<double>()), 1e-5) << axis;
  }
  EXPECT_FALSE(samples[1].contains("inclination")) << samples[1];
  EXPECT_EQ(imud.stop(), 0);
}

// A vehicle at rest at 48 degrees north, 500 m high.
TEST_F(SentSamples, AUnitWithAFilterShowsItsSolutionWithItsErrors) {
  const std::string config = write(
      "config.toml",
      fmt::format("clock = \"lockstep\"\n[control]\nsocket = \"{}\"\n[truth]\nport = \"{}\"\n[earth]\nframe = "
                  "\"local\"\nlatitude_deg = 48\nlongitude_deg = 11\nheight_m = 500\n[[imu]]\nprotocol = \"mip\"\n"
                  "port = \"udp:127.0.0.1:9\"\ndevice.model = \"3dm-gx5-45\"\n"
                  "navigation.solution = \"filter\"\n",
                  path("socket"), simulator_.port()));
  Program imud("imud");
  start(imud, config);
  ControlClient client(path("socket"));
  ASSERT_TRUE(client.call("subscribe", {{"what", "samples"}, {"decimate", 2500}}).contains("result"));
  Truth truth;
  truth.acknowledge = truth.has_position = truth.has_velocity = truth.has_specific_force = true;
  truth.specific_force_B = {0, 0, -units::standard_gravity};
  constexpr int seconds = 30, rate_hz = 50;
  for (int i = 0; i <= seconds * rate_hz; ++i, ++truth.sequence) {
    truth.time.ns = std::int64_t{i} * (1'000'000'000 / rate_hz);
    ASSERT_TRUE(simulator_.exchange(truth)) << i;
  }
  // Returns the first or the last sample of a notification.
  const auto sample_of = [](const json& samples, bool is_first) {
    json one;
    for (const auto& [key, list] : samples.items())
      if (list.is_array()) one[key] = is_first ? list.front() : list.back();
    return one;
  };
  json first, last;
  for (std::uint64_t k = 0; k < 30000; k = last["k"].get<std::uint64_t>()) {
    const json samples = client.notification("samples");
    ASSERT_FALSE(samples.is_null());
    if (first.is_null()) first = sample_of(samples, true);
    last = sample_of(samples, false);
  }
  EXPECT_EQ(first["solution"], "aligning");
  EXPECT_EQ(last["solution"], "aided");
  const json& used = last["aids_used"];
  EXPECT_NE(std::ranges::find(used, "gnss_position"), used.end()) << used;
  for (const std::string part : {"attitude", "velocity", "position"})
    for (std::size_t i = 0; i < 3; ++i) {
      const double error = last[part + "_error"].at(i), sigma = last[part + "_sigma"].at(i);
      EXPECT_GT(sigma, 0) << part;
      EXPECT_LT(std::abs(error), 8 * sigma) << part << i;
      EXPECT_NE(error, 0) << part << i;
    }
  // The filter's place, which has 10 cm of error or more, less the true one. A float has 1e-7 of it.
  constexpr double meridian_m = 6'371'000;  // the radius, to 1 %
  const double latitude = last["position"].at(0), height = last["position"].at(2);
  const double north = (latitude - 48 * units::degree) * meridian_m;
  EXPECT_NEAR(last["position_error"].at(2).get<double>(), 500 - height, 1e-4);
  EXPECT_NEAR(last["position_error"].at(0).get<double>(), north, 0.01 * std::abs(north) + 1e-3);
  EXPECT_EQ(imud.stop(), 0);
}

}  // namespace
}  // namespace imud
