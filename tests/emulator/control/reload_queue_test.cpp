// Reloads that are asked for while another one waits for its sample.
#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <string>

#include "tests/emulator/control/control_client.hpp"
#include "tests/emulator/run/live_test.hpp"

namespace imud {
namespace {

using ReloadQueue = LiveTest;

// The requests of one line are executed before the sampling thread can make the first change.
TEST_F(ReloadQueue, EachIsMadeAfterTheOneBefore) {
  const auto text = [&](double bias) {
    return fmt::format(
        "[realtime]\npriority = 0\nlock_memory = false\n[control]\nsocket = \"{}\"\n[truth]\nport = \"{}\"\n[[imu]]\n"
        "protocol = \"stim300\"\nport = \"file:/dev/null\"\ngyro.bias_rad_per_s = [{}, 0, 0]\n",
        path("socket"), simulator_.port(), bias);
  };
  Program imud("imud");
  start(imud, write("config.toml", text(0.25)));
  ControlClient client(path("socket"));
  write("config.toml", text(0.5));
  constexpr std::size_t most = 16;  // that wait
  nlohmann::json requests = nlohmann::json::array();
  for (std::size_t id = 0; id < most + 2; ++id)
    requests.push_back({{"jsonrpc", "2.0"}, {"method", "reload"}, {"id", id}});
  client.send(requests.dump() + "\n");
  const auto line = client.receive();
  ASSERT_TRUE(line);
  const nlohmann::json answers = nlohmann::json::parse(*line);
  ASSERT_EQ(answers.size(), most + 2) << *line;
  for (const nlohmann::json& answer : answers) {
    const auto id = answer["id"].get<std::size_t>();
    EXPECT_EQ(answer.contains("result"), id <= most) << answer;
    if (id > most) continue;
    EXPECT_EQ(answer["result"]["changed"].size(), id == 0 ? 1U : 0U) << answer;
  }
  EXPECT_EQ(client.call("reload")["result"]["changed"].size(), 0U);
  EXPECT_EQ(imud.stop(), 0) << imud.errors();
}

}  // namespace
}  // namespace imud
