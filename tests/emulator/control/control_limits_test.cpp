// Clients of the control protocol that do not read, and too many of them: imud goes on, within its memory, and counts
// what they lose.
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <string>

#include "emulator/control/control_api.hpp"
#include "emulator/control/control_server.hpp"
#include "emulator/control/send_queue.hpp"
#include "tests/emulator/control/controlled_run.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

using nlohmann::json;

TEST(ControlSendQueue, LosesPointsFirstThenEventsAndRefusesAnswersLast) {
  ControlCounters counters;
  SendQueue queue(counters);
  const auto text = std::make_shared<const std::string>(1000, 'x');
  constexpr int more_than_it_takes = 2000;
  for (int i = 0; i < more_than_it_takes; ++i) queue.notify(text, Notification::points);
  EXPECT_EQ(queue.size(), SendQueue::most_for_points / 1000);
  EXPECT_EQ(counters.notifications_lost, more_than_it_takes - queue.size());
  EXPECT_EQ(counters.events_lost, 0U);
  for (int i = 0; i < more_than_it_takes; ++i) queue.notify(text, Notification::event);
  EXPECT_EQ(queue.size(), SendQueue::most_for_events / 1000);
  EXPECT_EQ(counters.events_lost,
            more_than_it_takes - (SendQueue::most_for_events - SendQueue::most_for_points) / 1000);
  int answers = 0;
  while (queue.add(text)) ++answers;
  EXPECT_EQ(queue.size(), SendQueue::most / 1000);
  EXPECT_GT(answers, 0);
  EXPECT_EQ(counters.clients_closed, 1U);
  while (!queue.empty()) queue.pop();
  EXPECT_EQ(queue.bytes(), 0U);
  queue.notify(text, Notification::points);
  EXPECT_EQ(queue.front(), *text);
}

// Returns the memory of a process, bytes.
std::uint64_t resident_memory(pid_t pid) {
  std::ifstream file(fmt::format("/proc/{}/statm", pid));
  std::uint64_t all = 0, resident = 0;
  file >> all >> resident;
  return resident * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

class ControlLimits : public ControlledRun {
 protected:
  // AddressSanitizer keeps what is freed for a while, up to 256 MB.
  ControlLimits() {
    if (const char* options = std::getenv("ASAN_OPTIONS")) options_ = options;
    ::setenv("ASAN_OPTIONS", (options_ + ":quarantine_size_mb=1").c_str(), 1);
  }
  ~ControlLimits() override { ::setenv("ASAN_OPTIONS", options_.c_str(), 1); }
  std::string options_;
};

// With 240 imus four subscriptions to all of them leave room for 40 of 1000.
TEST_F(ControlLimits, ARefusedSubscriptionLeavesNothing) {
  std::string imus;
  for (int i = 1; i < 240; ++i)
    imus +=
        "[[imu]]\nrate_hz = 1\nprotocol = \"native\"\nport = \"udp:127.0.0.1:9\"\nbefore_first = \"rest\"\n"
        "gyro.max_rad_per_s = 100\naccelerometer.max_m_per_s2 = 1000\n";
  Program imud("imud");
  start(imud, running({}, imus));
  ControlClient first(path("socket")), second(path("socket")), third(path("socket"));
  for (ControlClient* client : {&first, &second})
    for (const char* what : {"samples", "truth"})
      ASSERT_EQ(client->call("subscribe", {{"what", what}})["result"]["subscribed"].size(), 240U);
  EXPECT_EQ(third.call("subscribe", {{"what", "samples"}})["error"]["message"], "there are too many subscriptions");
  EXPECT_EQ(third.call("unsubscribe")["result"]["removed"], 0);
  EXPECT_EQ(first.call("subscribe", {{"what", "samples"}})["result"]["subscribed"].size(), 240U) << "in its place";
  EXPECT_EQ(imud.stop(), 0);
}

TEST_F(ControlLimits, AHundredClientsThatReadNothing) {
  Program imud("imud");
  start(imud, running());
  std::vector<std::unique_ptr<ControlClient>> stalled;
  for (int i = 0; i < 100; ++i) {
    stalled.push_back(std::make_unique<ControlClient>(path("socket")));
    stalled.back()->call("subscribe", {{"what", "samples"}});
    stalled.back()->call("subscribe", {{"what", "events"}});
  }
  ControlClient active(path("socket"));
  const auto lost = [&](const std::string& key) {
    return active.call("status")["result"]["counters"]["control"][key].get<std::uint64_t>();
  };
  const std::uint64_t before = resident_memory(imud.pid()), samples_before = samples(active);
  // A flood of events, until there is no room for them either: 0.5 MiB for each client.
  const std::string mark = fmt::format(
      "{{\"jsonrpc\":\"2.0\",\"method\":\"mark\",\"params\":{{\"text\":\"{}\"}},\"id\":1}}\n", std::string(120, 'a'));
  constexpr int at_once = 200;
  for (int i = 0; i < 100 && lost("events_lost") < stalled.size(); ++i) {
    for (int k = 0; k < at_once; ++k) ASSERT_TRUE(active.send(mark));
    for (int k = 0; k < at_once; ++k) ASSERT_TRUE(active.receive());
  }
  EXPECT_GE(lost("events_lost"), stalled.size());
  EXPECT_GT(lost("notifications_lost"), 0U);
  EXPECT_EQ(lost("clients_closed"), 0U);
  EXPECT_GT(samples(active), samples_before);
  constexpr std::uint64_t bound = 100 * SendQueue::most_for_events;  // if no text were shared
  EXPECT_LT(resident_memory(imud.pid()), before + bound);
  // More clients than there may be.
  std::vector<std::unique_ptr<ControlClient>> many;
  const std::size_t free = ControlServer::most_clients - stalled.size() - 1;
  constexpr int too_many = 20;
  for (std::size_t i = 0; i < free + too_many; ++i) many.push_back(std::make_unique<ControlClient>(path("socket")));
  const auto served =
      std::count_if(many.begin(), many.end(), [](auto& client) { return client->call("status").contains("result"); });
  EXPECT_EQ(served, static_cast<std::ptrdiff_t>(free));
  EXPECT_EQ(lost("connections_refused"), too_many);
  // A client that sends requests with long answers, and reads none of them.
  many.clear();
  std::unique_ptr<ControlClient> deaf;
  while (!deaf || !deaf->call("status").contains("result")) deaf = std::make_unique<ControlClient>(path("socket"));
  const std::string list = "{\"jsonrpc\": \"2.0\", \"method\": \"list\", \"id\": 1}\n";
  for (int i = 0; i < 10'000 && lost("clients_closed") == 0; ++i)
    for (int k = 0; k < 50; ++k) deaf->send_some(list);
  EXPECT_EQ(lost("clients_closed"), 1U);
  // One of those that read nothing begins to, and gets its events in order, with a gap at their end alone.
  const json event = stalled[0]->notification("event");
  EXPECT_EQ(event["event"], "mark");
  EXPECT_EQ(imud.stop(), 0);
  EXPECT_GE(summary()["control"]["connections_refused"], too_many);
  EXPECT_EQ(summary()["control"]["clients_closed"], 1);
  EXPECT_TRUE(contains(imud.output(), " connections refused, 1 clients closed that read no answers"))
      << imud.output();
}

// The table of the methods in emulator/control/README.md.
TEST(ControlReadme, HasEveryMethod) {
  std::ifstream file(IMUD_SOURCE_DIR "/emulator/control/README.md");
  std::string first_cells;
  for (std::string line; std::getline(file, line);)
    if (line.starts_with("| `")) first_cells += line.substr(0, line.find(" |", 1));
  for (const ControlApi::Method& method : ControlApi::methods())
    EXPECT_TRUE(contains(first_cells, fmt::format("`{}`", method.name))) << method.name;
}

}  // namespace
}  // namespace imud
