// TruthIntake on a port filled by the test: datagrams and streams, sequence numbers, and a format that sends.
#include "emulator/truth/truth_intake.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <deque>
#include <vector>

#include "protocols/native_truth.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

using Taken = TruthIntake::Outcome;
using Outcomes = std::vector<Taken>;

class ScriptedPort final : public Port {
 public:
  void send(std::span<const Frame> frames) noexcept override {
    for (const Frame& frame : frames)
      sent.emplace_back(reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size());
  }
  std::optional<Received> receive() noexcept override {
    if (waiting.empty()) return std::nullopt;
    newest_ = waiting.front();
    waiting.pop_front();
    return Received{{std::as_bytes(std::span(newest_))}, now, from};
  }
  bool at_end() const noexcept override { return ends && waiting.empty(); }
  std::optional<HostTime> next_flush() const noexcept override { return held_back_until; }
  void flush() noexcept override { ++flushes; }

  std::string_view other_content() const noexcept override { return content; }
  void drop_foreign(const Endpoint& sender) noexcept {
    ++counters_.foreign;
    counters_.foreign_from = sender;
  }

  void connect() noexcept { state_ = PortState::ready; }
  void disconnect() noexcept {
    state_ = PortState::lost;
    ++counters_.lost_count;
  }

  std::deque<std::string> waiting;
  HostTime now;
  Endpoint from;
  bool ends = false;
  std::optional<HostTime> held_back_until;
  int flushes = 0;
  std::vector<std::string> sent;
  std::string content;

 private:
  std::string newest_;
};

// A format that sends a greeting first, a message every second, and an answer to each truth. A truth is 'T' and the
// time, 8 bytes.
class TalkerDecoder final : public TruthDecoder {
 public:
  static constexpr Nanoseconds period = std::chrono::seconds(1);

  void start(HostTime now) noexcept override {
    greeted_ = false;
    deadline_ = now;
  }
  void feed(std::span<const std::byte> bytes, TruthInput input, HostTime) noexcept override {
    rest_ = bytes;
    input_ = input;
  }
  std::optional<TruthResult> next(Truth& truth) noexcept override {
    for (; !rest_.empty(); rest_ = rest_.subspan(1)) {
      held_[size_++] = rest_[0];
      if (held_[0] != std::byte{'T'}) return skip(TruthResult::not_this_kind);
      if (size_ < held_.size()) continue;
      truth = {};
      std::memcpy(&truth.time.ns, held_.data() + 1, 8);
      truth.acknowledge = true;
      return skip(TruthResult::ok);
    }
    if (input_ == TruthInput::stream || size_ == 0) return std::nullopt;
    size_ = 0;
    return TruthResult::too_short;
  }
  void finish() noexcept override {
    if (size_ == 0) return;
    ++losses_.cut_short;
    losses_.cut_short_by = std::exchange(size_, 0);
  }
  std::optional<HostTime> deadline() const noexcept override { return deadline_; }
  void poll(HostTime now, FrameBuffer& out) noexcept override {
    push(std::exchange(greeted_, true) ? "beat" : "hello", out);
    deadline_ = now + period;
  }
  void acknowledge(const Truth& truth, TruthTime, std::uint64_t, FrameBuffer& out) noexcept override {
    push("answer " + std::to_string(truth.time.ns), out);
  }

 private:
  TruthResult skip(TruthResult result) noexcept {
    rest_ = rest_.subspan(1);
    size_ = 0;
    return result;
  }
  static void push(std::string_view text, FrameBuffer& out) noexcept {
    std::memcpy(out.room(text.size()).data(), text.data(), text.size());
    out.push(text.size());
  }

  std::span<const std::byte> rest_;
  TruthInput input_ = TruthInput::stream;
  std::array<std::byte, 9> held_;
  std::size_t size_ = 0;
  bool greeted_ = false;
  std::optional<HostTime> deadline_;
};

constexpr TruthFormat talker = {
    .name = "talker",
    .summary = "a format that speaks",
    .document = "this file",
    .delimits_itself = true,
    .acknowledges = true,
    .settings = {},
    .make = [](const Settings&) -> std::unique_ptr<TruthDecoder> { return std::make_unique<TalkerDecoder>(); },
};

std::string talk(std::int64_t time_ns) {
  std::string text(9, 'T');
  std::memcpy(text.data() + 1, &time_ns, 8);
  return text;
}

class TruthIntakeTest : public testing::Test {
 protected:
  void make(const TruthFormat& format, const std::string& port,
            const std::optional<PoseFit::Options>& fit = std::nullopt, const TruthBounds& bounds = {}) {
    auto scripted = std::make_unique<ScriptedPort>();
    port_ = scripted.get();
    TruthConfig config;
    config.port = port;
    config.format = &format;
    config.settings = Settings(format.settings);
    config.fit = fit;
    config.bounds = bounds;
    config.limits.gap_begins_run = port.starts_with("file:");
    intake_ = std::make_unique<TruthIntake>(config, timeline_, std::move(scripted));
  }

  // Reads all input, and answers each truth that requests it.
  Outcomes take_all() {
    Outcomes outcomes;
    while (true) {
      const Taken outcome = intake_->take();
      if (intake_->answer_due()) intake_->answer(timeline_.newest(), 0);
      if (outcome == Taken::nothing) return outcomes;
      outcomes.push_back(outcome);
    }
  }
  Outcomes receive(const std::string& bytes) {
    port_->waiting.push_back(bytes);
    return take_all();
  }
  std::uint64_t refused(Refusal refusal) const {
    return intake_->counters().refused[static_cast<std::size_t>(refusal)];
  }
  const TruthRemarks& remarks() const { return intake_->counters().remarks; }
  std::string_view first_refusal(Refusal refusal) const {
    return intake_->counters().refused.first[static_cast<std::size_t>(refusal)].text();
  }
  Outcomes receive_from(const std::string& sender, const std::string& bytes) {
    port_->from = Endpoint::parse(sender);
    return receive(bytes);
  }
  std::vector<std::string> sent() { return std::exchange(port_->sent, {}); }

  Timeline timeline_;
  ScriptedPort* port_ = nullptr;
  std::unique_ptr<TruthIntake> intake_;
};

constexpr std::string_view header =
    "time_ns,sigma_BN_1,sigma_BN_2,sigma_BN_3,omega_BN_B_x,omega_BN_B_y,omega_BN_B_z\n";

std::string row(int ms) { return std::to_string(ms) + "000000,0,0,0,0,0,0\n"; }

TEST_F(TruthIntakeTest, ADatagramMayHoldSeveralRecords) {
  make(*find_truth_format("csv"), "udp:127.0.0.1:9810");
  EXPECT_EQ(receive(std::string(header) + row(1) + row(2)),
            (Outcomes{Taken::ignored, Taken::new_run, Taken::accepted}));
  EXPECT_EQ(receive(row(3) + "4,0\n" + "5000000,0,0,0,0,0,0"),
            (Outcomes{Taken::accepted, Taken::ignored, Taken::accepted}));
  EXPECT_EQ(receive(""), Outcomes{Taken::ignored});
  EXPECT_EQ(timeline_.newest().ns, 5'000'000);
  EXPECT_EQ(intake_->counters().received, 7U);
  EXPECT_EQ(intake_->counters().no_state, 2U);
  EXPECT_EQ(intake_->counters().accepted, 4U);
  EXPECT_EQ(refused(Refusal::too_short), 1U);
}

TEST_F(TruthIntakeTest, AStreamsLastLineCountsWhenItsLineFeedIsThere) {
  make(*find_truth_format("csv"), "file:some.csv");
  const std::string text = std::string(header) + row(1) + row(2) + "3000000,0";
  for (const char c : text) port_->waiting.emplace_back(1, c);
  EXPECT_EQ(take_all(), (Outcomes{Taken::ignored, Taken::new_run, Taken::accepted}));
  EXPECT_FALSE(intake_->at_end());
  EXPECT_EQ(intake_->end_warning(), "");
  EXPECT_EQ(receive(",0,0,0,0,0\n4"), Outcomes{Taken::accepted});
  EXPECT_EQ(intake_->counters().truncated, 0U);
  port_->ends = true;
  EXPECT_EQ(take_all(), Outcomes());
  EXPECT_TRUE(intake_->at_end());
  EXPECT_EQ(intake_->end_warning(), "cut short: 1 bytes after the last whole line");
  EXPECT_EQ(intake_->counters().truncated, 1U);
  EXPECT_EQ(intake_->counters().received, 4U);
}

TEST_F(TruthIntakeTest, AFilesLastLineIsWholeIfItHasItsColumns) {
  make(*find_truth_format("csv"), "file:some.csv");
  port_->waiting = {std::string(header) + row(1) + "2000000,0,0,0,0,0,0"};
  port_->ends = true;
  EXPECT_EQ(take_all(), (Outcomes{Taken::ignored, Taken::new_run, Taken::accepted}));
  EXPECT_TRUE(intake_->at_end());
  EXPECT_EQ(intake_->end_warning(), "");
  EXPECT_EQ(intake_->counters().truncated, 0U);
  EXPECT_TRUE(contains(remarks().last_line.text(), "has no line feed")) << remarks().last_line.text();
}

TEST_F(TruthIntakeTest, ALineThatIsTooLongIsRemarkedWithTheLimit) {
  make(*find_truth_format("csv"), "file:some.csv");
  port_->waiting = {std::string(header) + row(1) + std::string(70'000, '1') + "\n" + row(2)};
  port_->ends = true;
  EXPECT_EQ(take_all(), (Outcomes{Taken::ignored, Taken::new_run, Taken::accepted}));
  EXPECT_EQ(intake_->counters().truncated, 1U);
  EXPECT_TRUE(contains(remarks().long_line.text(), "longer than 65536 bytes")) << remarks().long_line.text();
}

TEST_F(TruthIntakeTest, NumbersThatNoVehicleHasAreRemarkedOnce) {
  make(*find_truth_format("csv"), "udp:127.0.0.1:9810", std::nullopt, {.rate = 10, .acceleration = 100});
  receive(std::string(header) + row(1) + "2000000,0,0,0,40,0,0\n3000000,0,0,0,50,0,0\n4000000,0.1,0,0,0,0,0\n");
  EXPECT_EQ(intake_->counters().accepted, 4U) << "a remark is no refusal";
  const auto text = [&](BoundsWatch::Kind kind) { return remarks().excess[static_cast<std::size_t>(kind)].text(); };
  EXPECT_TRUE(text(BoundsWatch::Kind::rate)
                  .starts_with("its rate is 40 rad/s at 2000000 ns, beyond 10 by "
                               "truth.max_rad_per_s"))
      << text(BoundsWatch::Kind::rate);
  EXPECT_TRUE(text(BoundsWatch::Kind::turn).starts_with("its attitude turns from truth to truth at "))
      << text(BoundsWatch::Kind::turn);
  EXPECT_TRUE(text(BoundsWatch::Kind::force).empty());
}

// A capture has nobody at its other end.
TEST_F(TruthIntakeTest, ALineThatIsTooLongIsCountedAsCutShort) {
  make(*find_truth_format("csv"), "file:truth.csv");
  port_->waiting = {std::string(100'000, 'x'), "\n"};
  port_->ends = true;
  while (!intake_->at_end()) intake_->take();
  EXPECT_EQ(intake_->counters().truncated, 1U);
}

TEST_F(TruthIntakeTest, NothingIsSentToACapture) {
  make(talker, "file:some.capture");
  EXPECT_FALSE(intake_->deadline());
  intake_->poll({5});
  EXPECT_EQ(receive(talk(7)), Outcomes{Taken::new_run});
  EXPECT_EQ(sent(), std::vector<std::string>{});
}

TEST_F(TruthIntakeTest, TwoSendersInTurnAreNamed) {
  make(*find_truth_format("csv"), "udp:127.0.0.1:9810");
  receive_from("10.0.0.1:5000", std::string(header));
  int ms = 0;
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(remarks().senders.text(), "") << i;
    receive_from("10.0.0.1:5001", row(++ms));
    receive_from("10.0.0.1:5000", row(++ms));
  }
  EXPECT_EQ(intake_->counters().sender_changes, 4U);  // the first change may be a restart
  EXPECT_EQ(
      remarks().senders.text(),
      "two senders send in turn, 10.0.0.1:5001 and 10.0.0.1:5000; truth.from = \"10.0.0.1:5001\" admits only one");
  // Three senders on three machines.
  make(*find_truth_format("csv"), "udp:127.0.0.1:9810");
  receive_from("10.0.0.1:5000", std::string(header));
  for (int i = 0; i < 9; ++i) receive_from("10.0.0." + std::to_string(1 + i % 3) + ":5000", row(++ms));
  EXPECT_EQ(remarks().senders.text(),
            "two senders send in turn, 10.0.0.3:5000 and 10.0.0.2:5000; truth.from = \"10.0.0.3\" admits only one");
}

TEST_F(TruthIntakeTest, ASimulatorThatStartsAgainIsOneSender) {
  make(*find_truth_format("csv"), "udp:127.0.0.1:9810");
  receive_from("10.0.0.1:5000", std::string(header));
  int ms = 0;
  for (int port = 5000; port < 5020; ++port) {
    const std::string sender = "10.0.0.1:" + std::to_string(port);
    for (int i = 0; i < 10; ++i) receive_from(sender, row(++ms));
  }
  EXPECT_EQ(intake_->counters().sender_changes, 0U);
  // The system has given an old port again after a while.
  port_->now = port_->now + std::chrono::seconds(11);
  for (int i = 0; i < 10; ++i) receive_from("10.0.0.1:5018", row(++ms));
  EXPECT_EQ(intake_->counters().sender_changes, 0U);
  EXPECT_FALSE(remarks().senders.is_set());
}

// Two vehicles may send to one port: truth.stream selects one of them.
TEST_F(TruthIntakeTest, TheSenderOfAnotherVehicleIsNoSecondSender) {
  make(*find_truth_format("native"), "udp:127.0.0.1:9810");
  for (std::uint32_t i = 0; i < 20; ++i) {
    Truth truth;
    truth.time.ns = 1'000'000 * i;
    truth.stream = i % 2;
    std::string datagram(native_truth_size, '\0');
    encode_native_truth(truth, std::span<std::byte, native_truth_size>(std::as_writable_bytes(std::span(datagram))));
    receive_from("10.0.0.1:" + std::to_string(5000 + truth.stream), datagram);
  }
  EXPECT_EQ(refused(Refusal::other_stream), 10U);
  EXPECT_EQ(intake_->counters().sender_changes, 0U);
}

TEST_F(TruthIntakeTest, ForeignDatagramsAreRefusals) {
  make(*find_truth_format("csv"), "udp:127.0.0.1:9810");
  for (int i = 0; i < 3; ++i) {
    port_->drop_foreign(Endpoint::parse("[::1]:6000"));
    EXPECT_EQ(take_all(), Outcomes());
  }
  port_->drop_foreign(Endpoint::parse("10.0.0.2:6000"));
  EXPECT_EQ(receive(std::string(header) + row(1)), (Outcomes{Taken::ignored, Taken::new_run}));
  EXPECT_EQ(refused(Refusal::foreign_sender), 4U);
  EXPECT_EQ(intake_->counters().received, 6U);
  EXPECT_EQ(first_refusal(Refusal::foreign_sender), "from [::1]:6000");
}

TEST_F(TruthIntakeTest, TimesInAnotherUnitAreNamed) {
  const auto remark_on = [this](const std::vector<std::string>& times) {
    make(*find_truth_format("csv"), "file:truth.csv");
    receive(std::string(header));
    for (const std::string& time : times) receive(time + ",0,0,0,0,0,0\n");
    return std::string(remarks().time_unit.text());
  };
  EXPECT_EQ(remark_on({"0.00", "0.25", "0.5", "0.75", "1.00", "1.5", "2", "2.25", "2.5"}),
            "time rises by 1 ns from truth to truth: is it in seconds instead of ns?");
  EXPECT_EQ(remark_on({"100", "110", "120", "130"}),
            "time rises by 10 ns from truth to truth: is it in milliseconds or seconds instead of ns?");
  EXPECT_EQ(remark_on({"0", "10000", "20000", "30000"}),
            "time rises by 10000 ns from truth to truth: is it in microseconds instead of ns?");
  EXPECT_EQ(remark_on({"0", "1", "2"}), "");
  EXPECT_EQ(remark_on({"0", "25000", "25001", "25002", "25003"}), "");  // the second step is a first truth's
  EXPECT_EQ(remark_on({"7", "7", "7", "7", "7", "7"}), "");             // a simulator that is paused
}

TEST_F(TruthIntakeTest, TruthWithoutAnyForceIsNamed) {
  make(*find_truth_format("csv"), "file:truth.csv");
  receive(std::string(header) + row(1));
  EXPECT_EQ(remarks().no_force.text(),
            "has neither specific force nor accumulated velocity: accelerometers measure 0; supply the columns "
            "specific_force_x_m_per_s2 to _z_m_per_s2, or beside Basilisk's names nonConservativeAccelpntB_B_x to _z "
            "or TotalAccumDV_BN_B_x to _z");
  timeline_ = Timeline();
  make(*find_truth_format("csv"), "file:truth.csv");
  receive(
      "time_s,yaw_deg,pitch_deg,roll_deg,p_deg_per_s,q_deg_per_s,r_deg_per_s,specific_force_x_m_per_s2,"
      "specific_force_y_m_per_s2,specific_force_z_m_per_s2\n0,0,0,0,0,0,0,0,0,0\n");
  EXPECT_EQ(intake_->counters().accepted, 1U);
  EXPECT_FALSE(remarks().no_force.is_set());
  for (const std::string name : {"nonConservativeAccelpntB_B", "TotalAccumDV_BN_B"}) {
    timeline_ = Timeline();
    make(*find_truth_format("csv"), "file:truth.csv");
    receive("time_ns,sigma_BN_1,sigma_BN_2,sigma_BN_3,omega_BN_B_x,omega_BN_B_y,omega_BN_B_z," + name + "_x," + name +
            "_y," + name + "_z\n0,0,0,0,0,0,0,0,0,0\n");
    EXPECT_EQ(intake_->counters().accepted, 1U);
    EXPECT_FALSE(remarks().no_force.is_set());
  }
  for (const TruthFormat* format : truth_formats()) EXPECT_FALSE(format->force_from.empty()) << format->name;
}

TEST_F(TruthIntakeTest, ColumnsThatAreNotUsedAreNamedOnce) {
  make(*find_truth_format("csv"), "udp:127.0.0.1:9810");
  receive("# a comment\n\n");
  EXPECT_FALSE(remarks().columns.is_set());
  receive("accel_x," + std::string(header));
  receive("accel_y," + std::string(header));
  EXPECT_EQ(remarks().columns.text(), "columns that are not used: \"accel_x\"");
}

TEST_F(TruthIntakeTest, TheFirstRefusalOfACauseIsDescribed) {
  make(*find_truth_format("csv"), "udp:127.0.0.1:9810");
  receive(std::string(header) + "0,0,0,0,3e5,0,0\n0,0,0,0,0,4e5,0\n5,0\n");
  receive(row(2) + row(2) + row(1));
  EXPECT_EQ(first_refusal(Refusal::out_of_range),
            "the column \"omega_BN_B_x\" has \"3e5\", and its limit is 1e+05 rad/s");
  EXPECT_EQ(first_refusal(Refusal::too_short), "a row has 2 fields, and there are 7 columns: \"5,0\"");
  EXPECT_EQ(first_refusal(Refusal::duplicate), "its time is 2000000 ns, and that of the newest 2000000 ns");
  EXPECT_EQ(first_refusal(Refusal::bad_number), "");
}

TEST_F(TruthIntakeTest, TheContentOfACaptureWithoutTruthIsNamed) {
  make(*find_truth_format("native"), "pcap:flight.pcap?port=9811");
  port_->ends = true;
  port_->content = "300 datagrams to port 9810 and none to 9811";
  EXPECT_EQ(take_all(), Outcomes());
  EXPECT_EQ(remarks().content.text(), "the capture has 300 datagrams to port 9810 and none to 9811");
}

TEST_F(TruthIntakeTest, GapsOfTheSequenceAreLossesUnlessItJumps) {
  make(*find_truth_format("native"), "udp:127.0.0.1:9810");
  constexpr std::uint32_t begin = 0xFFFF'FFFE;
  const auto send = [&](std::int64_t ms, std::uint32_t sequence, TruthTime watermark = Timeline::never) {
    Truth truth;
    truth.time.ns = 1'000'000 * ms;
    truth.sequence = sequence;
    std::string datagram(native_truth_size, '\0');
    encode_native_truth(truth, std::span<std::byte, native_truth_size>(std::as_writable_bytes(std::span(datagram))));
    port_->waiting.push_back(datagram);
    const Taken outcome = intake_->take(watermark);
    return std::pair<Taken, std::uint64_t>(outcome, intake_->counters().lost);
  };
  using Seen = std::pair<Taken, std::uint64_t>;
  EXPECT_EQ(send(1, begin), Seen(Taken::new_run, 0));
  EXPECT_EQ(send(2, begin + 1), Seen(Taken::accepted, 0));
  EXPECT_EQ(send(6, begin + 5), Seen(Taken::accepted, 3));  // the number wraps in between
  EXPECT_EQ(send(5, begin + 4, TruthTime{0}), Seen(Taken::inserted, 2));
  EXPECT_EQ(send(7, begin + 6), Seen(Taken::accepted, 2));
  EXPECT_EQ(send(8, begin + 6 + 99'999), Seen(Taken::accepted, 2 + 99'998));
  EXPECT_EQ(send(9, begin + 6 + 99'999 + 100'000),
            Seen(Taken::accepted, 100'000));  // the sender counts from elsewhere
  EXPECT_EQ(send(10, 3), Seen(Taken::accepted, 100'000));
  EXPECT_EQ(send(11, 5), Seen(Taken::accepted, 100'001));
  EXPECT_EQ(send(12, 5), Seen(Taken::accepted, 100'001));  // a sender that does not count
}

TEST_F(TruthIntakeTest, AFormatMaySendFirstAndEachSecond) {
  make(talker, "udp:127.0.0.1:9810");
  EXPECT_EQ(intake_->deadline(), HostTime{});
  EXPECT_EQ(sent(), std::vector<std::string>{});
  const HostTime begin{77};
  intake_->poll(begin);
  EXPECT_EQ(sent(), std::vector<std::string>{"hello"});
  EXPECT_EQ(intake_->deadline(), begin + TalkerDecoder::period);
  intake_->poll(begin + TalkerDecoder::period - Nanoseconds{1});
  EXPECT_EQ(sent(), std::vector<std::string>{});
  for (int second = 1; second <= 3; ++second) {
    ASSERT_EQ(intake_->deadline(), begin + second * TalkerDecoder::period);
    intake_->poll(*intake_->deadline());
    EXPECT_EQ(sent(), std::vector<std::string>{"beat"});
  }
}

TEST_F(TruthIntakeTest, WhatThePortHoldsBackIsFlushedInTime) {
  make(*find_truth_format("native"), "udp:127.0.0.1:9810");
  intake_->poll({5});
  EXPECT_FALSE(intake_->deadline());
  EXPECT_EQ(port_->flushes, 1);
  port_->held_back_until = HostTime{9};
  EXPECT_EQ(intake_->deadline(), HostTime{9});
  make(talker, "udp:127.0.0.1:9810");
  intake_->poll({5});
  port_->held_back_until = HostTime{9};
  EXPECT_EQ(intake_->deadline(), HostTime{9});
  port_->held_back_until = HostTime{9} + TalkerDecoder::period;
  EXPECT_EQ(intake_->deadline(), HostTime{5} + TalkerDecoder::period);
}

TEST_F(TruthIntakeTest, EachOfTwoTruthsInADatagramIsAnswered) {
  make(talker, "udp:127.0.0.1:9810");
  EXPECT_EQ(receive(talk(1) + talk(2)), (Outcomes{Taken::new_run, Taken::accepted}));
  EXPECT_EQ(sent(), (std::vector<std::string>{"answer 1", "answer 2"}));
  EXPECT_EQ(receive(talk(3) + "Tx"), (Outcomes{Taken::accepted, Taken::ignored}));
  EXPECT_EQ(receive(talk(4)),
            Outcomes{Taken::accepted});  // an incomplete record of a datagram does not continue in the next one
  EXPECT_EQ(sent(), (std::vector<std::string>{"answer 3", "answer 4"}));
  EXPECT_EQ(intake_->counters().received, 5U);
  EXPECT_EQ(refused(Refusal::too_short), 1U);
}

TEST_F(TruthIntakeTest, AConversationOverAStreamInPiecesOfOneByte) {
  make(talker, "serial:/dev/ttyUSB0");
  intake_->poll({5});
  for (const char c : talk(1) + talk(2) + "?" + talk(3)) port_->waiting.emplace_back(1, c);
  EXPECT_EQ(take_all(), (Outcomes{Taken::new_run, Taken::accepted, Taken::ignored, Taken::accepted}));
  EXPECT_EQ(sent(), (std::vector<std::string>{"hello", "answer 1", "answer 2", "answer 3"}));
  EXPECT_EQ(intake_->counters().received, 4U);
  EXPECT_EQ(refused(Refusal::not_this_kind), 1U);
}

// No whole record is lost, and the next simulator that connects is greeted.
TEST_F(TruthIntakeTest, ASimulatorDisconnectsWithinARecordAndComesBack) {
  make(talker, "serial:/dev/ttyUSB0");
  port_->disconnect();
  EXPECT_EQ(take_all(), Outcomes());
  EXPECT_FALSE(intake_->deadline());
  intake_->poll({1});
  EXPECT_EQ(sent(), std::vector<std::string>{});
  port_->connect();
  EXPECT_EQ(intake_->deadline(), HostTime{});
  intake_->poll({2});
  EXPECT_EQ(receive(talk(1) + talk(2).substr(0, 5)), Outcomes{Taken::new_run});
  port_->disconnect();
  EXPECT_EQ(take_all(), Outcomes());
  EXPECT_EQ(intake_->counters().truncated, 1U);
  EXPECT_FALSE(intake_->deadline());
  port_->connect();
  EXPECT_EQ(intake_->deadline(), HostTime{});
  intake_->poll({3});
  EXPECT_EQ(receive(talk(3)), Outcomes{Taken::accepted});
  EXPECT_EQ(sent(), (std::vector<std::string>{"hello", "answer 1", "hello", "answer 3"}));
  EXPECT_EQ(intake_->counters().received, 2U);
}

// A turn at 0.5 rad/s and an acceleration of 2 m/s^2 upwards, as poses at 100 Hz.
std::string pose_row(std::int64_t i) {
  const double t = 0.01 * static_cast<double>(i);
  return fmt::format("{},0,0,{},0,0,0,0,0,{}\n", i * 10'000'000, std::tan(0.125 * t), -t * t);
}
constexpr std::string_view pose_header =
    "time_ns,sigma_BN_1,sigma_BN_2,sigma_BN_3,omega_BN_B_x,omega_BN_B_y,omega_BN_B_z,r_BN_N_x,r_BN_N_y,r_BN_N_z\n";
constexpr PoseFit::Options derive_both{
    .rate = PoseFit::Source::derived,
    .specific_force = PoseFit::Source::derived,
    .gravitation = {.kind = GravitationModel::Kind::constant, .constant = 9.80665}};

TEST_F(TruthIntakeTest, DerivesFromPosesAfterTheDelay) {
  make(*find_truth_format("csv"), "file:truth.csv", derive_both);
  port_->waiting.push_back(std::string(pose_header));
  for (int i = 0; i <= 100; ++i) port_->waiting.push_back(pose_row(i));
  take_all();
  EXPECT_EQ(timeline_.newest(), TruthTime{970'000'000});
  EXPECT_EQ(intake_->counters().accepted, 98U);
  EXPECT_EQ(intake_->counters().runs, 1U);
  const MotionState state = timeline_.at(TruthTime{500'000'000});
  EXPECT_LT((state.omega_BN_B - Vector3(0, 0, 0.5)).norm(), 1e-10);
  EXPECT_LT((state.specific_force_B - Vector3(0, 0, -11.80665)).norm(), 1e-9);
  EXPECT_EQ(state.derived, status::rate_derived | status::force_derived);
  port_->ends = true;
  take_all();
  EXPECT_TRUE(intake_->at_end());
  EXPECT_EQ(timeline_.newest(), TruthTime{1'000'000'000}) << "the end is not waited for";
  EXPECT_EQ(intake_->counters().accepted, 101U);
  EXPECT_FALSE(remarks().no_force.is_set() || remarks().far_from_earth.is_set());
}

TEST_F(TruthIntakeTest, APoseFarFromItsNeighboursIsRefused) {
  make(*find_truth_format("csv"), "file:truth.csv", derive_both);
  port_->waiting.push_back(std::string(pose_header));
  for (int i = 0; i <= 300; ++i) {
    std::string row = pose_row(i);
    if (i == 150) row = row.substr(0, row.rfind(',')) + ",-2.2\n";  // 5 cm higher
    port_->waiting.push_back(row);
  }
  port_->ends = true;
  take_all();
  EXPECT_EQ(refused(Refusal::outlier), 1U);
  EXPECT_EQ(intake_->counters().accepted, 300U);
  EXPECT_TRUE(contains(first_refusal(Refusal::outlier), "the pose at 1500000000 ns is 0.05 m"))
      << first_refusal(Refusal::outlier);
  const FitFigures& fit = intake_->counters().fit;
  EXPECT_TRUE(fit.known);
  EXPECT_NEAR(fit.rate_mean, 0.03, 1e-9);
  EXPECT_LT(fit.place_noise, 1e-6);
  EXPECT_FALSE(remarks().noisy_poses.is_set());
}

TEST_F(TruthIntakeTest, WhatIsDerivedIsInOrderAndInItsRun) {
  timeline_ = Timeline({.gap_begins_run = true});
  make(*find_truth_format("csv"), "file:truth.csv", derive_both);
  port_->waiting.push_back(std::string(pose_header));
  for (int i = 0; i <= 100; ++i) port_->waiting.push_back(pose_row(i));
  port_->waiting.push_back(pose_row(100));                                        // a duplicate
  for (int i = 0; i < 2000; ++i) port_->waiting.push_back(pose_row(10'000 + i));  // a gap of 99 s
  port_->ends = true;
  take_all();
  EXPECT_EQ(refused(Refusal::duplicate), 1U);
  EXPECT_EQ(intake_->counters().accepted, 2101U);
  EXPECT_EQ(intake_->counters().runs, 2U);
  EXPECT_EQ(intake_->counters().gaps, 1U);
  EXPECT_EQ(timeline_.run_start(), TruthTime{100'000'000'000});
}

TEST_F(TruthIntakeTest, ADisconnectedSimulatorIsNotWaitedFor) {
  make(*find_truth_format("csv"), "pipe:truth", derive_both);
  port_->connect();
  port_->waiting.push_back(std::string(pose_header));
  for (int i = 0; i <= 20; ++i) port_->waiting.push_back(pose_row(i));
  take_all();
  EXPECT_EQ(intake_->counters().accepted, 18U);
  port_->disconnect();
  take_all();
  EXPECT_EQ(timeline_.newest(), TruthTime{200'000'000});
  port_->connect();
  port_->waiting.push_back(std::string(pose_header));
  for (int i = 0; i <= 200; ++i) port_->waiting.push_back(pose_row(i));  // from the beginning
  take_all();
  EXPECT_EQ(intake_->counters().runs, 2U);
  EXPECT_GT(timeline_.newest(), TruthTime{1'900'000'000});
}

TEST_F(TruthIntakeTest, GravitationNeedsTheEarth) {
  PoseFit::Options fit = derive_both;
  fit.gravitation = {.kind = GravitationModel::Kind::wgs84};
  make(*find_truth_format("csv"), "file:truth.csv", fit);
  port_->waiting.push_back(std::string(pose_header));
  for (int i = 0; i <= 20; ++i) port_->waiting.push_back(pose_row(i));
  take_all();
  EXPECT_TRUE(contains(remarks().far_from_earth.text(), "give truth.gravity_m_per_s2"))
      << remarks().far_from_earth.text();
}

TEST_F(TruthIntakeTest, PositionsWithoutForceNameTheRemedy) {
  make(*find_truth_format("csv"), "file:truth.csv");
  receive(std::string(pose_header) + pose_row(0));
  EXPECT_TRUE(contains(remarks().no_force.text(), "or give truth.specific_force = \"derived\""));
}

}  // namespace
}  // namespace imud
