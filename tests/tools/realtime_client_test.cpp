// The real-time clients that simulators copy: their pace, and an imud that accepts all their truths.
#include "tools/realtime_client.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "protocols/native_truth.hpp"
#include "protocols/truth_format.hpp"
#include "tests/support/decode_truth.hpp"
#include "tests/support/free_port.hpp"
#include "tests/support/text.hpp"
#include "tests/tools/loopback_socket.hpp"
#include "tests/tools/run_program.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

using imud_lockstep::RealtimeClient;

const std::string python_client = IMUD_SOURCE_DIR "/tools/realtime_client.py";

// The truth of the turntable in lockstep_client.py.
imud_lockstep::Truth turntable(int step) {
  imud_lockstep::Truth truth;
  truth.simulation_time_ns = step * 10'000'000LL;
  truth.sigma_BN = {0, 0, std::tan(0.5 * step / 100 / 4)};
  truth.omega_BN_B = {0, 0, 0.5};
  truth.specific_force_B = {0, 0, -9.80665};
  return truth;
}

// Sends the truths of 0 to `seconds`. The last line of the result is what a person reads.
ProgramResult send_turntable(bool python, int port, int seconds) {
  if (python)
    return run_program(IMUD_PYTHON,
                       {"-B", python_client, "127.0.0.1", std::to_string(port), "--for", std::to_string(seconds)});
  RealtimeClient client("127.0.0.1", static_cast<std::uint16_t>(port));
  for (int step = 0; step <= 100 * seconds; ++step) client.send(turntable(step));
  const RealtimeClient::Counters& counters = client.counters();
  EXPECT_LE(counters.lateness_ns, counters.max_lateness_ns);
  return {counters.sent > 0 ? 0 : 1, fmt::format("{} truths sent, {} refused", counters.sent, counters.refused), ""};
}

// The parameter is true for the client in Python.
class RealtimeClients : public testing::TestWithParam<bool> {};

INSTANTIATE_TEST_SUITE_P(, RealtimeClients, testing::Values(false, true),
                         [](const auto& client) { return client.param ? "Python" : "Cpp"; });

TEST_P(RealtimeClients, TheTruthsArriveInOrderAndNotBeforeTheyAreDue) {
  LoopbackSocket socket;
  const auto begin = std::chrono::steady_clock::now();
  const ProgramResult result = send_turntable(GetParam(), socket.port(), 1);
  EXPECT_GE(std::chrono::steady_clock::now() - begin, std::chrono::seconds(1));
  EXPECT_EQ(result.exit_code, 0) << result.errors;
  EXPECT_TRUE(contains(result.output, "101 truths sent, 0 refused")) << result.output;
  const auto datagrams = socket.receive_all();
  ASSERT_EQ(datagrams.size(), 101U);
  const auto decoder = find_truth_format("native")->make(Settings());
  for (int step = 0; step <= 100; ++step) {
    Truth truth;
    ASSERT_EQ(decode_truth(*decoder, datagrams[static_cast<std::size_t>(step)], truth), TruthResult::ok);
    EXPECT_EQ(truth.time.ns, step * 10'000'000LL);
    EXPECT_EQ(truth.sequence, static_cast<std::uint32_t>(step));
    EXPECT_EQ(truth.new_run, step == 0);
    EXPECT_FALSE(truth.acknowledge);
    EXPECT_EQ(truth.omega_BN_B.z(), 0.5);
  }
}

TEST_P(RealtimeClients, NobodyThereIsAFailureThatNamesTheRemedy) {
  const int nobody = free_udp_port();
  const ProgramResult result = send_turntable(GetParam(), nobody, 0);
  // The first datagram to a port that is not open is accepted; the next one reports it.
  EXPECT_TRUE(contains(result.output, "1 truths sent, 0 refused")) << result.output;
  const ProgramResult longer = send_turntable(GetParam(), nobody, 1);
  EXPECT_TRUE(contains(longer.output, "refused")) << longer.output;
}

TEST_P(RealtimeClients, ImudAcceptsEveryTruth) {
  const ScratchFolder folder;
  const int port = free_udp_port();
  std::ofstream(folder / "imud.toml") << "truth.port = \"udp:127.0.0.1:" << port << "\"\n[[imu]]\n"
                                      << "rate_hz = 100\nprotocol = \"csv\"\nport = \"file:" << folder / "out"
                                      << "\"\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n";
  Program imud("imud");
  imud.start({"run", folder / "imud.toml", "--summary", folder / "summary.json"});
  // The imu's port is opened after that of the truth.
  ASSERT_TRUE(eventually([&] { return std::filesystem::exists(folder / "out"); }));
  const ProgramResult result = send_turntable(GetParam(), port, 2);
  EXPECT_EQ(result.exit_code, 0) << result.errors;
  EXPECT_TRUE(contains(result.output, "201 truths sent, 0 refused")) << result.output;
  // Two more samples: imud has read what had arrived before them.
  const auto samples = [&] { return lines_of(read_file(folder / "out")).size(); };
  EXPECT_TRUE(eventually([&, before = std::max<std::size_t>(150, samples())] { return samples() > before + 2; }));
  EXPECT_EQ(imud.stop(), 0) << imud.errors();
  const auto truth = nlohmann::json::parse(read_file(folder / "summary.json"))["truth"];
  EXPECT_EQ(truth["received"], 201);
  EXPECT_EQ(truth["accepted"], 201) << truth.dump();
  EXPECT_EQ(truth["runs"], 1) << truth.dump();
}

TEST_P(RealtimeClients, StampsAreTheTimesAtWhichTheTruthsAreDue) {
  for (const SharedClock clock : {SharedClock::tai, SharedClock::utc, SharedClock::monotonic}) {
    const clockid_t id = clock == SharedClock::tai   ? CLOCK_TAI
                         : clock == SharedClock::utc ? CLOCK_REALTIME
                                                     : CLOCK_MONOTONIC;
    const auto now = [id] {
      timespec time{};
      clock_gettime(id, &time);
      return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
    };
    LoopbackSocket socket;
    const std::int64_t begin = now();
    if (GetParam()) {
      constexpr const char* words[] = {"none", "tai", "utc", "monotonic"};
      const auto python =
          run_program(IMUD_PYTHON, {"-B", "-c",
                                    fmt::format("import sys; sys.path.insert(0, '{}/tools')\n"
                                                "from realtime_client import *\n"
                                                "with RealtimeClient('127.0.0.1', {}, clock='{}') as imud:\n"
                                                "    for step in range(6): imud.send(turntable(step, 0.5))\n",
                                                IMUD_SOURCE_DIR, socket.port(), words[static_cast<int>(clock)])});
      EXPECT_EQ(python.exit_code, 0) << python.errors;
    } else {
      RealtimeClient::Options options;
      options.clock = static_cast<imud_lockstep::Clock>(clock);
      RealtimeClient client("127.0.0.1", static_cast<std::uint16_t>(socket.port()), options);
      for (int step = 0; step < 6; ++step) client.send(turntable(step));
    }
    const std::int64_t end = now();
    const auto datagrams = socket.receive_all();
    ASSERT_EQ(datagrams.size(), 6U);
    const auto decoder = find_truth_format("native")->make(Settings());
    std::int64_t first = 0;
    for (std::size_t step = 0; step < 6; ++step) {
      Truth truth;
      ASSERT_EQ(decode_truth(*decoder, datagrams[step], truth), TruthResult::ok);
      EXPECT_EQ(truth.stamp.clock, clock);
      if (step == 0) first = truth.stamp.time.ns;
      EXPECT_EQ(truth.stamp.time.ns - first, truth.time.ns);
    }
    EXPECT_GE(first, begin);
    EXPECT_LE(first + 50'000'000, end) << "the last is not sent before it is due";
  }
}

TEST(RealtimeClient, ATimeThatDoesNotIncreaseIsRefused) {
  LoopbackSocket socket;
  RealtimeClient client("127.0.0.1", static_cast<std::uint16_t>(socket.port()));
  EXPECT_TRUE(client.send(turntable(1)));
  for (const int step : {1, 0}) EXPECT_THROW(client.send(turntable(step)), std::invalid_argument);
  EXPECT_TRUE(client.send(turntable(2)));
  EXPECT_EQ(socket.receive_all().size(), 2U);
  EXPECT_EQ(client.counters().sent, 2U);
  const auto python = run_program(IMUD_PYTHON, {"-B", "-c",
                                                fmt::format("import sys; sys.path.insert(0, '{}/tools')\n"
                                                            "from realtime_client import *\n"
                                                            "with RealtimeClient('127.0.0.1', {}) as imud:\n"
                                                            "    imud.send(Truth(simulation_time_ns=1))\n"
                                                            "    imud.send(Truth(simulation_time_ns=1))\n",
                                                            IMUD_SOURCE_DIR, socket.port())});
  EXPECT_TRUE(
      contains(python.errors, "ValueError: simulation_time_ns is 1 after 1; right would be a time that increases"))
      << python.errors;
}

}  // namespace
}  // namespace imud
