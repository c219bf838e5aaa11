// The sampling thread allocates nothing, takes no lock and logs nothing, whatever input arrives.
#include <fcntl.h>
#include <poll.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <mutex>
#include <sstream>
#include <thread>

#include "emulator/config/load_config.hpp"
#include "emulator/drive/loop.hpp"
#include "emulator/record/recorder.hpp"
#include "tests/emulator/run/live_test.hpp"
#include "tests/support/allocations.hpp"
#include "tests/support/locks.hpp"
#include "transports/host_clock.hpp"
#include "transports/uart/termios2.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

TEST(Locks, AreCountedOnThreadsThatEnableIt) {
  std::mutex mutex;
  const std::uint64_t before = locks_taken();
  { const std::lock_guard lock(mutex); }
  EXPECT_EQ(locks_taken() - before, 0U);
  std::thread([&] {
    count_locks_of_this_thread();
    const std::lock_guard lock(mutex);
  }).join();
  EXPECT_EQ(locks_taken() - before, 1U);
  std::thread([&] {
    count_locks_of_this_thread();
    std::ostringstream log;
    spdlog::logger("", std::make_shared<spdlog::sinks::ostream_sink_mt>(log)).info("a word, which takes a lock");
  }).join();
  EXPECT_GT(locks_taken() - before, 1U);
}

// Samples of six imus to a pty with a reader, one without, a file, a socket, and paced ptys whose readers have set
// the right and a wrong speed, at 1 kHz; truth at 500 Hz with bad datagrams among it, repeated ones, and pauses
// beyond which motion is held; half of it has stamps, of the right and of another clock. All of it is recorded,
// controlled by commands, and watched.
TEST_F(LiveTest, TheHotLoopAllocatesLocksAndLogsNothing) {
  std::string text =
      "clock = \"realtime\"\n[truth]\nport = \"" + simulator_.port() + "\"\ndelay_ms = 0\nextrapolate_ms = 20\n";
  const std::array<std::string, 6> ports = {"pty:" + path("read"),
                                            "pty:" + path("unread"),
                                            "file:" + path("out"),
                                            "udp:127.0.0.1:9",
                                            "pty:" + path("paced") + "?baud=2000000",
                                            "pty:" + path("wrong") + "?baud=2000000"};
  const std::array<std::string, 6> protocols = {"native", "csv", "csv", "native", "native", "native"};
  for (std::size_t i = 0; i < ports.size(); ++i)
    text += fmt::format(
        "[[imu]]\nname = \"i{}\"\nrate_hz = 1000\nprotocol = \"{}\"\nport = \"{}\"\n"
        "gyro.max_rad_per_s = 100\naccelerometer.max_m_per_s2 = 1000\npace = \"{}\"\n",
        i, protocols[i], ports[i], i < 4 ? "none" : "line");
  const Config config = load_config(write("config.toml", text));
  std::atomic<bool> stop = false;
  Recorder recorder({.file = path("record.pcapng")}, false);
  RunControl control(config.imus.size());
  Engine engine(config, real_ports, recorder, &control);
  control.feed.watch(0, 1);
  control.feed.watch(3, 7);
  recorder.start(true, "");
  const auto counters = [&](std::size_t i) -> const ImuCounters& { return engine.channels()[i]->counters; };
  const FileDescriptor reader(::open(path("read").c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK));
  ASSERT_TRUE(reader);
  const FileDescriptor paced(::open(path("paced").c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK));
  const FileDescriptor wrong(::open(path("wrong").c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK));
  ASSERT_TRUE(set_line_speed(wrong.get(), 921'600));

  std::ostringstream log;
  const auto logger = spdlog::default_logger();
  spdlog::set_default_logger(
      std::make_shared<spdlog::logger>("", std::make_shared<spdlog::sinks::ostream_sink_mt>(log)));
  std::thread sampler([&] {
    MonotonicHost host;
    HostPacer pacer(config.truth.clock, Epoch::monotonic, engine.timeline().limits(), engine.quality());
    ClockCounters clock;
    Loop loop(engine, host, pacer, {}, clock, stop);
    count_locks_of_this_thread();
    loop.run();
  });

  std::array<std::byte, 4096> buffer;
  const TruthQuality& quality = engine.quality();
  std::uint32_t k = 0;
  std::uint64_t batches = 0, answers = 0, watched = 0;
  // Every kind of command, in batches that do not leave an imu off.
  using Kind = Command::Kind;
  const std::array<std::array<Command, 3>, 5> commands = {{
      {{{.kind = Kind::pause, .imu = 4},
        {.kind = Kind::power_off, .imu = 2},
        {.kind = Kind::gyro_bias, .value = 0.1}}},
      {{{.kind = Kind::resume, .imu = 4}, {.kind = Kind::power_on, .imu = 2}, {.kind = Kind::seed, .number = 3}}},
      {{{.kind = Kind::power_cycle, .imu = 3}, {.kind = Kind::mark, .text_size = 5}, {.kind = Kind::log_level}}},
      {{{.kind = Kind::delay, .value = 0.01}, {.kind = Kind::when_stopped}, {.kind = Kind::accelerometer_bias}}},
      {{{.kind = Kind::automatic_delay, .value = 99},
        {.kind = Kind::extrapolate, .value = 0.02},
        {.kind = Kind::servo}}},
  }};
  const auto play = [&](std::uint32_t truths) {
    for (const std::uint32_t until = k + truths; k < until; ++k) {
      Truth truth = Simulator::truth(2 * k, k, k % 10 == 0);
      if (k / 100 % 2 == 1) truth.stamp = {k % 13 == 0 ? SharedClock::utc : SharedClock::monotonic, {host_now().ns}};
      const Simulator::Datagram good = Simulator::encode(truth);
      simulator_.send(good);
      if (k % 7 == 0) simulator_.send(good);
      if (k % 11 == 0) simulator_.send(std::span(good).first(100));
      std::this_thread::sleep_for(2ms);
      if (k % 100 == 99) eventually([&] { return quality.stops > quality.returns; });
      for (const FileDescriptor* descriptor : {&reader, &paced, &wrong})
        while (::read(descriptor->get(), buffer.data(), buffer.size()) > 0) {
        }
      while (simulator_.answer(0)) {
      }
      if (k % 3 == 0 && control.commands.push(batches + 1, commands[batches % commands.size()])) ++batches;
      for (Applied applied; control.applied.pop(applied);) ++answers;
      for (FeedSample sample; control.feed.pop(sample);) ++watched;
      for (RunEvent event; control.events.pop(event);) continue;
    }
  };
  play(150);
  const std::uint64_t allocated = allocations(), locked = locks_taken();
  const std::uint64_t answers_before = answers, watched_before = watched;
  const std::uint64_t samples = counters(0).samples, stops = quality.stops, returns = quality.returns;
  const auto refused = [&](Refusal refusal) -> std::uint64_t {
    return engine.intake().counters().refused[static_cast<std::size_t>(refusal)];
  };
  // The counters show that all of this happened.
  const bool is_busy = eventually([&] {
    play(100);
    return counters(0).samples - samples > 1000 && counters(0).frames > 500 && counters(1).dropped > 500 &&
           counters(2).frames > 500 && counters(4).frames > 500 && counters(5).frames > 500 &&
           refused(Refusal::duplicate) > 20 && refused(Refusal::too_short) > 20 && quality.stops > stops + 1 &&
           quality.returns > returns + 1 && quality.stamped > 20 && quality.stamps_refused > 0;
  });
  const std::uint64_t allocated_after = allocations(), locked_after = locks_taken();
  stop = true;
  sampler.join();
  spdlog::set_default_logger(logger);

  EXPECT_EQ(allocated_after - allocated, 0U);
  EXPECT_EQ(locked_after - locked, 0U);
  EXPECT_EQ(log.str(), "");
  EXPECT_GT(answers - answers_before, 6 * 20U) << "an answer for each imu";
  EXPECT_GT(watched - watched_before, 1000U);
  EXPECT_TRUE(is_busy) << counters(0).samples << ' ' << counters(0).frames << ' ' << counters(1).dropped << ' '
                       << counters(2).frames << ' ' << counters(4).frames << ' ' << counters(5).frames << ' '
                       << refused(Refusal::duplicate) << ' ' << refused(Refusal::too_short) << ' ' << quality.stops
                       << ' ' << quality.returns;
  recorder.finish();
  EXPECT_EQ(recorder.counters().lost, 0U);
  EXPECT_GT(recorder.counters().packets, counters(0).samples * 10) << "four frames and six samples each";
  EXPECT_EQ(counters(4).port_state, PortState::ready);
  EXPECT_EQ(counters(5).port_state, PortState::wrong_speed);
}

}  // namespace
}  // namespace imud
