// imud replay --fast --threads: the same bytes and the same summary by one, two and three threads.
#include <gtest/gtest.h>
#include <sched.h>

#include <array>
#include <atomic>
#include <chrono>
#include <deque>
#include <thread>

#include "emulator/config/load_config.hpp"
#include "emulator/drive/truth_pieces.hpp"
#include "emulator/engine/encoding_thread.hpp"
#include "protocols/protocol.hpp"
#include "tests/emulator/run/run_test.hpp"
#include "tests/support/text.hpp"
#include "tests/transports/capture_builder.hpp"

namespace imud {
namespace {

const std::string threads_flight = IMUD_TEST_DATA "/captures/jsbsim_c172_10s.pcap";

class ThreadsTest : public RunTest {
 protected:
  // The files, the summary without durations, and the log of a replay.
  struct Left {
    std::vector<std::string> files;
    nlohmann::json summary;
    int exit_code = 0;
    std::string errors;
  };
  // An imu: its protocol, further keys of its table, and the transport that writes its file.
  struct One {
    std::string protocol, keys, scheme = "file";
  };
  Left replay(const std::string& truth, const std::string& capture, const std::vector<One>& imus, unsigned threads,
              const std::vector<std::string>& options = {}) {
    std::string text = "seed = 1\nclock = \"fast\"\n[truth]\n" + truth;
    for (std::size_t i = 0; i < imus.size(); ++i)
      text += fmt::format("[[imu]]\nname = \"imu{}\"\nprotocol = \"{}\"\nport = \"{}:{}\"\n{}", i, imus[i].protocol,
                          imus[i].scheme, path("out" + std::to_string(i)), imus[i].keys);
    std::vector<std::string> arguments = {
        "replay",    write("threads.toml", text), capture,     "--fast",
        "--threads", std::to_string(threads),     "--summary", path("summary.json")};
    arguments.insert(arguments.end(), options.begin(), options.end());
    const ProgramResult result = run_program("imud", arguments);
    if (!std::filesystem::exists(path("summary.json"))) throw std::runtime_error(result.errors);
    Left left{{}, summary(), result.exit_code, result.errors};
    for (std::size_t i = 0; i < imus.size(); ++i) left.files.push_back(read_file(path("out" + std::to_string(i))));
    left.summary.erase("duration_s");
    left.summary["truth"].erase("rate_hz");
    return left;
  }
  // Compares two and three threads with one, and returns what one leaves. `encodes`: the frames can be made apart,
  // otherwise the log names one thread less, and does not name a single one.
  Left compare(const std::string& truth, const std::string& capture, const std::vector<One>& imus,
               const std::vector<std::string>& options = {}, bool encodes = true) {
    const Left one = replay(truth, capture, imus, 1, options);
    for (const unsigned threads : {2U, 3U}) {
      const Left more = replay(truth, capture, imus, threads, options);
      EXPECT_EQ(more.exit_code, one.exit_code) << more.errors;
      EXPECT_EQ(more.summary, one.summary) << threads << " threads";
      for (std::size_t i = 0; i < imus.size(); ++i)
        EXPECT_TRUE(more.files[i] == one.files[i]) << threads << " threads, imu" << i;
      const unsigned used = encodes ? threads : threads - 1;
      EXPECT_EQ(contains(more.errors, fmt::format(" by {} threads", used)), used > 1) << more.errors;
    }
    return one;
  }
  // A row of the truth format csv.
  static std::string row(std::int64_t ms) {
    return fmt::format("{},0,0,0,0.{:03},0,0,0,0,-9.8\n", ms * 1'000'000, ms % 1000);
  }
  const std::string range = "gyro.max_rad_per_s = 100\naccelerometer.max_m_per_s2 = 1000\n";
  static constexpr std::string_view columns =
      "time_ns,sigma_BN_1,sigma_BN_2,sigma_BN_3,omega_BN_B_x,omega_BN_B_y,omega_BN_B_z,"
      "nonConservativeAccelpntB_B_x,nonConservativeAccelpntB_B_y,nonConservativeAccelpntB_B_z\n";
};

// Every product, some with deadlines of their own (heartbeats, slow messages), on byte files and CAN logs.
TEST_F(ThreadsTest, DatagramsAndEveryKindOfPort) {
  std::vector<One> imus = {{"native", "rate_hz = 1000\n" + range}};
  for (const Protocol* protocol : protocols())
    imus.push_back({std::string(protocol->name), protocol->product != nullptr ? "" : "rate_hz = 100\n" + range,
                    protocol->link == Link::can ? "canfile" : "file"});
  const Left left = compare("port = \"udp:127.0.0.1:5140\"\nformat = \"jsbsim\"\n", threads_flight, imus);
  EXPECT_EQ(left.exit_code, 0) << left.errors;
  ASSERT_EQ(left.summary["imus"].size(), imus.size());
  EXPECT_GT(imus.size(), 15U);
  EXPECT_EQ(left.summary["imus"][0]["samples"], 10001);
  for (std::size_t i = 0; i < imus.size(); ++i) {
    if (imus[i].protocol == "nos3-imu") continue;               // which only answers
    EXPECT_GT(left.files[i].size(), 300U) << imus[i].protocol;  // of canopen, heartbeats alone
  }
}

// Runs that follow each other, rows that are refused, and an end within a row.
TEST_F(ThreadsTest, ADamagedCaptureOfSeveralRuns) {
  std::string text(columns);
  for (int run = 0; run < 3; ++run)
    for (int ms = 0; ms < 3000; ms += 10) {
      text += row(ms);
      if (ms == 1000) text += "x" + row(ms + 1) + row(ms) + "# a comment\n";
    }
  const std::string capture = write("flight.csv", text + "2999");
  const std::vector<One> imus = {{"native", "rate_hz = 1000\n" + range}, {"csv", "rate_hz = 250\n" + range}};
  const std::string truth = "port = \"file:flight.csv\"\nformat = \"csv\"\n";
  const Left left = compare(truth, capture, imus);
  EXPECT_EQ(left.exit_code, 3) << left.errors;
  EXPECT_EQ(left.summary["truth"]["runs"], 3) << left.errors;
  EXPECT_EQ(left.summary["truth"]["accepted"], 896);  // a run begins after two refused rows
  EXPECT_EQ(left.summary["truth"]["refused"].size(), 3U) << left.summary["truth"]["refused"];
  const Left beginning = compare(truth, capture, imus, {"--for", "1.5"});
  EXPECT_EQ(beginning.exit_code, 3) << beginning.errors;
  EXPECT_LT(beginning.files[0].size(), left.files[0].size() / 4);
}

// Samples of motion alone go another way between the threads than samples with a filter's solution; here both are of
// the same instants.
TEST_F(ThreadsTest, SamplesWithAndWithoutASolution) {
  std::string text(columns);
  for (int ms = 0; ms < 3000; ms += 10) text += row(ms);
  const std::vector<One> imus = {{"native", "rate_hz = 1000\n" + range},
                                 {"mip", "navigation.solution = \"filter\"\n"},
                                 {"stim300", ""},
                                 {"mip", "navigation.solution = \"filter\"\n"}};
  const Left left = compare("port = \"file:flight.csv\"\nformat = \"csv\"\n", write("flight.csv", text), imus);
  EXPECT_EQ(left.exit_code, 0) << left.errors;
  ASSERT_EQ(left.files.size(), imus.size());
  for (const std::string& file : left.files) EXPECT_GT(file.size(), 10'000U);
}

// The device of an imu with faults stays with its sensor; the other thread may still decode.
TEST_F(ThreadsTest, FaultsAreInTheSameFrames) {
  std::string text(columns);
  for (int ms = 0; ms < 3000; ms += 10) text += row(ms);
  const std::string fault =
      "[[fault]]\nimu = \"imu0\"\ntarget = \"message\"\nkind = \"missing\"\nat_s = 1\nfor_s = 0.5\neach = "
      "0.5\n";
  const Left left =
      compare("port = \"file:flight.csv\"\nformat = \"csv\"\n", write("flight.csv", text),
              {{"native", "rate_hz = 1000\n" + range}, {"native", "rate_hz = 1000\n" + range + fault}}, {}, false);
  EXPECT_EQ(left.exit_code, 0) << left.errors;
  EXPECT_LT(left.files[0].size(), left.files[1].size());
}

// A container limits the processors by an affinity, and so does taskset.
TEST_F(ThreadsTest, ASingleUsableProcessorMakesOneThread) {
  std::string text(columns);
  for (int ms = 0; ms < 100; ms += 10) text += row(ms);
  const std::string flight = write("flight.csv", text);
  const std::string c = config("fast", "file:flight.csv", "csv", 1000, "native", "file:" + path("out"));
  cpu_set_t usable, one;
  ASSERT_EQ(::sched_getaffinity(0, sizeof usable, &usable), 0);
  std::size_t cpu = 0;
  while (!CPU_ISSET(cpu, &usable)) ++cpu;
  CPU_ZERO(&one);
  CPU_SET(cpu, &one);
  ASSERT_EQ(::sched_setaffinity(0, sizeof one, &one), 0);
  const ProgramResult result = run_program("imud", {"replay", c, flight});
  ASSERT_EQ(::sched_setaffinity(0, sizeof usable, &usable), 0);
  EXPECT_EQ(result.exit_code, 0) << result.errors;
  EXPECT_FALSE(contains(result.errors, " threads")) << result.errors;
}

// A record needs the bytes of the truth, and standard input may keep a thread waiting.
TEST_F(ThreadsTest, ARecordAndStandardInputAreOfOneThread) {
  std::string text(columns);
  for (int ms = 0; ms < 1000; ms += 10) text += row(ms);
  const std::string c = config("fast", "file:flight.csv", "csv", 1000, "native", "file:" + path("out"));
  const auto frames_of = [&](std::vector<std::string> arguments, const std::optional<std::string>& input,
                             bool threads) {
    arguments.insert(arguments.begin(), {"replay", c});
    const ProgramResult result = run_program("imud", arguments, input);
    EXPECT_EQ(result.exit_code, 0) << result.errors;
    EXPECT_EQ(contains(result.errors, " threads"), threads) << result.errors;
    return read_file(path("out"));
  };
  const std::string flight_file = write("flight.csv", text);
  const std::string frames = frames_of({flight_file, "--threads", "3"}, {}, true);
  EXPECT_GT(frames.size(), 100'000U);
  EXPECT_TRUE(frames_of({flight_file, "--threads", "3", "--record", path("r.pcapng")}, {}, false) == frames);
  EXPECT_TRUE(frames_of({"file:-", "--threads", "3"}, text, false) == frames);
  // Also in a folder that has a file of the name -.
  write("-", "");
  const ProgramResult beside =
      run_program("/usr/bin/env",
                  {"-C", path("."), IMUD_BIN_DIR "/imud", "replay", c, "file:-", "--fast", "--threads", "3"}, text);
  EXPECT_EQ(beside.exit_code, 0) << beside.errors;
  EXPECT_FALSE(contains(beside.errors, " threads")) << beside.errors;
  EXPECT_TRUE(read_file(path("out")) == frames);
}

// Packets to another port: a run must be able to stop before they end.
TEST_F(ThreadsTest, ManySkippedPacketsDoNotHoldTheReaderUp) {
  capture::Bytes content = capture::file_header({}, 1);
  const capture::Bytes datagram = capture::ethernet(0x0800, capture::ipv4(capture::udp("x", 9811)));
  for (std::int64_t ns = 0; ns < 5000; ++ns) content += capture::file_record({}, {ns, datagram});
  capture::write_file(path("foreign.pcap"), content);
  TruthConfig config;
  config.port = "pcap:" + path("foreign.pcap") + "?port=9810";
  config.format = find_truth_format("native");
  ASSERT_NE(config.format, nullptr);
  TruthPieceReader reader(config);
  int pieces = 0;
  for (TruthPiece piece; reader.read(piece); ++pieces) EXPECT_TRUE(piece.records.empty());
  EXPECT_EQ(pieces, 5);  // after 1024 packets each, and the end
  EXPECT_EQ(reader.port().counters().not_ours, 5000U);
}

// Otherwise the sampling thread would compute all of them, with the same bytes.
TEST_F(ThreadsTest, RandomNumbersAreThereAhead) {
  std::deque<NormalStock> stocks;
  NormalStock& stock = stocks.emplace_back(NormalBatch::samples);
  NormalBatch batch = {.seed = 1, .stream = 2, .purpose = 3, .number = 0};
  NormalBatch::Deviates taken, own;
  EXPECT_FALSE(stock.take(batch, taken)) << "only the next one is requested";
  const std::atomic<bool> stop = false;
  const EncodingThread encoding(1, stop, stocks);
  ++batch.number;
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (!stock.take(batch, taken) && std::chrono::steady_clock::now() < end) std::this_thread::yield();
  batch.compute(own);
  EXPECT_EQ(taken, own);

  const std::array<std::string, 1> model = {"imu.0.model=stim300"};
  const Config noisy = load_config(config("fast", "file:flight.csv", "csv", 1000, "native", "file:out"), model);
  std::deque<NormalStock> of_imu;
  Imu(noisy.imus[0].model, 1, 1).take_numbers_from(of_imu, 1000);
  EXPECT_EQ(of_imu.size(), 8U) << "white noise and three processes of the flicker, of two triads";
}

// A hundred thousand numbers of each kind in a sample.
TEST_F(ThreadsTest, ManyInternalSamplesNeedLittleMemory) {
  std::string text(columns);
  for (int ms = 0; ms <= 3000; ms += 100) text += row(ms);
  const std::string c = config("fast", "file:flight.csv", "csv", 1, "native", "file:" + path("out"));
  const ProgramResult result = run_program(
      "/usr/bin/prlimit", {"--as=1500000000", IMUD_BIN_DIR "/imud", "replay", c, write("flight.csv", text), "--fast",
                           "--threads", "3", "--set", "imu.0.model=stim300", "--set", "imu.0.internal_rate_hz=1e5"});
  EXPECT_EQ(result.exit_code, 0) << result.errors;
  EXPECT_TRUE(contains(result.errors, " by 3 threads")) << result.errors;
}

TEST_F(ThreadsTest, TheirNumberIsChecked) {
  const ProgramResult result = run_program("imud", {"replay", "x.toml", threads_flight, "--fast", "--threads", "4"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_TRUE(contains(result.errors, "--threads")) << result.errors;
}

}  // namespace
}  // namespace imud
