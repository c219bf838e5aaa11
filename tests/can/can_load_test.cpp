// The load of a bus that `imud check` prints, against that which canbusload of can-utils measures on it. Runs in
// tools/with-vcan.
#include <array>
#include <chrono>
#include <sstream>
#include <thread>

#include "tests/can/can_unit.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

struct Measured {
  std::uint64_t frames = 0, bits = 0;
};

// The sums over the seconds that canbusload has printed for an interface:
// "vcan0@1000000  <frames>  <bits>  <data bits>  <load>%".
Measured sums(const std::string& text, const std::string& interface) {
  Measured all;
  std::istringstream words(text);
  for (std::string word; words >> word;)
    if (word.starts_with(interface + "@")) {
      Measured second;
      words >> second.frames >> second.bits;
      all.frames += second.frames;
      all.bits += second.bits;
    }
  return all;
}

// Each unit has a bus of its own. A guest that is held up loses frames of a burst, which begins with those of one
// unit: on one bus, frames of other lengths would be missing than those that arrive.
constexpr std::array<const char*, 4> buses = {"vcan0", "imudload1", "imudload2", "imudload3"};

class CanLoadTest : public CanUnitTest {
 protected:
  CanLoadTest() {
    for (std::size_t i = 1; i < buses.size(); ++i) {
      EXPECT_TRUE(ip(fmt::format("link add {} type vcan", buses[i])));
      EXPECT_TRUE(ip(fmt::format("link set {} up", buses[i])));
    }
  }
  ~CanLoadTest() override {
    for (std::size_t i = 1; i < buses.size(); ++i) EXPECT_TRUE(ip(fmt::format("link del {}", buses[i])));
  }
};

std::uint64_t sent_on(const std::string& interface) {
  return std::stoul(read_file("/sys/class/net/" + interface + "/statistics/tx_packets"));
}

TEST_F(CanLoadTest, IsTheOneThatCanbusloadMeasures) {
  const std::string config =
      write_config("realtime", unit("dronecan", "device.sample_rate_hz = 200", buses[0]) +
                                   unit("j1939", "", buses[1]) + unit("sbg-can", "", buses[2]) +
                                   unit("bosch-mm7", "", buses[3]) + "[realtime]\nskip_after_ms = 3600000\n");
  const ProgramResult check = run_program("imud", {"check", "--json", config});
  ASSERT_EQ(check.exit_code, 0) << check.errors;
  const auto checked = nlohmann::json::parse(check.output);

  std::vector<std::string> monitored = {"-e"};
  for (const char* const bus : buses) monitored.push_back(fmt::format("{}@1000000", bus));
  Program load("/usr/bin/canbusload");
  load.start(monitored);
  ASSERT_TRUE(eventually([] {
    const std::string receivers = read_file("/proc/net/can/rcvlist_all");
    return std::all_of(buses.begin(), buses.end(), [&](const char* bus) {
      return receivers.find(fmt::format(" {} ", bus)) != std::string::npos;
    });
  }));
  Program imud("imud");
  const std::uint64_t before = sent_on(buses[0]);
  start(imud, config);
  // Not for a time: a slow guest takes seconds to start.
  ASSERT_TRUE(eventually([before] { return sent_on(buses[0]) > before + 4000; }));
  EXPECT_EQ(imud.stop(), 0) << imud.errors();
  const nlohmann::json run = summary();
  std::this_thread::sleep_for(2500ms);  // canbusload prints each second
  load.stop(SIGINT);

  double checked_percent = 0, measured_percent = 0;
  for (std::size_t i = 0; i < buses.size(); ++i) {
    const nlohmann::json& line = checked["imus"][i]["lines"][0];
    const double average = line["average_bits_per_s"], frames_per_s = line["frames_per_s"];
    EXPECT_NEAR(average / 1e4, checked["buses"][i]["average_percent"], 1e-9) << buses[i];
    const Measured measured = sums(load.output(), buses[i]);
    ASSERT_GT(measured.frames, 200U) << buses[i] << '\n' << load.output();
    EXPECT_LE(measured.frames, run["imus"][i]["frames"]) << buses[i];
    // The guest may be held up, and not be in time: the bits of a frame are compared, not those of a second.
    const double percent =
        static_cast<double>(measured.bits) / static_cast<double>(measured.frames) * frames_per_s / 1e4;
    EXPECT_NEAR(average / 1e4, percent, 1) << buses[i];
    checked_percent += average / 1e4;
    measured_percent += percent;
  }
  EXPECT_GT(checked_percent, 30);
  EXPECT_NEAR(checked_percent, measured_percent, 1);
}

}  // namespace
}  // namespace imud
