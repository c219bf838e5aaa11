// The lockstep clients that simulators copy: their bytes, a bad network, a whole run with imud.
#include "tools/lockstep_client.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <functional>
#include <future>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "core/attitude.hpp"
#include "protocols/native_truth.hpp"
#include "protocols/truth_format.hpp"
#include "tests/support/decode_truth.hpp"
#include "tests/support/free_port.hpp"
#include "tests/support/text.hpp"
#include "tests/tools/loopback_socket.hpp"
#include "tests/tools/run_program.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "tools/truth/motion.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;
namespace lockstep = imud_lockstep;

constexpr std::string_view tools_folder = IMUD_SOURCE_DIR "/tools";

lockstep::Vector3 vector_of(const Vector3& v) { return {v.x(), v.y(), v.z()}; }

// Converts `truth` to what a simulator passes to the client.
lockstep::Truth client_truth(const Truth& truth) {
  lockstep::Truth t;
  t.simulation_time_ns = truth.time.ns;
  t.r_BN_N = vector_of(truth.r_BN_N);
  t.v_BN_N = vector_of(truth.v_BN_N);
  t.sigma_BN = vector_of(mrp_from_quaternion(truth.q_NB));
  t.omega_BN_B = vector_of(truth.omega_BN_B);
  if (truth.has_angular_acceleration) t.omegaDot_BN_B = vector_of(truth.omegaDot_BN_B);
  if (truth.has_specific_force) t.specific_force_B = vector_of(truth.specific_force_B);
  if (truth.accumulated_dv == AccumulatedDv::inertial)
    t.accumulated_dv_inertial_B = vector_of(truth.accumulated_dv_B);
  if (truth.accumulated_dv == AccumulatedDv::body_sum)
    t.accumulated_dv_body_sum_B = vector_of(truth.accumulated_dv_B);
  if (truth.stamp.clock != SharedClock::none)
    t.stamp = lockstep::Stamp{static_cast<lockstep::Clock>(truth.stamp.clock), truth.stamp.time.ns};
  return t;
}

lockstep::Truth spiral(std::int64_t ms) {
  return client_truth(find_motion("spiral")->at(TruthTime{ms * 1'000'000}, {}));
}

// With every combination of optional parts and of the new-run flag, the latter with a stamp.
std::vector<Truth> every_kind() {
  std::vector<Truth> truths;
  for (const AccumulatedDv kind : {AccumulatedDv::none, AccumulatedDv::inertial, AccumulatedDv::body_sum})
    for (unsigned parts = 0; parts < 8; ++parts) {
      Truth t;
      t.time.ns = -1'234'567'890'123 + parts;
      t.stream = 0xFEDCBA98;
      t.sequence = 0xFFFFFFFF - parts;
      t.acknowledge = true;
      t.new_run = (parts & 4U) != 0;
      if (t.new_run) t.stamp = {static_cast<SharedClock>(1 + parts % 3), {1'795'834'994'123'456'789 + parts}};
      t.r_BN_N = {6.7e6, -1e-300, 2.0};
      t.v_BN_N = {7.5e3, -0.0, 0.1};
      t.q_NB = exp(Vector3(0.3, -0.4, 1.2));
      t.omega_BN_B = {0.1, 0.2, -0.3};
      t.has_angular_acceleration = (parts & 1U) != 0;
      if (t.has_angular_acceleration) t.omegaDot_BN_B = {1.0, 2.0, -1.0 / 3.0};
      t.has_specific_force = (parts & 2U) != 0;
      if (t.has_specific_force) t.specific_force_B = {-9.8, 0.5, 0.25};
      t.accumulated_dv = kind;
      if (kind != AccumulatedDv::none) t.accumulated_dv_B = {100.0, 1e-9, 300.1};
      truths.push_back(t);
    }
  return truths;
}

lockstep::Datagram datagram_of(const Truth& t) {
  return lockstep::encode(client_truth(t), t.stream, t.sequence, t.new_run);
}

// Lines of JSON for the Python client: the fields by their names, and beside them what encode() needs.
std::string json_line(const lockstep::Truth& t) {
  nlohmann::json line = {{"simulation_time_ns", t.simulation_time_ns},
                         {"r_BN_N", t.r_BN_N},
                         {"v_BN_N", t.v_BN_N},
                         {"sigma_BN", t.sigma_BN},
                         {"omega_BN_B", t.omega_BN_B}};
  const auto add = [&line](const char* name, const std::optional<lockstep::Vector3>& vector) {
    if (vector) line[name] = *vector;
  };
  add("omegaDot_BN_B", t.omegaDot_BN_B);
  add("specific_force_B", t.specific_force_B);
  add("accumulated_dv_inertial_B", t.accumulated_dv_inertial_B);
  add("accumulated_dv_body_sum_B", t.accumulated_dv_body_sum_B);
  constexpr const char* clocks[] = {"tai", "utc", "monotonic"};
  if (t.stamp) line["stamp"] = {clocks[static_cast<std::size_t>(t.stamp->clock) - 1], t.stamp->time_ns};
  return line.dump() + "\n";
}

// Runs Python statements that have imported the client, and `truths()`, those of standard input. It leaves no
// compiled file in the sources.
ProgramResult run_python(const std::string& statements, const std::vector<std::string>& arguments = {},
                         const std::string& input = "") {
  const std::string prologue = fmt::format(R"(
import json, sys
sys.path.insert(0, "{}")
from lockstep_client import *
def truths():
    return [Truth(**json.loads(line)) for line in sys.stdin]
)",
                                           tools_folder);
  std::vector<std::string> all = {"-B", "-c", prologue + statements};
  all.insert(all.end(), arguments.begin(), arguments.end());
  return run_program(IMUD_PYTHON, all, input);
}

// A thread that answers as imud does, except for lost datagrams and answers.
class FakeImud {
 public:
  struct Network {
    std::size_t loses_datagrams = 0;                  // the first ones of each truth
    std::size_t loses_answers = 0;                    // the next ones
    std::vector<std::vector<std::byte>> strays = {};  // that arrive before every answer
  };
  explicit FakeImud(const Network& network)
      : network_(network), thread_([this](std::stop_token stop) { serve(stop); }) {}

  int port() const { return socket_.port(); }
  // Ends the thread; afterwards its results may be read.
  void stop() {
    thread_.request_stop();
    thread_.join();
  }

  std::vector<Truth> emitted;  // the accepted truths
  std::vector<std::vector<std::byte>> received;

 private:
  void serve(const std::stop_token& stop) {
    const TruthFormat* format = find_truth_format("native");
    const auto decoder = format->make(Settings(format->settings));
    const auto frames = std::make_unique<FrameBuffer>();
    std::uint32_t sequence = 0;
    std::size_t repeated = 0;
    while (!stop.stop_requested()) {
      const auto datagram = socket_.receive(5);
      Truth truth;
      if (!datagram || decode_truth(*decoder, *datagram, truth) != TruthResult::ok) continue;
      repeated = !received.empty() && truth.sequence == sequence ? repeated + 1 : 0;
      sequence = truth.sequence;
      received.push_back(*datagram);
      if (repeated < network_.loses_datagrams) continue;
      if (emitted.empty() || truth.time > emitted.back().time) emitted.push_back(truth);
      if (repeated < network_.loses_datagrams + network_.loses_answers) continue;
      for (const auto& stray : network_.strays) socket_.answer(stray);
      frames->clear();
      decoder->acknowledge(truth, emitted.back().time, emitted.size(), *frames);
      socket_.answer(frames->frames()[0].bytes);
    }
  }

  const Network network_;
  LoopbackSocket socket_;
  std::jthread thread_;
};

lockstep::LockstepClient client_of(int port, const lockstep::Options& options) {
  return {"127.0.0.1", static_cast<std::uint16_t>(port), options};
}

std::vector<std::byte> answer_bytes(std::uint32_t stream, std::uint32_t sequence) {
  const auto decoder = find_truth_format("native")->make(Settings());
  const auto frames = std::make_unique<FrameBuffer>();
  Truth truth;
  truth.stream = stream;
  truth.sequence = sequence;
  decoder->acknowledge(truth, {}, 12345, *frames);
  const auto bytes = frames->frames()[0].bytes;
  return {bytes.begin(), bytes.end()};
}

TEST(LockstepClient, BytesAreThoseOfTheFormat) {
  for (const Truth& truth : every_kind()) {
    std::array<std::byte, native_truth_size> wanted;
    encode_native_truth(truth, wanted);
    const lockstep::Datagram datagram = datagram_of(truth);
    EXPECT_TRUE(std::ranges::equal(std::as_bytes(std::span(datagram)), wanted)) << truth.sequence;
  }
}

TEST(LockstepClient, PythonEncodesTheSameBytes) {
  std::string input, wanted;
  const auto truths = every_kind();
  for (const Truth& truth : truths) {
    input += json_line(client_truth(truth));
    for (const unsigned char byte : datagram_of(truth)) wanted += fmt::format("{:02x}", byte);
    wanted += '\n';
  }
  const auto result = run_python(R"(
for i, truth in enumerate(truths()):
    parts = i % 8
    print(encode(truth, 0xFEDCBA98, 0xFFFFFFFF - parts, parts >= 4).hex())
)",
                                 {}, input);
  EXPECT_EQ(result.exit_code, 0) << result.errors;
  EXPECT_EQ(result.output, wanted);
}

TEST(LockstepClient, WhatImudWouldNotAnswerIsNotSent) {
  FakeImud imud({});
  lockstep::LockstepClient client = client_of(imud.port(), {});
  const auto fault = [&client](const lockstep::Truth& truth) -> std::string {
    try {
      client.step(truth);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  lockstep::Truth diverged = spiral(0);
  diverged.omegaDot_BN_B = {0, std::numeric_limits<double>::quiet_NaN(), 0};
  lockstep::Truth both = spiral(0);
  both.accumulated_dv_body_sum_B = both.accumulated_dv_inertial_B;
  EXPECT_TRUE(contains(fault(diverged), "omegaDot_BN_B is not finite"));
  EXPECT_TRUE(contains(fault(both), "only one of them"));
  EXPECT_TRUE(client.step(spiral(0)).accepted);
  imud.stop();
  EXPECT_EQ(imud.emitted.size(), 1U);
  EXPECT_TRUE(imud.emitted[0].new_run);
  EXPECT_THROW(lockstep::LockstepClient("nowhere", 9810), std::invalid_argument);

  const auto python = run_python(R"(
zero = (0, 0, 0)
for fault in {"v_BN_N": (0, 0, math.inf)}, {"accumulated_dv_inertial_B": zero, "accumulated_dv_body_sum_B": zero}:
    try:
        LockstepClient("127.0.0.1", 9).step(Truth(0, **fault))
    except ValueError as error:
        print(error)
)");
  EXPECT_TRUE(contains(python.output, "v_BN_N is not finite")) << python.errors;
  EXPECT_TRUE(contains(python.output, "only one of them")) << python.errors;
}

// Each fault is named, with what would be right; nothing is sent.
TEST(LockstepClient, PythonNamesWhatIsWrongWithItsInput) {
  const auto python = run_python(R"py(
good = dict(simulation_time_ns=0)
for fault in {"simulation_time_ns": 0.5}, {"simulation_time_ns": "0"}, {"simulation_time_ns": 2**63}, \
        {"simulation_time_ns": None}, {"sigma_BN": (0, 0)}, {"omega_BN_B": (0, 0, 0, 0)}, {"r_BN_N": None}, \
        {"v_BN_N": 3.0}, {"specific_force_B": "abc"}, {"specific_force_B": (0, "x", 0)}, {"omegaDot_BN_B": (10**400, 0, 0)}:
    name = list(fault)[0]
    try:
        encode(Truth(**{**good, **fault}), 0, 0, True)
        print(name, "was encoded")
    except ValueError as error:
        right = "whole number" if name == "simulation_time_ns" else "right would be three numbers, (x, y, z)"
        print("named" if str(error).startswith(f"{name} is ") and right in str(error) else error)
for arguments in ("127.0.0.1", 0), ("127.0.0.1", 65536), ("127.0.0.1", "9810"), ("nowhere", 9810):
    try:
        LockstepClient(*arguments)
        print("was accepted", arguments)
    except ValueError as error:
        print("named" if "right would be" in str(error) else error)
try:
    LockstepClient("127.0.0.1", 9810, stream=-1)
except ValueError as error:
    print("named" if "stream is -1" in str(error) else error)
encode(Truth(simulation_time_ns=0, sigma_BN=[0, 1, 2.5]), 0, 0, True)
)py");
  EXPECT_EQ(python.exit_code, 0) << python.errors;
  std::string wanted;
  for (int i = 0; i < 16; ++i) wanted += "named\n";
  EXPECT_EQ(python.output, wanted);
}

// The Python program for the tests below: steps through the truths, prints each answer.
constexpr const char* python_steps = R"(
port, options = int(sys.argv[1]), json.loads(sys.argv[2])
try:
    with LockstepClient("127.0.0.1", port, **options) as client:
        for truth in truths():
            answer = client.step(truth)
            print(answer.stream, answer.sequence, answer.simulation_time_ns, answer.samples, answer.accepted)
except RuntimeError as error:
    sys.exit(str(error))
)";

// Returns a line for each answer, from the client in C++ or the one in Python; the text of the exception if there is
// one.
struct Steps {
  std::string answers;
  std::string failure;
};

Steps steps(bool python, int port, const lockstep::Options& options, const std::vector<lockstep::Truth>& truths) {
  Steps result;
  if (python) {
    nlohmann::json given = {{"timeout", std::chrono::duration<double>(options.timeout).count()},
                            {"attempts", options.attempts},
                            {"stream", options.stream}};
    if (options.first_sequence) given["first_sequence"] = *options.first_sequence;
    std::string input;
    for (const auto& truth : truths) input += json_line(truth);
    const auto program = run_python(python_steps, {std::to_string(port), given.dump()}, input);
    return {program.output, program.errors};
  }
  try {
    lockstep::LockstepClient client = client_of(port, options);
    for (const auto& truth : truths) {
      const lockstep::Answer a = client.step(truth);
      result.answers += fmt::format("{} {} {} {} {}\n", a.stream, a.sequence, a.simulation_time_ns, a.samples,
                                    a.accepted ? "True" : "False");
    }
  } catch (const std::runtime_error& error) {
    result.failure = error.what();
  }
  return result;
}

// Both clients follow the same rules. The parameter is true for the client in Python.
class LockstepClients : public testing::TestWithParam<bool> {
 protected:
  Steps steps(int port, const lockstep::Options& options, const std::vector<lockstep::Truth>& truths) {
    return imud::steps(GetParam(), port, options, truths);
  }
};

INSTANTIATE_TEST_SUITE_P(, LockstepClients, testing::Values(false, true),
                         [](const auto& client) { return client.param ? "Python" : "Cpp"; });

TEST_P(LockstepClients, WhatIsLostIsSentAgainAndEmittedOnce) {
  FakeImud imud({.loses_datagrams = 2, .loses_answers = 2});
  lockstep::Options options;
  options.timeout = 30ms;
  options.attempts = 1000;
  options.stream = 7;
  options.first_sequence = 0xFFFFFFFE;
  const Steps all = steps(imud.port(), options, {spiral(0), spiral(10), spiral(20), spiral(30)});
  imud.stop();
  EXPECT_EQ(all.failure, "");
  EXPECT_EQ(all.answers,
            "7 4294967294 0 1 True\n7 4294967295 10000000 2 True\n7 0 20000000 3 True\n7 1 30000000 4 True\n");
  ASSERT_EQ(imud.emitted.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(imud.emitted[i].new_run, i == 0);
    EXPECT_TRUE(imud.emitted[i].acknowledge);
  }
  EXPECT_GE(imud.received.size(), 20U);
  // A repeated datagram is the same to the last byte.
  imud.received.erase(std::unique(imud.received.begin(), imud.received.end()), imud.received.end());
  EXPECT_EQ(imud.received.size(), 4U);
}

TEST_P(LockstepClients, SilenceIsAnErrorThatNamesTheRemedy) {
  lockstep::Options options;
  options.timeout = 20ms;
  options.attempts = 3;
  LoopbackSocket silent;
  const std::string failure = steps(silent.port(), options, {spiral(10)}).failure;
  EXPECT_TRUE(contains(failure,
                       "no answer from " + silent.spec() + " to the truth of 10000000 ns, sent 3 times, 20 ms each;"))
      << failure;
  EXPECT_TRUE(contains(failure, "right would be an imud that runs with clock = \"lockstep\" and truth.port = \"" +
                                    silent.spec() + "\""))
      << failure;
  EXPECT_EQ(silent.receive_all().size(), 3U);

  const int nobody = free_udp_port();
  const std::string refused = steps(nobody, options, {spiral(0)}).failure;
  EXPECT_TRUE(contains(refused, "sent 3 times, 20 ms each (Connection refused); right would be")) << refused;
}

TEST_P(LockstepClients, StrayDatagramsAreIgnored) {
  constexpr std::uint32_t sequence = 100;
  std::vector<std::byte> version_2 = answer_bytes(0, sequence);
  version_2[4] = std::byte{2};
  std::vector<std::byte> other_magic = answer_bytes(0, sequence);
  other_magic[3] = std::byte{'T'};
  std::vector<std::byte> short_by_one = answer_bytes(0, sequence);
  short_by_one.pop_back();
  std::vector<std::byte> long_by_one = answer_bytes(0, sequence);
  long_by_one.emplace_back();
  FakeImud imud({.strays = {answer_bytes(0, sequence - 1),
                            answer_bytes(0, sequence + 1),
                            answer_bytes(1, sequence),
                            version_2,
                            other_magic,
                            short_by_one,
                            long_by_one,
                            {},
                            std::vector<std::byte>(2000)}});
  lockstep::Options options;
  options.first_sequence = sequence;
  options.timeout = 2000ms;
  const Steps one = steps(imud.port(), options, {spiral(0)});
  EXPECT_EQ(one.failure, "");
  EXPECT_EQ(one.answers, "0 100 0 1 True\n");
}

// They arrive continuously, and do not keep the client from its timeout.
TEST_P(LockstepClients, StrayDatagramsDoNotRestartTheTimeOut) {
  LoopbackSocket flooding;
  std::size_t received = 0;
  std::jthread flood([&](std::stop_token stop) {
    while (!stop.stop_requested()) {
      if (flooding.receive(1)) ++received;
      if (received > 0) flooding.answer(answer_bytes(0, 1));
    }
  });
  lockstep::Options options;
  options.first_sequence = 5;
  options.timeout = 50ms;
  options.attempts = 3;
  const auto running = std::async(std::launch::async, [&] { return steps(flooding.port(), options, {spiral(0)}); });
  const bool ended = running.wait_for(Program::default_timeout) == std::future_status::ready;
  flood.request_stop();
  flood.join();
  received += flooding.receive_all().size();
  EXPECT_TRUE(ended);
  EXPECT_EQ(received, 3U);
}

TEST_P(LockstepClients, ARefusedTruthIsReported) {
  FakeImud imud({});
  lockstep::Options options;
  options.first_sequence = 0;
  const Steps all = steps(imud.port(), options, {spiral(100), spiral(50), spiral(110)});
  EXPECT_EQ(all.failure, "");
  EXPECT_EQ(all.answers, "0 0 100000000 1 True\n0 1 100000000 1 False\n0 2 110000000 2 True\n");
}

// The daemon itself, in lockstep, with two noisy imus that write files.
class LockstepRun : public LockstepClients {
 protected:
  // A configuration whose files are named `prefix`_slow and `prefix`_fast.
  std::vector<std::string> arguments(const std::string& prefix) const {
    std::string text = fmt::format("seed = 3\nclock = \"lockstep\"\ntruth.port = \"udp:127.0.0.1:{}\"\n", port_);
    for (const auto& [name, rate_hz] : {std::pair("slow", 100), {"fast", 250}})
      text += fmt::format(R"([[imu]]
name = "{0}"
rate_hz = {1}
protocol = "csv"
port = "file:{2}_{0}"
gyro.max_rad_per_s = 100
gyro.walk_sqrt_cov = [0.01, 0.01, 0.01]
accelerometer.max_m_per_s2 = 1000
accelerometer.walk_sqrt_cov = [0.1, 0.1, 0.1]
)",
                          name, rate_hz, folder_ / prefix);
    std::ofstream(folder_ / (prefix + ".toml")) << text;
    return {"run", folder_ / (prefix + ".toml"), "--summary", folder_ / (prefix + ".json")};
  }
  nlohmann::json summary(const std::string& prefix) const {
    return nlohmann::json::parse(read_file(folder_ / (prefix + ".json")));
  }
  std::size_t rows(const std::string& name) const { return lines_of(read_file(folder_ / name)).size() - 1; }

  // A long timeout for a loaded machine; only a test that fails waits so long.
  static lockstep::Options patient() {
    lockstep::Options options;
    options.attempts = 300;
    options.first_sequence = 0;
    return options;
  }

  const ScratchFolder folder_;
  const int port_ = free_udp_port();
};

INSTANTIATE_TEST_SUITE_P(, LockstepRun, testing::Values(false, true),
                         [](const auto& client) { return client.param ? "Python" : "Cpp"; });

TEST_P(LockstepRun, EverySampleIsThereAndTheSameFromBothClients) {
  std::vector<lockstep::Truth> truths;
  std::string wanted;
  for (int i = 0; i <= 100; ++i) {
    truths.push_back(spiral(20 * i));
    wanted += fmt::format("0 {} {} {} True\n", i, 20'000'000 * i, (2 * i + 1) + (5 * i + 1));
  }
  for (const std::string prefix : {"cpp", "this"}) {
    Program imud("imud");
    imud.start(arguments(prefix));
    const Steps all = imud::steps(prefix == "this" && GetParam(), port_, patient(), truths);
    EXPECT_EQ(all.failure, "");
    EXPECT_EQ(all.answers, wanted);
    EXPECT_EQ(imud.stop(), 0) << imud.errors();
    EXPECT_EQ(summary(prefix)["truth"]["accepted"], 101);
    EXPECT_EQ(rows(prefix + "_slow"), 201U);
    EXPECT_EQ(rows(prefix + "_fast"), 501U);
  }
  EXPECT_TRUE(read_file(folder_ / "this_slow") == read_file(folder_ / "cpp_slow"));
  EXPECT_TRUE(read_file(folder_ / "this_fast") == read_file(folder_ / "cpp_fast"));
}

TEST_P(LockstepRun, ATruthWhoseTimeRunsBackIsRefused) {
  Program imud("imud");
  imud.start(arguments("out"));
  const Steps all = steps(port_, patient(), {spiral(0), spiral(20), spiral(10), spiral(20), spiral(40)});
  EXPECT_EQ(all.failure, "");
  EXPECT_EQ(all.answers,
            "0 0 0 2 True\n0 1 20000000 9 True\n0 2 20000000 9 False\n0 3 20000000 9 True\n0 4 40000000 16 True\n");
  EXPECT_EQ(imud.stop(), 0);
  EXPECT_EQ(rows("out_slow"), 5U);
  EXPECT_EQ(rows("out_fast"), 11U);
}

// Also a client whose run is as short as the first, and begins at the same time.
TEST_P(LockstepRun, ANewClientBeginsANewRun) {
  Program imud("imud");
  imud.start(arguments("out"));
  lockstep::Options options = patient();
  options.first_sequence.reset();
  for (int run = 0; run < 3; ++run) {
    const Steps all = steps(port_, options, {spiral(0), spiral(20)});
    EXPECT_TRUE(contains(all.answers, " 0 2 True\n")) << all.answers << all.failure;
    EXPECT_TRUE(contains(all.answers, " 20000000 9 True\n")) << all.answers << all.failure;
  }
  EXPECT_EQ(imud.stop(), 0);
  EXPECT_EQ(summary("out")["truth"]["runs"], 3);
}

TEST_P(LockstepRun, ImudMayStartLater) {
  auto waiting = std::async(std::launch::async, [this] { return steps(port_, patient(), {spiral(0), spiral(20)}); });
  EXPECT_EQ(waiting.wait_for(500ms), std::future_status::timeout);
  Program imud("imud");
  imud.start(arguments("out"));
  const Steps all = waiting.get();
  EXPECT_EQ(all.failure, "");
  EXPECT_EQ(all.answers, "0 0 0 2 True\n0 1 20000000 9 True\n");
}

TEST(LockstepClient, ThePythonDemonstrationTurnsImud) {
  const ScratchFolder folder;
  const std::string port = std::to_string(free_udp_port());
  std::ofstream(folder / "imud.toml") << "clock = \"lockstep\"\ntruth.port = \"udp:127.0.0.1:" << port
                                      << "\"\n[[imu]]\n"
                                      << "rate_hz = 200\nprotocol = \"csv\"\nport = \"file:" << folder / "out"
                                      << "\"\n"
                                      << "gyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n";
  Program imud("imud");
  imud.start({"run", folder / "imud.toml"});
  const auto demo =
      run_program(IMUD_PYTHON, {std::string(tools_folder) + "/lockstep_client.py", "127.0.0.1", port, "--for", "1"});
  EXPECT_EQ(demo.exit_code, 0) << demo.errors;
  EXPECT_EQ(demo.output, "0 s: 1 samples\n1 s: 201 samples\n");
  const auto help = run_program(IMUD_PYTHON, {std::string(tools_folder) + "/lockstep_client.py", "--help"});
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_TRUE(contains(help.output, "--rate-rad-per-s")) << help.output;
}

// An imud in real time answers that it has not emitted what an imud in lockstep would have.
TEST(LockstepClient, AnImudThatIsNotInLockstepIsAFailure) {
  const ScratchFolder folder;
  const std::string port = std::to_string(free_udp_port());
  std::ofstream(folder / "imud.toml") << "truth.port = \"udp:127.0.0.1:" << port << "\"\n[[imu]]\n"
                                      << "rate_hz = 200\nprotocol = \"csv\"\nport = \"file:" << folder / "out"
                                      << "\"\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n";
  Program imud("imud");
  imud.start({"run", folder / "imud.toml"});
  const auto demo = run_program(IMUD_PYTHON, {std::string(tools_folder) + "/lockstep_client.py", "127.0.0.1", port});
  EXPECT_EQ(demo.exit_code, 1);
  EXPECT_TRUE(contains(demo.errors, "right would be clock = \"lockstep\"")) << demo.errors;
  EXPECT_EQ(lines_of(demo.errors).size(), 1U) << demo.errors;
}

TEST(LockstepClient, TheHeadersCompileAlone) {
  const ScratchFolder folder;
  for (const std::string header : {"lockstep_client.hpp", "realtime_client.hpp"})
    std::filesystem::copy_file(std::string(tools_folder) + "/" + header, folder / header);
  std::ofstream(folder / "simulator.cpp") << "#include \"realtime_client.hpp\"\n";
  for (const std::string compiler : {"g++", "clang++"})
    for (const std::string standard : {"-std=c++17", "-std=c++20"}) {
      const auto result = run_program(
          "/usr/bin/env", {compiler, standard, "-fsyntax-only", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion",
                           "-Wshadow", "-Wold-style-cast", "-Werror", folder / "simulator.cpp"});
      EXPECT_EQ(result.exit_code, 0) << compiler << ' ' << standard << '\n' << result.errors;
    }
}

}  // namespace
}  // namespace imud
