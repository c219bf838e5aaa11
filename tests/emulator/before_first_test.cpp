// Sensors that have power before the first truth, on a simulated host: they start up, answer, and sample a vehicle at
// rest; then the simulator takes over.
#include <string>

#include "emulator/config/load_config.hpp"
#include "tests/emulator/run/realtime_test.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

class BeforeFirstTest : public RealtimeTest {
 protected:
  static void send(SimulatedRun& run, double arrival_s, double for_s, double truth_s) {
    for (int k = 0; k <= std::lround(100 * for_s); ++k)
      run.truth(arrival_s + 0.01 * k, Swing::truth(TruthTime{} + nanoseconds(truth_s + 0.01 * k)));
  }
};

TEST_F(BeforeFirstTest, ASensorAtRestIsTakenOverWithoutAGap) {
  SimulatedRun run(config(1000, "delay_ms = 20", "before_first = \"rest\"\nclock_error_ppm = 200"));
  send(run, 60, 2, 1000);
  run.run(62);
  const std::vector<Left>& left = run.left();
  ASSERT_GT(left.size(), 61'900U);
  // Power comes on at the grid's start.
  expect_grid(left, Grid(1000, 200), left[0].time, 50us);
  EXPECT_EQ(left[0].sample.time, DeviceTime{0});
  std::size_t at_rest = 0;
  for (std::size_t k = 0; k < left.size(); ++k) {
    const Sample& sample = left[k].sample;
    const bool rests = run.since_begin(left[k].time) < 60.02;
    at_rest += rests;
    ASSERT_EQ(sample.status, rests ? status::at_rest : 0U) << k;
    if (rests) {
      ASSERT_EQ(sample.rate, Vector3(0, 0, 0));
      ASSERT_EQ(sample.specific_force, Vector3(0, 0, -9.80665));
      ASSERT_LT((sample.delta_velocity - Vector3(0, 0, k == 0 ? 0 : -9.80665e-3)).norm(), 1e-5);
    }
  }
  EXPECT_NEAR(static_cast<double>(at_rest), 60'020 * 1.0002, 5);
  EXPECT_EQ(run.counters().at_rest, at_rest);
  EXPECT_EQ(left[at_rest].sample.delta_velocity, Vector3(0, 0, 0)) << "nothing connects rest and truth";
  EXPECT_NEAR(left[at_rest].sample.rate.z(), Swing::truth(TruthTime{1000'000'000'000}).omega_BN_B.z(), 0.02);
  EXPECT_EQ(run.counters().held, 0U);
  EXPECT_EQ(run.quality().stops, 0U);
}

TEST_F(BeforeFirstTest, ASilentSensorBeginsWithTheFirstTruth) {
  SimulatedRun run(config(1000, "delay_ms = 20"));
  send(run, 5, 1, 7);
  run.run(6);
  ASSERT_GT(run.left().size(), 950U);
  expect_grid(run.left(), Grid(1000), run.at(5.02), 50us);
  EXPECT_EQ(run.left()[0].sample.time, DeviceTime{7'000'000'000});
  EXPECT_EQ(run.counters().at_rest, 0U);
}

// The pty of a product: its frames with their times, and a host that writes at given times.
class Line final : public Port {
 public:
  struct Chunk {
    HostTime time;
    std::string bytes;
  };
  explicit Line(SimulatedHost& host, std::vector<Chunk>& sent, std::vector<Chunk> host_writes)
      : host_(host), sent_(sent), host_writes_(std::move(host_writes)) {}
  void send(std::span<const Frame> frames) noexcept override {
    for (const Frame& frame : frames)
      sent_.push_back({host_.now(), {reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size()}});
    counters_.count_sent(is_reply_, frames.size());
  }
  std::optional<Received> receive() noexcept override {
    if (next_ == host_writes_.size() || host_writes_[next_].time > host_.now()) return std::nullopt;
    return Received{{std::as_bytes(std::span(host_writes_[next_++].bytes))}, host_.now()};
  }

 private:
  SimulatedHost& host_;
  std::vector<Chunk>& sent_;
  std::vector<Chunk> host_writes_;
  std::size_t next_ = 0;
};

class ProductBeforeFirst : public BeforeFirstTest {
 protected:
  // Runs the configuration `keys` for `for_s`, without truth unless `send_truth` sends some.
  std::vector<Line::Chunk> run(const std::string& keys, double for_s,
                               std::vector<std::pair<double, std::string>> writes = {},
                               void (*send_truth)(SimulatedRun& run) = nullptr) {
    SimulatedRun run(load_config(write("config.toml",
                                       "clock = \"realtime\"\n[truth]\nport = \"udp:127.0.0.1:9810\"\n"
                                       "[[imu]]\nport = \"pty:imu\"\n" +
                                           keys)));
    std::vector<Line::Chunk> sent, host_writes;
    for (const auto& [time_s, bytes] : writes) host_writes.push_back({run.at(time_s), bytes});
    run.make_sensor = [&](SimulatedHost& host) { return std::make_unique<Line>(host, sent, host_writes); };
    if (send_truth != nullptr) send_truth(run);
    run.run(for_s);
    replies_ = run.counters().replies;
    frames_ = run.counters().frames;
    begin_ = run.at(0);
    return sent;
  }
  static std::size_t count(const std::vector<Line::Chunk>& sent, std::string_view begin) {
    return static_cast<std::size_t>(
        std::count_if(sent.begin(), sent.end(), [&](const auto& chunk) { return chunk.bytes.starts_with(begin); }));
  }
  std::uint64_t replies_ = 0, frames_ = 0;
  HostTime begin_;
};

const std::string ping("\x75\x65\x01\x02\x02\x01\xE0\xC6", 8), pong("\x75\x65\x01\x04\x04\xF1\x01\x00\xD5\x6A", 10);

TEST_F(ProductBeforeFirst, AMipDeviceStreamsAndAnswers) {
  const auto sent = run("protocol = \"mip\"", 10, {{5, ping}});
  EXPECT_NEAR(static_cast<double>(count(sent, "\x75\x65\x80")), 1000, 3);
  EXPECT_EQ(count(sent, pong), 1U);
  EXPECT_EQ(replies_, 1U);
  EXPECT_EQ(frames_, sent.size() - 1);
}

// An unfinished command is discarded, although no sample ever arrives.
TEST_F(ProductBeforeFirst, AMipDeviceDiscardsACutCommandWhileItIsSilent) {
  const auto sent = run("protocol = \"mip\"\nbefore_first = \"silence\"", 10,
                        {{1, std::string("\x75\x65\x01\xff", 4)}, {3, ping}, {5, ping}, {7, ping}});
  EXPECT_EQ(count(sent, "\x75\x65\x80"), 0U);
  EXPECT_EQ(count(sent, pong), 3U);
}

TEST_F(ProductBeforeFirst, AVectorNavStreamsAndAnswers) {
  const auto sent = run("protocol = \"vectornav\"", 10, {{5, "$VNRRG,01*72\r\n"}});
  EXPECT_NEAR(static_cast<double>(count(sent, "$VNYMR,")), 400, 3);
  EXPECT_EQ(count(sent, "$VNRRG,01,VN-100"), 1U);
}

// Part number, serial number and configuration after 0.1 s, with measurements or without.
TEST_F(ProductBeforeFirst, AStim300StartsUp) {
  constexpr std::array<unsigned char, 3> specials = {0xB1, 0xB5, 0xBC};
  for (const std::string before : {"rest", "silence"}) {
    const auto sent = run("protocol = \"stim300\"\nbefore_first = \"" + before + "\"", 3, {{2, "SERVICEMODE\r"}});
    ASSERT_GT(sent.size(), 3U);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(static_cast<unsigned char>(sent[i].bytes[0]), specials[i]);
      EXPECT_NEAR(seconds(sent[i].time - begin_), 0.102, 0.003);
    }
    EXPECT_EQ(count(sent, "\xA7") > 1500, before == "rest");
    EXPECT_GT(replies_, 0U) << before;
  }
}

// A rig whose simulator waits for the flight computer, and that one for its sensor, must start.
TEST_F(ProductBeforeFirst, AStim300ExecutesTheCommandsOfNormalMode) {
  for (const std::string before : {"rest", "silence"}) {
    SCOPED_TRACE(before);
    const auto sent = run("protocol = \"stim300\"\nbefore_first = \"" + before + "\"", 4,
                          {{1, "N\r"}, {1.2, "I\r"}, {1.4, "C\r"}, {1.6, "T\r"}, {1.8, "E\r"}, {2, "R\r"}});
    std::vector<std::pair<std::string, double>> specials;
    for (const Line::Chunk& chunk : sent)
      if (!chunk.bytes.starts_with("\xA7"))
        specials.emplace_back(chunk.bytes.substr(0, 1), seconds(chunk.time - begin_));
    const std::vector<std::pair<std::string, double>> expected = {
        {"\xB1", 0.102}, {"\xB5", 0.102}, {"\xBC", 0.102}, {"\xB1", 1},   {"\xB5", 1.2}, {"\xBC", 1.4},
        {"\xD1", 1.6},   {"\xBE", 1.8},   {"\xB1", 2.1},   {"\xB5", 2.1}, {"\xBC", 2.1}};
    ASSERT_EQ(specials.size(), expected.size());
    for (std::size_t i = 0; i < specials.size(); ++i) {
      EXPECT_EQ(specials[i].first, expected[i].first) << i;
      EXPECT_NEAR(specials[i].second, expected[i].second, 0.025) << i << ": the line is served every 20 ms";
    }
  }
}

// The numbers and times on the wire go on when the simulator starts, when it stops, and when it starts again.
class Takeover : public ProductBeforeFirst {
 protected:
  static void starts_twice(SimulatedRun& run) {
    send(run, 5, 2, 1000);
    send(run, 9, 2, 0);
  }
  // The big-endian or little-endian number of `size` bytes at `at` in each frame that begins with `begin`; `at`
  // counts from the frame's end if it is negative.
  std::vector<std::uint64_t> numbers(const std::string& keys, std::string_view begin, int at, std::size_t size,
                                     bool is_big) {
    std::vector<std::uint64_t> all;
    for (const Line::Chunk& chunk : run(keys, 12, {}, starts_twice)) {
      if (!chunk.bytes.starts_with(begin)) continue;
      const std::size_t first = static_cast<std::size_t>(at < 0 ? static_cast<int>(chunk.bytes.size()) + at : at);
      std::uint64_t number = 0;
      for (std::size_t i = 0; i < size; ++i)
        number = number << 8U | static_cast<unsigned char>(chunk.bytes[first + (is_big ? i : size - 1 - i)]);
      all.push_back(number);
    }
    return all;
  }
  static void expect_steps(const std::vector<std::uint64_t>& numbers, std::size_t count, std::uint64_t step,
                           std::uint64_t modulus = 0) {
    ASSERT_GT(numbers.size(), count);
    for (std::size_t i = 1; i < numbers.size(); ++i) {
      const std::uint64_t difference = numbers[i] - numbers[i - 1];
      ASSERT_EQ(modulus == 0 ? difference : difference % modulus, step) << "frame " << i;
    }
  }
};

TEST_F(Takeover, TheCounterOfAStim300GoesOn) {
  expect_steps(numbers("protocol = \"stim300\"", "\xA7", -7, 1, true), 11'800, 2, 256);
}

TEST_F(Takeover, TheReferenceTimeOfAMipDeviceGoesOn) {
  expect_steps(numbers("protocol = \"mip\"\n[imu.device]\nmodel = \"3dm-cv7-ahrs\"\nfilter_fields = []\n"
                       "sensor_fields = [\"reference_time\"]",
                       "\x75\x65\x80", 6, 8, true),
               1190, 10'000'000);
}

TEST_F(Takeover, TheTimeOfAVectorNavGoesOn) {
  expect_steps(numbers("protocol = \"vectornav\"\n[imu.device]\nasync_type = 0\nbinary_1 = \"1,8,01,0001\"",
                       "\xFA\x01", 4, 8, false),
               1190, 10'000'000);
}

}  // namespace
}  // namespace imud
