// kill -9 at any time: files hold whole frames or are marked as incomplete, and the next start needs no hand.
#include <random>

#include "protocols/protocol.hpp"
#include "tests/emulator/run/live_test.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

class KilledTest : public LiveTest {
 protected:
  // Runs imud and kills it after a random part of `longest`. Returns true if it was killed, false if it had ended.
  bool kill_within(std::chrono::microseconds longest, std::vector<std::string> arguments) {
    std::filesystem::remove(path("summary.json"));
    arguments.insert(arguments.end(), {"--summary", path("summary.json")});
    Program imud("imud");
    imud.start(arguments);
    std::this_thread::sleep_for(std::chrono::microseconds(random_() % static_cast<unsigned>(longest.count())));
    const int exit_code = imud.stop(SIGKILL);
    EXPECT_TRUE(exit_code == 0 || exit_code == 128 + SIGKILL) << exit_code << imud.errors();
    return exit_code != 0;
  }
  // Returns true if there is a summary, and it is that of a whole run.
  bool summary_is_complete() const {
    const auto json = nlohmann::json::parse(read_file(path("summary.json")), nullptr, false);
    return !json.is_discarded() && json["complete"] == true;
  }

  std::mt19937 random_{13};
};

TEST_F(KilledTest, FilesAreWholeOrMarkedAndTheNextStartNeedsNoHand) {
  ASSERT_EQ(
      run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--rate", "1000", "--for", "10"}).exit_code, 0);
  const std::string c = config("fast", "file:" + path("truth.csv"), "csv", 1000, "native", "file:" + path("out"));
  const std::vector<std::string> replay = {"replay", c, path("truth.csv")}, run = {"run", c};
  const auto begin = std::chrono::steady_clock::now();
  ASSERT_EQ(run_program("imud", replay).exit_code, 0);
  const auto duration =
      std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::steady_clock::now() - begin);
  const std::string whole = read_file(path("out"));
  ASSERT_EQ(whole.size(), 124U * 10'001U);

  // Each start follows a run that was killed.
  const std::string incomplete = path("out.incomplete");
  const auto expect_prefix = [&](const std::string& file) {
    const std::string written = read_file(file);
    EXPECT_TRUE(whole.starts_with(written)) << written.size();
    return written.size();
  };
  // Under sanitizers most of a run is its start: then there are more runs, until some were killed while they wrote.
  int killed = 0, begun = 0;
  for (int i = 0; i < 40 || (begun < 3 && i < 400); ++i) {
    write("out", "old");
    const bool was_killed = kill_within(duration, replay);
    const std::string out = read_file(path("out"));
    EXPECT_TRUE(out == whole || (was_killed && out == "old")) << out.size();
    if (summary_is_complete()) {
      EXPECT_TRUE(out == whole);
    }
    killed += was_killed ? 1 : 0;
    if (out == "old" && std::filesystem::exists(incomplete)) begun += expect_prefix(incomplete) > 0 ? 1 : 0;
  }
  EXPECT_GE(killed, 10);
  EXPECT_GE(begun, 3);
  EXPECT_EQ(run_program("imud", replay).exit_code, 0);
  EXPECT_TRUE(read_file(path("out")) == whole);
  EXPECT_FALSE(std::filesystem::exists(incomplete));

  // imud run writes in place: what is not whole has a summary that is not complete.
  begun = 0;
  for (int i = 0; i < 40 || (begun < 3 && i < 400); ++i) {
    kill_within(duration, run);
    const std::size_t size = expect_prefix(path("out"));
    if (size < whole.size()) {
      EXPECT_FALSE(summary_is_complete());
    }
    begun += size > 0 && size < whole.size() ? 1 : 0;
  }
  EXPECT_GE(begun, 3);
  EXPECT_EQ(run_program("imud", run).exit_code, 0);
  EXPECT_TRUE(read_file(path("out")) == whole);
}

TEST_F(KilledTest, ALiveRunLeavesWholeFramesAndALinkThatTheNextOneReplaces) {
  const std::string c = config("realtime", simulator_.port(), "native", 1000, "native", "file:" + path("out"));
  std::ofstream(c, std::ios::app) << "before_first = \"rest\"\n[[imu]]\nrate_hz = 100\nprotocol = \"native\"\nport = "
                                  << "\"pty:" << path("imu") << "\"\n"
                                  << "gyro.max_rad_per_s = 100\naccelerometer.max_m_per_s2 = 1000\n";
  const Protocol& native = *find_protocol("native");
  struct Count final : MeasurementSink {
    void on_measurement(const Measurement& measurement) override { EXPECT_EQ(measurement.sample.counter, seen++); }
    std::uint64_t seen = 0;
  };
  std::uint64_t frames = 0;
  // Under sanitizers on a loaded machine, few runs have begun after 200 ms: then there are more of them, and longer
  // ones.
  for (int i = 0; i < 20 || (frames <= 100 && i < 200); ++i) {
    EXPECT_TRUE(kill_within(200ms * (1 + i / 20), {"run", c}));
    EXPECT_FALSE(summary_is_complete());
    const std::string out = read_file(path("out"));
    const auto decoder = native.make_decoder(Settings(native.settings));
    Count count;
    decoder->feed({std::as_bytes(std::span(out))}, count);
    decoder->finish(count);
    // The kernel may end a write at a page's border when a process is killed.
    EXPECT_EQ(count.seen, out.size() / 124);
    EXPECT_EQ(decoder->errors().checksum + decoder->errors().malformed, 0U);
    frames += count.seen;
  }
  EXPECT_GT(frames, 100U);
  std::filesystem::remove(path("out"));
  Program imud("imud");
  start(imud, c);
  EXPECT_TRUE(eventually([&] { return !read_file(path("out")).empty(); }));
  EXPECT_EQ(imud.stop(), 0) << imud.errors();
  EXPECT_FALSE(std::filesystem::is_symlink(path("imu")));
}

}  // namespace
}  // namespace imud
