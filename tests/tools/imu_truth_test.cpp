#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cstring>

#include "protocols/native_truth.hpp"
#include "protocols/truth_format.hpp"
#include "tests/support/decode_truth.hpp"
#include "tests/support/free_port.hpp"
#include "tests/support/text.hpp"
#include "tests/tools/loopback_socket.hpp"
#include "tests/tools/run_program.hpp"
#include "tests/transports/capture_builder.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "tools/truth/motion.hpp"

namespace imud {
namespace {

using Datagrams = std::vector<std::vector<std::byte>>;

std::unique_ptr<TruthDecoder> decoder_of(std::string_view format) {
  const TruthFormat* found = find_truth_format(format);
  return found->make(Settings(found->settings));
}

std::string datagram_text(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// Returns the truths in `records`, which must be good or carry no state.
template <class Records>
std::vector<Truth> truths_in(const Records& records, std::string_view format) {
  const auto decoder = decoder_of(format);
  std::vector<Truth> truths;
  for (const auto& record : records) {
    Truth truth;
    const TruthResult result = decode_truth(*decoder, std::as_bytes(std::span(record)), truth);
    if (result == TruthResult::ok)
      truths.push_back(truth);
    else
      EXPECT_EQ(result, TruthResult::no_state);
  }
  return truths;
}

// Expects the same bits, except for the attitude, which is rounded as MRPs.
void expect_same(const Truth& is, const Truth& wanted) {
  EXPECT_EQ(is.time, wanted.time);
  EXPECT_EQ(is.r_BN_N, wanted.r_BN_N);
  EXPECT_EQ(is.v_BN_N, wanted.v_BN_N);
  EXPECT_LT((is.q_NB.coeffs() * (is.q_NB.dot(wanted.q_NB) < 0 ? -1.0 : 1.0) - wanted.q_NB.coeffs()).norm(), 1e-15);
  EXPECT_EQ(is.omega_BN_B, wanted.omega_BN_B);
  EXPECT_EQ(is.omegaDot_BN_B, wanted.omegaDot_BN_B);
  EXPECT_EQ(is.specific_force_B, wanted.specific_force_B);
  EXPECT_EQ(is.accumulated_dv, AccumulatedDv::inertial);
  EXPECT_EQ(is.accumulated_dv_B, wanted.accumulated_dv_B);
}

std::vector<std::uint32_t> sequences_of(const Datagrams& datagrams) {
  std::vector<std::uint32_t> sequences;
  for (const auto& datagram : datagrams) {
    std::uint32_t sequence = 0;
    std::memcpy(&sequence, datagram.data() + 12, sizeof sequence);
    sequences.push_back(sequence);
  }
  return sequences;
}

TEST(ImuTruth, SendsEveryMotion) {
  for (const Motion& motion : motions()) {
    LoopbackSocket receiver;
    const auto result = run_program("imu-truth", {std::string(motion.name), "--to", receiver.spec(), "--rate", "300",
                                                  "--for", "0.5", "--start", "-2", "--stream", "7"});
    EXPECT_EQ(result.exit_code, 0);
    const auto truths = truths_in(receiver.receive_all(), "native");
    ASSERT_EQ(truths.size(), 151U);
    for (std::size_t k = 0; k < truths.size(); ++k) {
      const TruthTime time = TruthTime{-2'000'000'000} + Grid(300).offset(k);
      expect_same(truths[k], motion.at(time, {}));
      EXPECT_EQ(truths[k].sequence, k);
      EXPECT_EQ(truths[k].stream, 7U);
      EXPECT_EQ(truths[k].new_run, k == 0);
      EXPECT_FALSE(truths[k].acknowledge);
    }
    EXPECT_TRUE(contains(result.errors, "sent         151 datagrams, 31408 bytes in ")) << result.errors;
    EXPECT_TRUE(contains(result.errors, "pace         p50 ")) << result.errors;
  }
}

// Stamps are as far apart as the truths, whenever the datagrams leave.
TEST(ImuTruth, StampsTruthsWithAClockThatHostsShare) {
  const auto now = [](clockid_t clock) {
    timespec time{};
    ::clock_gettime(clock, &time);
    return SharedTime{std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec};
  };
  const std::pair<std::string, SharedClock> clocks[] = {
      {"tai", SharedClock::tai}, {"utc", SharedClock::utc}, {"monotonic", SharedClock::monotonic}};
  for (const auto& [word, clock] : clocks) {
    const clockid_t id = clock == SharedClock::tai   ? CLOCK_TAI
                         : clock == SharedClock::utc ? CLOCK_REALTIME
                                                     : CLOCK_MONOTONIC;
    LoopbackSocket receiver;
    const SharedTime before = now(id);
    ASSERT_EQ(run_program("imu-truth", {"turntable", "--to", receiver.spec(), "--rate", "300", "--for", "0.1",
                                        "--start", "5", "--stamp", word})
                  .exit_code,
              0);
    const SharedTime after = now(id);
    const auto truths = truths_in(receiver.receive_all(), "native");
    ASSERT_EQ(truths.size(), 31U);
    for (std::size_t k = 0; k < truths.size(); ++k) {
      EXPECT_EQ(truths[k].stamp.clock, clock);
      EXPECT_EQ(truths[k].stamp.time - truths[0].stamp.time, truths[k].time - truths[0].time) << word << ' ' << k;
    }
    EXPECT_GE(truths.front().stamp.time, before) << word;
    EXPECT_LE(truths.back().stamp.time, after) << word;
  }
  const std::string to = LoopbackSocket().spec();
  const auto refused = [&](std::vector<std::string> words, std::string_view why) {
    words.insert(words.end(), {"--to", to});
    const auto result = run_program("imu-truth", words);
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_TRUE(contains(result.errors, why)) << result.errors;
  };
  refused({"rest", "--stamp", "gps"}, "--stamp gps: right would be tai, utc or monotonic");
  refused({"rest", "--stamp", "tai", "--fast", "--for", "1"}, "--stamp: not with --fast");
  refused({"rest", "--stamp", "tai", "--lockstep"}, "--stamp: not in lockstep");
  refused({"rest", "--stamp", "tai", "--format", "csv"}, "--stamp: only for native datagrams");
}

TEST(ImuTruth, TakesMotionParameters) {
  LoopbackSocket receiver;
  const auto result =
      run_program("imu-truth", {"coning", "--half-angle-rad", "0.1", "--frequency-hz", "3", "--gravity-m-per-s2", "0",
                                "--to", receiver.spec(), "--for", "0.1", "--fast", "--no-new-run"});
  EXPECT_EQ(result.exit_code, 0);
  MotionParameters parameters;
  parameters.half_angle_rad = 0.1;
  parameters.frequency_hz = 3;
  parameters.gravity_m_per_s2 = 0;
  const auto truths = truths_in(receiver.receive_all(), "native");
  ASSERT_EQ(truths.size(), 11U);
  for (const Truth& truth : truths) {
    expect_same(truth, find_motion("coning")->at(truth.time, parameters));
    EXPECT_FALSE(truth.new_run);
  }
  EXPECT_FALSE(contains(result.errors, "pace")) << result.errors;
}

TEST(ImuTruth, PaceIsThatOfTheRate) {
  LoopbackSocket receiver;
  const auto start = std::chrono::steady_clock::now();
  const auto result = run_program("imu-truth", {"rest", "--to", receiver.spec(), "--rate", "10", "--for", "0.5"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_GE(std::chrono::steady_clock::now() - start, std::chrono::milliseconds(500));
  EXPECT_EQ(receiver.receive_all().size(), 6U);
}

TEST(ImuTruth, SendsRows) {
  LoopbackSocket receiver;
  const auto result =
      run_program("imu-truth", {"spiral", "--format", "csv", "--to", receiver.spec(), "--for", "0.2", "--fast"});
  EXPECT_EQ(result.exit_code, 0);
  const auto datagrams = receiver.receive_all();
  ASSERT_EQ(datagrams.size(), 22U);
  EXPECT_TRUE(datagram_text(datagrams[0]).starts_with("time_ns,r_BN_N_x,"));
  const auto truths = truths_in(datagrams, "csv");
  ASSERT_EQ(truths.size(), 21U);
  for (const Truth& truth : truths) expect_same(truth, find_motion("spiral")->at(truth.time, {}));
}

TEST(ImuTruth, WritesCsv) {
  const ScratchFolder folder;
  const auto result = run_program(
      "imu-truth", {"boost", "--csv", folder / "truth.csv", "--rate", "50", "--for", "2", "--start", "1"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(result.output, "");
  const auto truths = truths_in(lines_of(read_file(folder / "truth.csv")), "csv");
  ASSERT_EQ(truths.size(), 101U);
  EXPECT_EQ(truths.front().time.ns, 1'000'000'000);
  EXPECT_EQ(truths.back().time.ns, 3'000'000'000);
  for (const Truth& truth : truths) expect_same(truth, find_motion("boost")->at(truth.time, {}));

  const auto to_stdout =
      run_program("imu-truth", {"boost", "--csv", "-", "--rate", "50", "--for", "2", "--start", "1"});
  EXPECT_EQ(to_stdout.output, read_file(folder / "truth.csv"));
}

TEST(ImuTruth, FaultsAreTheSameForTheSameSeed) {
  const auto run = [](const std::string& seed) {
    LoopbackSocket receiver;
    const auto result = run_program(
        "imu-truth", {"turntable", "--to", receiver.spec(), "--rate", "1000", "--for", "1.999", "--fast", "--drop",
                      "10", "--duplicate", "5", "--reorder", "4", "--corrupt", "3", "--seed", seed});
    EXPECT_EQ(result.exit_code, 0);
    return std::pair(receiver.receive_all(), result.errors);
  };
  const auto [datagrams, report] = run("5");
  EXPECT_EQ(run("5").first, datagrams);
  EXPECT_NE(run("6").first, datagrams);

  unsigned dropped = 0, duplicated = 0, swapped = 0, corrupted = 0;
  const std::size_t faults = report.find("faults");
  ASSERT_NE(faults, std::string::npos) << report;
  ASSERT_EQ(
      std::sscanf(report.c_str() + faults, "faults %u dropped, %u sent twice, %u swapped with the next, %u corrupted",
                  &dropped, &duplicated, &swapped, &corrupted),
      4);
  EXPECT_EQ(datagrams.size(), 2000 - dropped + duplicated);
  // Binomial: five standard deviations.
  EXPECT_NEAR(dropped, 200, 68);
  EXPECT_NEAR(duplicated, 90, 49);
  EXPECT_NEAR(swapped, 72, 44);
  EXPECT_NEAR(corrupted, 54, 38);

  const auto decoder = decoder_of("native");
  unsigned refused = 0, back = 0;
  std::int64_t before = -1;
  for (const auto& datagram : datagrams) {
    Truth truth;
    if (decode_truth(*decoder, datagram, truth) != TruthResult::ok) {
      ++refused;
      continue;
    }
    if (truth.time.ns < before) ++back;
    before = truth.time.ns;
  }
  EXPECT_GT(refused, 0U);
  EXPECT_GT(back, 0U);
}

// The rate of one fault does not change which datagrams have another fault.
TEST(ImuTruth, FaultsAreIndependent) {
  const auto sequences = [](const std::vector<std::string>& more) {
    LoopbackSocket receiver;
    std::vector<std::string> arguments = {"rest", "--to", receiver.spec(), "--for", "3", "--fast", "--drop", "20"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    EXPECT_EQ(run_program("imu-truth", arguments).exit_code, 0);
    auto all = sequences_of(receiver.receive_all());
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    return all;
  };
  const auto alone = sequences({});
  EXPECT_LT(alone.size(), 301U);
  EXPECT_EQ(sequences({"--duplicate", "30", "--reorder", "30"}), alone);
}

TEST(ImuTruth, ReorderedDatagramsAreNotLost) {
  LoopbackSocket receiver;
  const auto result =
      run_program("imu-truth", {"rest", "--to", receiver.spec(), "--for", "1", "--fast", "--reorder", "100"});
  EXPECT_EQ(result.exit_code, 0);
  auto sequences = sequences_of(receiver.receive_all());
  ASSERT_EQ(sequences.size(), 101U);
  EXPECT_EQ(sequences[0], 1U);
  EXPECT_EQ(sequences[1], 0U);
  std::sort(sequences.begin(), sequences.end());
  for (std::uint32_t k = 0; k < 101; ++k) EXPECT_EQ(sequences[k], k);
}

// Answers as imud does; every `silent_every`th datagram gets none the first time.
std::vector<Truth> answer_all(LoopbackSocket& receiver, Program& sender, std::size_t silent_every = 0) {
  const auto decoder = decoder_of("native");
  const auto frames = std::make_unique<FrameBuffer>();
  std::vector<Truth> truths;
  std::size_t received = 0;
  while (sender.is_running()) {
    const auto datagram = receiver.receive(20);
    Truth truth;
    if (!datagram || decode_truth(*decoder, *datagram, truth) != TruthResult::ok) continue;
    if (silent_every != 0 && ++received % silent_every == 0) continue;
    if (truths.empty() || truths.back().sequence != truth.sequence) truths.push_back(truth);
    frames->clear();
    decoder->acknowledge(truth, truth.time, 2 * truths.size(), *frames);
    // An answer of another stream, then the right one.
    Truth other = truth;
    ++other.stream;
    decoder->acknowledge(other, truth.time, 0, *frames);
    receiver.answer(frames->frames()[1].bytes);
    receiver.answer(frames->frames()[0].bytes);
  }
  return truths;
}

TEST(ImuTruth, LockstepWaitsForEveryAnswer) {
  LoopbackSocket receiver;
  Program sender("imu-truth");
  sender.start({"turntable", "--to", receiver.spec(), "--for", "5", "--fast", "--lockstep", "--duplicate", "10",
                "--corrupt", "1", "--drop", "1"});
  const auto truths = answer_all(receiver, sender, 100);
  EXPECT_EQ(sender.wait(), 0);
  ASSERT_EQ(truths.size(), 501U);
  for (std::size_t k = 0; k < truths.size(); ++k) {
    EXPECT_EQ(truths[k].sequence, k);
    EXPECT_TRUE(truths[k].acknowledge);
  }
  EXPECT_TRUE(contains(sender.errors(), "acknowledged 501, ")) << sender.errors();
  EXPECT_FALSE(contains(sender.errors(), "acknowledged 501, 0 sent again")) << sender.errors();
  EXPECT_TRUE(contains(sender.errors(), "receiver     reached 5.000000000 s, 1002 samples emitted"));
}

TEST(ImuTruth, LockstepFailsWithoutAnswer) {
  LoopbackSocket silent;
  const auto result =
      run_program("imu-truth", {"rest", "--to", silent.spec(), "--for", "1", "--lockstep", "--resend", "2"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_TRUE(contains(result.errors, "no answer to sequence 0 from udp:127.0.0.1:")) << result.errors;
  EXPECT_TRUE(contains(result.errors, "sent 3 times")) << result.errors;
  EXPECT_EQ(silent.receive_all().size(), 3U);

  const std::string nobody = fmt::format("udp:127.0.0.1:{}", free_udp_port());
  EXPECT_EQ(run_program("imu-truth", {"rest", "--to", nobody, "--lockstep", "--resend", "1"}).exit_code, 1);
}

std::string capture_file(const ScratchFolder& folder) {
  const capture::Format format;
  std::string bytes = capture::file_header(format, 1);
  std::int64_t ns = 1'600'000'000'000'000'000;
  for (const auto& [payload, port] :
       {std::pair("first", 9810U), {"other", 9811U}, {"second", 9810U}, {"", 9810U}, {"last", 9810U}}) {
    bytes +=
        capture::file_record(format, {ns, capture::ethernet(0x0800, capture::ipv4(capture::udp(payload, port)))});
    ns += 50'000'000;
  }
  capture::write_file(folder / "truth.pcap", bytes);
  return folder / "truth.pcap";
}

TEST(ImuTruth, ResendsACaptureByteForByte) {
  const ScratchFolder folder;
  const std::string file = capture_file(folder);
  for (const std::string& name : {file + "?port=9810", "pcap:" + file + "?port=9810"}) {
    LoopbackSocket receiver;
    const auto start = std::chrono::steady_clock::now();
    const auto result = run_program("imu-truth", {"capture", name, "--to", receiver.spec()});
    EXPECT_EQ(result.exit_code, 0) << result.errors;
    EXPECT_GE(std::chrono::steady_clock::now() - start, std::chrono::milliseconds(200));
    std::vector<std::string> texts;
    for (const auto& datagram : receiver.receive_all()) texts.push_back(datagram_text(datagram));
    EXPECT_EQ(texts, (std::vector<std::string>{"first", "second", "", "last"}));
  }
  LoopbackSocket receiver;
  EXPECT_EQ(run_program("imu-truth", {"capture", file, "--to", receiver.spec(), "--fast"}).exit_code, 0);
  EXPECT_EQ(receiver.receive_all().size(), 5U);
  EXPECT_EQ(run_program("imu-truth", {"capture", file, "--to", receiver.spec(), "--fast", "--for", "0.12"}).exit_code,
            0);
  EXPECT_EQ(receiver.receive_all().size(), 3U);

  const auto none = run_program("imu-truth", {"capture", file + "?port=1", "--to", receiver.spec()});
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_TRUE(contains(none.errors, "no datagram in it for that port")) << none.errors;
}

// A table of names on the command line, as truth.columns in a configuration.
TEST(ImuTruth, NamesTheColumnsOfACapture) {
  const ScratchFolder folder;
  capture::write_file(folder / "log.csv", "t,qw,qx,qy,qz,P,Q,R\n0,1,0,0,0,0,0,180\n0.01,1,0,0,0,90,0,0\n");
  std::vector<std::string> arguments = {"capture", folder / "log.csv", "--format", "csv", "--csv", "-", "--set"};
  const std::string names = "time_s=t,q_NB_w=qw,q_NB_x=qx,q_NB_y=qy,q_NB_z=qz,p_deg_per_s=P,q_deg_per_s=Q";
  arguments.push_back("columns=" + names + ",r_deg_per_s=R");
  const auto named = run_program("imu-truth", arguments);
  EXPECT_EQ(named.exit_code, 0) << named.errors;
  EXPECT_EQ(named.output,
            "time_ns,sigma_BN_1,sigma_BN_2,sigma_BN_3,omega_BN_B_x,omega_BN_B_y,omega_BN_B_z\n"
            "0,0,0,0,0,0,3.141592653589793\n10000000,0,0,0,1.5707963267948966,0,0\n");
  arguments.back() = "columns=" + names + ",r_deg_per_s=S";
  const auto missing = run_program("imu-truth", arguments);
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_TRUE(contains(missing.errors, "3 columns")) << missing.errors;
}

// Port 9 of the loopback address is the port of discard (RFC 863), which does not run.
TEST(ImuTruth, TruthsWithoutAReceiverAreReported) {
  const auto tcp = run_program("imu-truth", {"coning", "--to", "tcp:127.0.0.1:9", "--rate", "100", "--for", "0.5"});
  EXPECT_EQ(tcp.exit_code, 3) << tcp.errors;
  EXPECT_TRUE(contains(tcp.errors, "sent         0 datagrams")) << tcp.errors;
  EXPECT_TRUE(contains(tcp.errors, "refused      51 by the network")) << tcp.errors;
  const auto udp = run_program("imu-truth", {"coning", "--to", "udp:127.0.0.1:9", "--rate", "100", "--for", "0.5"});
  EXPECT_EQ(udp.exit_code, 0) << udp.errors;
  EXPECT_TRUE(contains(udp.errors, " times the answer was that nobody listens")) << udp.errors;
  LoopbackSocket receiver;
  const auto good = run_program("imu-truth", {"coning", "--to", receiver.spec(), "--rate", "100", "--for", "0.5"});
  EXPECT_EQ(good.exit_code, 0) << good.errors;
  EXPECT_FALSE(contains(good.errors, "unheard")) << good.errors;
}

// The columns are those that the truths have; what is refused is counted, and makes the exit code 3.
TEST(ImuTruth, WritesTheTruthsOfACaptureAsCsv) {
  const ScratchFolder folder;
  const capture::Format format;
  const auto record = [&](const std::string& payload) {
    return capture::file_record(format, {0, capture::ethernet(0x0800, capture::ipv4(capture::udp(payload, 9810)))});
  };
  const auto native = [](int step, std::uint32_t stream) {
    Truth truth = find_motion("spiral")->at(TruthTime{step * 10'000'000}, {});
    truth.stream = stream;
    truth.accumulated_dv = AccumulatedDv::none;
    std::array<std::byte, native_truth_size> bytes;
    encode_native_truth(truth, bytes);
    return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  };
  std::string good = capture::file_header(format, 1), bad = good;
  for (int step = 0; step < 50; ++step) good += record(native(step, 7)) + record(native(step, 8));
  for (int step = 0; step < 50; ++step) bad += record(step == 9 ? "IMUT" : native(step, 7));
  capture::write_file(folder / "good.pcap", good);
  capture::write_file(folder / "bad.pcap", bad);

  const auto whole = run_program("imu-truth", {"capture", folder / "good.pcap", "--csv", "-"});
  EXPECT_EQ(whole.exit_code, 0) << whole.errors;
  EXPECT_TRUE(contains(whole.errors, "50 truths\n")) << whole.errors;
  EXPECT_TRUE(contains(whole.errors, "50 truths of other vehicles; --stream chooses one")) << whole.errors;
  const auto rows = lines_of(whole.output);
  ASSERT_EQ(rows.size(), 51U);
  EXPECT_TRUE(rows[0].starts_with("time_ns,r_BN_N_x,")) << rows[0];
  EXPECT_FALSE(contains(rows[0], "TotalAccumDV_BN_B_x")) << rows[0];
  const auto decoder = find_truth_format("csv")->make(Settings(find_truth_format("csv")->settings));
  Truth truth;
  EXPECT_EQ(decode_truth(*decoder, std::as_bytes(std::span(rows[0])), truth), TruthResult::no_state);
  for (std::size_t i = 1; i < rows.size(); ++i) {
    const Truth wanted = find_motion("spiral")->at(TruthTime{static_cast<std::int64_t>(i - 1) * 10'000'000}, {});
    ASSERT_EQ(decode_truth(*decoder, std::as_bytes(std::span(rows[i])), truth), TruthResult::ok);
    EXPECT_EQ(truth.time, wanted.time);
    EXPECT_EQ(truth.specific_force_B, wanted.specific_force_B);
    EXPECT_EQ(truth.omegaDot_BN_B, wanted.omegaDot_BN_B);
    EXPECT_NEAR(truth.q_NB.angularDistance(wanted.q_NB), 0.0, 1e-7);
    EXPECT_EQ(truth.accumulated_dv, AccumulatedDv::none);
  }
  const auto other = run_program("imu-truth", {"capture", folder / "good.pcap", "--csv", "-", "--stream", "8"});
  EXPECT_EQ(other.output, whole.output);

  const auto damaged = run_program("imu-truth", {"capture", folder / "bad.pcap", "--csv", folder / "out.csv"});
  EXPECT_EQ(damaged.exit_code, 3);
  EXPECT_TRUE(contains(damaged.errors, "49 truths\n")) << damaged.errors;
  EXPECT_TRUE(
      contains(damaged.errors, "1 short; the first short: a datagram has 4 bytes, and one of this format 208"))
      << damaged.errors;
  EXPECT_EQ(lines_of(read_file(folder / "out.csv")).size(), 50U);
  // From CSV to CSV: a stream, whose last row may be cut short, or lack its line feed alone.
  const auto again = run_program("imu-truth", {"capture", "file:-", "--format", "csv", "--csv", "-"}, whole.output);
  EXPECT_EQ(again.exit_code, 0) << again.errors;
  EXPECT_EQ(lines_of(again.output).size(), 51U);
  const auto cut = run_program("imu-truth", {"capture", "file:-", "--format", "csv", "--csv", "-"},
                               whole.output.substr(0, whole.output.size() - 60));
  EXPECT_EQ(cut.exit_code, 3);
  EXPECT_TRUE(contains(cut.errors, "1 cut short")) << cut.errors;
  const auto last = run_program("imu-truth", {"capture", "file:-", "--format", "csv", "--csv", "-"},
                                whole.output.substr(0, whole.output.size() - 1));
  EXPECT_EQ(last.exit_code, 0) << last.errors;
  EXPECT_EQ(last.output, again.output);

  const auto none = run_program("imu-truth", {"capture", folder / "good.pcap", "--format", "jsbsim", "--csv", "-"});
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_TRUE(contains(none.errors, "; the first columns: the header row lacks \"Time\", ")) << none.errors;
  EXPECT_TRUE(contains(none.errors, "no jsbsim truth in it")) << none.errors;
}

// The truth of a vehicle on the Earth with all that a truth can have: the CSV has it, too, by the names of
// quantities.
TEST(ImuTruth, WritesEachPartOfATruthAsCsv) {
  const ScratchFolder folder;
  const std::string head =
      "gps_week,gps_time_of_week_ms,q_EB_w,q_EB_x,q_EB_y,q_EB_z,p_rad_per_s,q_rad_per_s,r_rad_per_s,latitude_deg,"
      "longitude_deg,height_m,v_BE_E_x_m_per_s,v_BE_E_y_m_per_s,v_BE_E_z_m_per_s,specific_force_x_m_per_s2,"
      "specific_force_y_m_per_s2,specific_force_z_m_per_s2,p_dot_rad_per_s2,q_dot_rad_per_s2,r_dot_rad_per_s2,"
      "temperature_k,magnetic_field_x_ut,magnetic_field_y_ut,magnetic_field_z_ut,pressure_hpa,rotor_speed_rpm,"
      "throttle,"
      "airspeed_kn,dynamic_pressure_hpa,current_a\n";
  std::string log = head;
  for (int i = 0; i < 3; ++i)
    log += fmt::format(
        "2303,{},0.6,0.8,0,0,0.1,0.2,0.3,47.5,8.5,{},1,2,3,4,5,6,7,8,9,290,20,{},40,950,3000,0.5,90,12,"
        "{}\n",
        388'818'000 + 10 * i, 500 + i, 30 + i, 10 * i);
  capture::write_file(folder / "log.csv", log);
  const auto run = run_program("imu-truth", {"capture", folder / "log.csv", "--format", "csv", "--csv", "-"});
  ASSERT_EQ(run.exit_code, 0) << run.errors;
  EXPECT_FALSE(contains(run.errors, "warning")) << run.errors;
  EXPECT_TRUE(run.output.starts_with("gps_week,gps_time_of_week_ns,r_BN_N_x_m,")) << run.output;
  const auto is = truths_in(lines_of(run.output), "csv"), wanted = truths_in(lines_of(log), "csv");
  ASSERT_EQ(is.size(), 3U);
  ASSERT_EQ(wanted.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(is[i].time, wanted[i].time);
    EXPECT_EQ(is[i].time.ns, 10'000'000 * static_cast<std::int64_t>(i));
    EXPECT_TRUE(is[i].has_date);
    EXPECT_EQ(is[i].start_gps_ns, wanted[i].start_gps_ns);
    EXPECT_TRUE(is[i].has_earth_angle);
    EXPECT_EQ(is[i].earth_angle, 0);
    EXPECT_EQ(is[i].r_BN_N, wanted[i].r_BN_N);
    EXPECT_EQ(is[i].v_BN_N, wanted[i].v_BN_N);
    EXPECT_LT(is[i].q_NB.angularDistance(wanted[i].q_NB), 1e-7);
    EXPECT_EQ(is[i].omega_BN_B, wanted[i].omega_BN_B);
    EXPECT_EQ(is[i].omegaDot_BN_B, wanted[i].omegaDot_BN_B);
    EXPECT_EQ(is[i].specific_force_B, wanted[i].specific_force_B);
    EXPECT_EQ(is[i].temperature_c, wanted[i].temperature_c);
    EXPECT_EQ(is[i].magnetic_field_B, wanted[i].magnetic_field_B);
    EXPECT_EQ(is[i].magnetic_field_B.y(), (30 + static_cast<double>(i)) * 1e-6);
    EXPECT_EQ(is[i].pressure, wanted[i].pressure);
    for (std::size_t s = 0; s < vehicle_state_count; ++s) {
      const auto state = static_cast<VehicleState>(s);
      ASSERT_TRUE(is[i].vehicle[state].has_value()) << s;
      EXPECT_EQ(is[i].vehicle[state], wanted[i].vehicle[state]) << s;
    }
  }
  const auto again = run_program("imu-truth", {"capture", "file:-", "--format", "csv", "--csv", "-"}, run.output);
  EXPECT_EQ(again.exit_code, 0) << again.errors;
  EXPECT_EQ(lines_of(again.output).size(), 4U);
}

// A position without a velocity is a part of its own; parts that later truths have in addition are named.
TEST(ImuTruth, NamesThePartsThatTheCsvLacks) {
  const ScratchFolder folder;
  const std::string attitude = "time_s,q_NB_w,q_NB_x,q_NB_y,q_NB_z,p_rad_per_s,q_rad_per_s,r_rad_per_s";
  capture::write_file(folder / "log.csv",
                      attitude + ",r_BN_N_x_m,r_BN_N_y_m,r_BN_N_z_m\n0,1,0,0,0,0,0,0,1,2,3\n" + attitude +
                          ",r_BN_N_x_m,r_BN_N_y_m,r_BN_N_z_m,pressure_pa,throttle\n1,1,0,0,0,0,0,0,4,5,6,7,0.5\n");
  const auto run = run_program("imu-truth", {"capture", folder / "log.csv", "--format", "csv", "--csv", "-"});
  EXPECT_EQ(run.exit_code, 0) << run.errors;
  EXPECT_EQ(
      run.output,
      "time_ns,r_BN_N_x,r_BN_N_y,r_BN_N_z,sigma_BN_1,sigma_BN_2,sigma_BN_3,omega_BN_B_x,omega_BN_B_y,omega_BN_B_z\n"
      "0,1,2,3,0,0,0,0,0,0\n1000000000,4,5,6,0,0,0,0,0,0\n");
  EXPECT_TRUE(contains(run.errors, "the CSV lacks parts of the truths: pressure, throttle\n")) << run.errors;
}

TEST(ImuTruth, ASignalEndsIt) {
  for (const int signal : {SIGINT, SIGTERM}) {
    LoopbackSocket receiver;
    Program sender("imu-truth");
    sender.start({"rest", "--to", receiver.spec(), "--rate", "50"});
    ASSERT_TRUE(receiver.receive(60'000).has_value());
    ASSERT_TRUE(receiver.receive(60'000).has_value());
    EXPECT_EQ(sender.stop(signal), 0);
    EXPECT_TRUE(contains(sender.errors(), "sent  ")) << sender.errors();
  }
}

TEST(ImuTruth, WrongCommandLineIsReported) {
  const ScratchFolder folder;
  const std::string file = capture_file(folder);
  const struct {
    std::vector<std::string> arguments;
    std::string_view message;
  } cases[] = {
      {{}, "MOTION"},
      {{"dance"}, "there is no motion 'dance'\nMotions:\n  rest "},
      {{"rest", "file"}, "only 'capture' is followed by a file"},
      {{"rest", "--rate-rad-per-s", "1"}, "--rate-rad-per-s: rest has no such parameter"},
      {{"coning", "--jerk-m-per-s3", "1"}, "--jerk-m-per-s3: coning has no such parameter"},
      {{"rest", "--fast"}, "--for: must be given"},
      {{"rest", "--csv", folder / "x.csv"}, "--for: must be given"},
      {{"rest", "--csv", "/does/not/exist", "--for", "1"}, "cannot write it"},
      {{"rest", "--csv", folder / "x.csv", "--for", "1", "--to", "udp:127.0.0.1:1"}, "--to: not with --csv"},
      {{"rest", "--to", "file:x"}, " or udp:ADDR:PORT"},
      {{"rest", "--to", "udp:localhost"}, "ADDR:PORT"},
      {{"rest", "--rate", "0"}, "--rate"},
      {{"rest", "--drop", "101"}, "--drop"},
      {{"rest", "--drop", "nan"}, "--drop"},
      {{"rest", "--lockstep", "--reorder", "1"}, "--reorder: not in lockstep"},
      {{"rest", "--lockstep", "--format", "csv"}, "only native datagrams are answered"},
      {{"rest", "--resend", "3"}, "--resend: only with --lockstep"},
      {{"rest", "--format", "csv", "--stream", "3"}, "--stream: only for native datagrams"},
      {{"rest", "--format", "xml"}, "--format"},
      {{"capture"}, "capture: no file is given"},
      {{"capture", file, "--rate", "10"}, "--rate: a capture is sent as it is"},
      {{"capture", file, "--jerk-m-per-s3", "10"}, "--jerk-m-per-s3: a capture is sent as it is"},
      {{"capture", "/does/not/exist.pcap"}, "/does/not/exist.pcap"},
      {{"capture", file, "--format", "csv"}, "--format: a capture is sent as it is"},
      {{"capture", file, "--csv", "-", "--format", "xml"},
       "there is no truth format 'xml'; right would be one of ardupilot-json"},
      {{"capture", file, "--csv", "-", "--for", "1"}, "--for: with --csv a capture is converted whole"},
      {{"capture", file, "--csv", "-", "--to", "udp:127.0.0.1:1"}, "--to: not with --csv"},
      {{"capture", "x.csv", "--csv", "-"}, "x.csv: has no native truth; right would be pcap:PATH"},
      {{"capture", file, "--csv", "-", "--set", "columns=a"}, "unknown setting \"columns\""},
      {{"capture", file, "--csv", "-", "--format", "csv", "--set", "columns"}, "right would be --set KEY=VALUE"},
      {{"rest", "--set", "columns=a"}, "--set: only for the truths of a capture"},
  };
  for (const auto& [arguments, message] : cases) {
    const auto result = run_program("imu-truth", arguments);
    EXPECT_EQ(result.exit_code, 2) << message;
    EXPECT_TRUE(contains(result.errors, message)) << result.errors << "\nlacks: " << message;
  }
}

TEST(ImuTruth, HelpListAndVersion) {
  const auto list = run_program("imu-truth", {"list"});
  const auto help = run_program("imu-truth", {"--help"});
  EXPECT_EQ(list.exit_code, 0);
  EXPECT_EQ(help.exit_code, 0);
  for (const Motion& motion : motions()) {
    EXPECT_TRUE(contains(list.output, motion.summary));
    EXPECT_TRUE(contains(help.output, motion.summary));
  }
  EXPECT_TRUE(run_program("imu-truth", {"--version"}).output.starts_with("imu-truth "));
}

TEST(ImuTruth, AMotionBeyondTheRangeIsReported) {
  const auto result = run_program(
      "imu-truth", {"boost", "--acceleration-m-per-s2", "1e6", "--start", "1e8", "--for", "1", "--csv", "/dev/null"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_TRUE(contains(result.errors, "exceeds the valid range of truth")) << result.errors;
}

}  // namespace
}  // namespace imud
