// Damaged records: none makes a repetition crash or hang, and each is repeated, refused, or reported as damaged. The
// environment variable IMUD_FUZZ_INPUTS sets their number. The seed is fixed.
#include <cstdlib>
#include <random>

#include "emulator/config/load_config.hpp"
#include "tests/emulator/record/record_test.hpp"

namespace imud {
namespace {

class RecordFuzz : public RecordTest {
 protected:
  // Two imus in real time, one with a host, from power-on to an end, with a power cycle and a restart of the truth.
  void SetUp() override {
    config_ = load_config(write("config.toml", R"(clock = "realtime"
truth.port = "udp:127.0.0.1:9810"
[[imu]]
protocol = "native"
port = "file:a"
rate_hz = 200
before_first = "rest"
gyro.max_rad_per_s = 100
accelerometer.max_m_per_s2 = 1000
[[imu]]
protocol = "stim300"
port = "file:b"
)"));
    Recorder recorder(options(), true);
    SimulatedRun run(config_);
    run.recorder = &recorder;
    run.make_sensor = [&](SimulatedHost&) { return std::make_unique<KeptLine>(sent_); };
    for (int k = 0; k < 60; ++k) run.truth(0.3 + 0.01 * k, Swing::truth(at_s(0.01 * k - (k > 30 ? 100 : 0))));
    HostTime power_at = run.at(0.7);
    run.host().on_wait = [&] {
      if (run.host().now() < power_at) return;
      power_at = SimulatedHost::never;
      run.engine().power_cycle.make();
    };
    run.run(1);
    recorder.finish();
    whole_ = read_file(path("run.pcapng"));
    config_.truth.port = "record:" + path("run.pcapng");
    config_.clock = ClockMode::fast;
  }

  enum class Result : std::uint8_t { repeated, refused, reported };
  Result repeat_bytes(const std::string& bytes) {
    write("run.pcapng", bytes);
    try {
      Assembly run(config_, [&](const PortUse&) { return std::make_unique<KeptLine>(sent_); }, {.repeats = true});
      sent_.clear();
      SimulatedHost host;
      host.end = SimulatedHost::never;
      run.run(host, host.stop);
      return run.difference().empty() && run.engine().intake().end_warning().empty() ? Result::repeated
                                                                                     : Result::reported;
    } catch (const PortError& error) {
      EXPECT_NE(std::string(error.what()), "");
      return Result::refused;
    }
  }

  Config config_;
  std::string whole_, sent_;
};

TEST_F(RecordFuzz, NoDamageMakesARepetitionCrash) {
  ASSERT_GT(whole_.size(), 100'000U);
  ASSERT_EQ(repeat_bytes(whole_), Result::repeated);
  const std::string sent = sent_;
  const char* set = std::getenv("IMUD_FUZZ_INPUTS");
  const int inputs = set == nullptr ? 200 : std::atoi(set);
  std::mt19937 random(4);
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  std::array<int, 3> results{};
  for (int i = 0; i < inputs; ++i) {
    std::string bytes = whole_;
    if (i % 8 == 0) bytes.resize(below(bytes.size()));
    const std::size_t first = i % 4 == 1 ? 0 : bytes.size() / 8;  // beyond the configuration, in most
    for (std::size_t n = bytes.empty() ? 0 : 1 + below(8); n > 0; --n) {
      char& byte = bytes[first + below(bytes.size() - first)];
      byte = static_cast<char>(below(2) == 0 ? below(256) : static_cast<unsigned char>(byte) ^ (1U << below(8)));
    }
    if (i % 16 == 3) bytes.erase(first, 4 * below(100));
    ++results[static_cast<std::size_t>(repeat_bytes(bytes))];
  }
  EXPECT_GT(results[0] + results[2], inputs / 4);
  EXPECT_GT(results[2], inputs / 8);
  EXPECT_EQ(repeat_bytes(whole_), Result::repeated);
  EXPECT_TRUE(sent_ == sent);
}

// Each event in turn has a time that no run has.
TEST_F(RecordFuzz, ImpossibleTimesAreReported) {
  std::array<int, 3> results{};
  std::size_t block = 0;
  for (std::size_t at = 0; at + 12 < whole_.size(); ++block) {
    std::uint32_t type = 0, length = 0, interface = 0;
    std::memcpy(&type, &whole_[at], 4);
    std::memcpy(&length, &whole_[at + 4], 4);
    std::memcpy(&interface, &whole_[at + 8], 4);
    constexpr std::size_t to_event = 28, begin_of_times = 8;
    if (type == 6 && interface == 0 && block % 37 == 0) {
      std::string bytes = whole_;
      for (std::size_t i = 0; i < 24; ++i) bytes[at + to_event + begin_of_times + i] = i % 8 == 7 ? 0x7F : 0;
      ++results[static_cast<std::size_t>(repeat_bytes(bytes))];
    }
    at += length;
  }
  EXPECT_EQ(results[0], 0);
  EXPECT_GT(results[2], 20);
}

}  // namespace
}  // namespace imud
