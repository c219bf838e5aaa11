// The messages of NASA's 42, as it sent them.
#include <gtest/gtest.h>

#include "core/attitude.hpp"
#include "tests/support/decode_truth.hpp"

namespace imud {
namespace {

// Two messages in a row that 42 (commit 11e3cc3) sent: a body that tumbles in low Earth orbit, 100 Hz.
constexpr std::string_view first_message = R"(TIME 2024-099-00:00:00.010000000
SC[0].qn = [2.970526270362e-01 7.070136353085e-02 2.835959440317e-01 9.090293694345e-01]
SC[0].wn = [5.229893840176e-02 6.985883291837e-02 8.725428101030e-02]
SC[0].PosR = [4.449538945529e-11 1.482495001622e-10 -2.164001621991e-10]
SC[0].VelR = [0.000000000000e+00 0.000000000000e+00 0.000000000000e+00]
SC[0].svb = [9.546559144872e-01 -1.796247996942e-01 2.374173883047e-01]
SC[0].bvb = [-1.393924515754e-05 2.058146647108e-05 1.270593603425e-05]
SC[0].Hvb = [5.229893840176e+00 1.397176658367e+01 2.617628430309e+01]
SC[0].B[0].wn = [5.229893840176e-02 6.985883291837e-02 8.725428101030e-02]
SC[0].B[0].qn = [2.970526270362e-01 7.070136353085e-02 2.835959440317e-01 9.090293694345e-01]
SC[0].Gyro[0].TrueRate = 5.235987755983e-02
SC[0].Gyro[1].TrueRate = 6.981317007977e-02
SC[0].Gyro[2].TrueRate = 8.726646259972e-02
Orb[0].PosN = [6.369346610832e+06 1.427309044472e+06 1.826872268026e+06]
Orb[0].VelN = [-2.622881207464e+03 4.436489360001e+03 5.678447432646e+03]
[ENDMSG]
)";
constexpr std::string_view second_message = R"(TIME 2024-099-00:00:00.020000000
SC[0].qn = [2.972218903622e-01 7.096350142428e-02 2.840777612566e-01 9.088031442037e-01]
SC[0].wn = [5.223796793463e-02 6.990443620206e-02 8.724210565979e-02]
[ENDMSG]
)";

class Truth42 : public testing::Test {
 protected:
  // Returns the results that are not no_state.
  std::vector<TruthResult> feed(std::string_view text, TruthInput input = TruthInput::stream) {
    text_ = text;
    decoder_->feed(std::as_bytes(std::span(text_)), input, HostTime{5});
    std::vector<TruthResult> all;
    Truth truth;
    while (const auto result = decoder_->next(truth))
      if (result != TruthResult::no_state) {
        all.push_back(*result);
        remark_ = remark(*decoder_, *result);
        if (result == TruthResult::ok) truths_.push_back(truth);
      }
    return all;
  }
  // Returns true if an acknowledgement is due, and is sent.
  bool sends_ack() {
    const auto out = std::make_unique<FrameBuffer>();
    if (!decoder_->deadline()) return false;
    decoder_->poll(*decoder_->deadline(), *out);
    EXPECT_EQ(out->frames().size(), 1U);
    return !decoder_->deadline();
  }

  using Results = std::vector<TruthResult>;
  std::unique_ptr<TruthDecoder> decoder_ = [] {
    const TruthFormat& format = *find_truth_format("42");
    return format.make(Settings(format.settings));
  }();
  std::vector<Truth> truths_;
  std::string text_, remark_;
};

TEST_F(Truth42, AMessageIsATruth) {
  ASSERT_EQ(feed(std::string(first_message) + std::string(second_message)), Results(2, TruthResult::ok));
  const Truth &one = truths_[0], &two = truths_[1];
  EXPECT_EQ(one.time.ns, 0) << "counted from the first message";
  EXPECT_EQ(two.time.ns, 10'000'000);
  EXPECT_EQ(one.stream, 0U);
  EXPECT_EQ(one.omega_BN_B, Vector3(5.229893840176e-02, 6.985883291837e-02, 8.725428101030e-02));
  EXPECT_TRUE(one.has_position && one.has_velocity && one.has_specific_force && one.has_magnetic_field);
  EXPECT_LE((one.r_BN_N - Vector3(6.369346610832e+06, 1.427309044472e+06, 1.826872268026e+06)).norm(), 1e-8);
  EXPECT_EQ(one.v_BN_N, Vector3(-2.622881207464e+03, 4.436489360001e+03, 5.678447432646e+03));
  EXPECT_EQ(one.specific_force_B, Vector3(0, 0, 0));
  EXPECT_EQ(one.magnetic_field_B, Vector3(-1.393924515754e-05, 2.058146647108e-05, 1.270593603425e-05));
  EXPECT_FALSE(two.has_position || two.has_magnetic_field);
  // The sense of the quaternion: the rotation between the messages is that of the mean rate.
  const Vector3 turned = log(one.q_NB.conjugate() * two.q_NB) / 0.01;
  EXPECT_LE((turned - 0.5 * (one.omega_BN_B + two.omega_BN_B)).norm(), 1e-8);
}

TEST_F(Truth42, OnAStreamEachMessageIsAcknowledgedOnce) {
  ASSERT_EQ(feed(first_message), Results{TruthResult::ok});
  EXPECT_TRUE(truths_[0].acknowledge);
  EXPECT_FALSE(decoder_->deadline());
  const auto out = std::make_unique<FrameBuffer>();
  decoder_->acknowledge(truths_[0], {}, 0, *out);
  ASSERT_EQ(out->frames().size(), 1U);
  const auto bytes = out->frames()[0].bytes;
  EXPECT_EQ(std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()), std::string("Ack\0", 4));
  // 42 waits after a message without truth, too.
  EXPECT_EQ(feed("TIME 2024-099-00:00:00.03\n[ENDMSG]\n"), Results{TruthResult::too_short});
  EXPECT_TRUE(sends_ack());
  EXPECT_EQ(feed("TIME 2024-099-00:00:00.03\nSC[0].qn = [1 2 3]\n[ENDMSG]\n"), Results{TruthResult::bad_number});
  EXPECT_TRUE(sends_ack());
  EXPECT_EQ(feed(first_message, TruthInput::datagram), Results{TruthResult::ok});
  EXPECT_FALSE(truths_.back().acknowledge);
  EXPECT_EQ(feed("[ENDMSG]", TruthInput::datagram), Results{TruthResult::too_short});
  EXPECT_FALSE(decoder_->deadline());
}

TEST_F(Truth42, VehiclesAreStreams) {
  const std::string attitude = ".qn = [0 0 0 1]\n", rate = ".wn = [0 0 0.1]\n";
  std::string text = "TIME 2024-099-00:00:00.0\n";
  for (const char* vehicle : {"SC[0]", "SC[2]", "SC[15]", "SC[16]"}) {
    text.append(vehicle).append(attitude);
    text.append(vehicle).append(rate);
    text.append(vehicle).append(".PosR = [1 0 0]\n");
  }
  text += "SC[1]" + attitude + "SC[2].Accel[0].TrueAcc = 1e-3\nSC[2].Accel[1].TrueAcc = 2e-3\n";
  text += "SC[2].Accel[2].TrueAcc = 3e-3\nOrb[0].PosN = [7e6 0 0]\nOrb[2].PosN = [8e6 0 0]\n[ENDMSG]\n";
  ASSERT_EQ(feed(text), Results(3, TruthResult::ok));
  EXPECT_EQ(truths_[0].stream, 0U);
  EXPECT_EQ(truths_[1].stream, 2U);
  EXPECT_EQ(truths_[2].stream, 15U);
  EXPECT_EQ(truths_[0].r_BN_N.x(), 7e6 + 1);
  EXPECT_EQ(truths_[1].r_BN_N.x(), 8e6 + 1);
  EXPECT_FALSE(truths_[2].has_position) << "it is not known which orbit is its own";
  EXPECT_EQ(truths_[1].specific_force_B, Vector3(1e-3, 2e-3, 3e-3));
}

TEST_F(Truth42, EveryCauseAndItsRemark) {
  EXPECT_EQ(feed("hello\n"), Results{TruthResult::not_this_kind});
  EXPECT_EQ(remark_, "no line of 42: \"hello\"");
  EXPECT_EQ(feed("TIME 2024-99-00:00:00\n"), Results{TruthResult::bad_number});
  EXPECT_EQ(feed("SC[0].wn = [1 2 x]\n"), Results{TruthResult::bad_number});
  EXPECT_EQ(remark_, "a line whose numbers are none, too many or too few: \"SC[0].wn = [1 2 x]\"");
  EXPECT_EQ(feed("SC[0].wn = [1 2 3 4]\nSC[0].wn = 1 2 3\nSC[0].wn =\n"), Results(3, TruthResult::bad_number));
  const std::string time = "TIME 2024-099-00:00:00\n", end = "SC[0].wn = [0 0 0]\n[ENDMSG]\n";
  EXPECT_EQ(feed(time + "SC[0].qn = [1 0 0 1]\n" + end), Results{TruthResult::out_of_range});
  EXPECT_TRUE(remark_.starts_with("vehicle 0 has a number")) << remark_;
  EXPECT_EQ(feed(time + "SC[0].qn = [0 0 nan 1]\n" + end), Results{TruthResult::not_finite});
  EXPECT_EQ(feed(time + end), Results{TruthResult::too_short});
  EXPECT_EQ(feed(std::string(first_message.substr(0, 400))), Results{});
  decoder_->finish();
  EXPECT_EQ(decoder_->losses().cut_short, 1U);
  EXPECT_EQ(feed(first_message.substr(first_message.find("[ENDMSG]"))), Results{TruthResult::too_short});
}

// A damaged name looks like a line that is not used: the message is refused once, and acknowledged.
TEST_F(Truth42, AMessageThatLacksALineOfTheOneBeforeIsRefused) {
  for (const std::string line : {"SC[0].PosR", "SC[0].VelR", "SC[0].bvb", "Orb[0].PosN", "Orb[0].VelN"}) {
    std::string damaged(first_message), later(first_message);
    damaged[damaged.find(line) + line.size() - 1] = '#';
    EXPECT_EQ(feed(first_message), Results{TruthResult::ok});
    EXPECT_EQ(feed(damaged), Results{TruthResult::too_short}) << line;
    EXPECT_EQ(remark_, "a message lacks " + line + ", which the one before had");
    EXPECT_TRUE(sends_ack());
    EXPECT_EQ(feed(damaged), Results{TruthResult::ok}) << "the simulator sends it no more";
    EXPECT_EQ(feed(first_message), Results{TruthResult::ok});
    decoder_->finish();
    EXPECT_EQ(feed(damaged), Results{TruthResult::ok}) << "of another connection";
  }
  EXPECT_EQ(feed(first_message), Results{TruthResult::ok});
  EXPECT_EQ(feed(second_message), Results{TruthResult::ok}) << "of other lines";
}

// A message without [ENDMSG] is refused when the next begins, and counted when the stream ends, on a whole line, too.
TEST_F(Truth42, AMessageThatStopsShortIsNamed) {
  const std::string_view without_end = first_message.substr(0, first_message.find("[ENDMSG]"));
  EXPECT_EQ(feed(std::string(without_end) + std::string(second_message)),
            (Results{TruthResult::too_short, TruthResult::ok}));
  EXPECT_EQ(feed(second_message), Results{TruthResult::ok});
  EXPECT_EQ(feed(std::string(without_end) + "TIME 2024-099-00:00:00.04\n"), Results{TruthResult::too_short});
  EXPECT_EQ(remark_,
            "a message ended after 15 lines without [ENDMSG]; the next began with \"TIME 2024-099-00:00:00.04\"");
  EXPECT_EQ(feed("[ENDMSG]\n"), Results{TruthResult::too_short}) << "without any vehicle";
  decoder_->finish();
  EXPECT_EQ(decoder_->losses().cut_short, 0U);
  EXPECT_EQ(feed(without_end), Results{});
  decoder_->finish();
  EXPECT_EQ(decoder_->losses().cut_short, 1U);
  EXPECT_EQ(decoder_->losses().cut_short_lines, 15U);
  EXPECT_EQ(decoder_->losses().cut_short_by, 0U);
  EXPECT_EQ(feed("TIME 2024-099-00:00:00.05\nSC[0].qn"), Results{});
  decoder_->finish();
  EXPECT_EQ(decoder_->losses().cut_short, 2U);
  EXPECT_EQ(decoder_->losses().cut_short_lines, 1U);
  EXPECT_EQ(decoder_->losses().cut_short_by, 8U);
  // The end of a file needs no line feed.
  EXPECT_EQ(feed(second_message.substr(0, second_message.size() - 1)), Results{});
  decoder_->end_of_file();
  EXPECT_EQ(feed(""), Results{TruthResult::ok});
  decoder_->finish();
  EXPECT_EQ(decoder_->losses().cut_short, 2U);
  EXPECT_EQ(decoder_->losses().last_lines, 1U);
}

}  // namespace
}  // namespace imud
