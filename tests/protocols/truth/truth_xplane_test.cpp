// X-Plane: requests and answers by RREF, and DATA rows, in bytes of X-Plane itself and of client programs.
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "core/units.hpp"
#include "protocols/truth_format.hpp"
#include "tests/support/decode_truth.hpp"
#include "tests/support/hex_bytes.hpp"

namespace imud {
namespace {

// A request that X-Plane 12.1.1 answered, without its last 371 zeros, and the answer: g_axil is -0.03246
// (X-Plane 12.1.1; xdevsoft/advancexplanedatarefs at 8f3a286, README.md).
constexpr std::string_view xplane_request =
    "5252454600010000000100000073696d2f666c696768746d6f64656c2f666f726365732f675f6178696c";
constexpr std::string_view xplane_one_answer = "525245462c010000007eef04bd";
// An answer to all requests by build_rref_reply() of phil-chaplin/avidynebridge at 8803d534, bridge.py, which stands
// in for X-Plane: 12.5, 47.5, 8.5, 400, 90, 0, 0, .125, -.25, .5, 50, 2, -30, .125, -.25, 1.
constexpr std::string_view xplane_answer =
    "525245462c00000000000048410100000000003e420200000000000841030000000000c843040000000000b442050000"
    "00000000000600000000000000070000000000003e08000000000080be090000000000003f0a000000000048420b0000"
    "00000000400c0000000000f0c10d0000000000003e0e000000000080be0f0000000000803f";
// Rows by sendDATA() of nasa/XPlaneConnect at 11a5f35, C/src/xplaneConnect.c: 1: 99, 12.5; 4: 0, 0, 0, 0, 1, -.125,
// -.25; 16: -.25, .125, .5 rad/s as of X-Plane 11; 17: 0, 0, 90, 85; 20: 47.5, 8.5, 1250; 21: 1, 2, 3, 50, 2, -30;
// all others 0.
constexpr std::string_view xplane_11_rows =
    "4441544100010000000000c6420000484100000000000000000000000000000000000000000000000004000000000000"
    "000000000000000000000000000000803f000000be000080be0000000010000000000080be0000003e0000003f000000"
    "00000000000000000000000000000000001100000000000000000000000000b4420000aa420000000000000000000000"
    "00000000001400000000003e420000084100409c44000000000000000000000000000000000000000015000000000080"
    "3f000000400000404000004842000000400000f0c10000000000000000";
// The same of X-Plane 12, but 16: 7.1619725, -14.323945, 28.64789 deg/s.
constexpr std::string_view xplane_12_rows =
    "4441544100010000000000c6420000484100000000000000000000000000000000000000000000000004000000000000"
    "000000000000000000000000000000803f000000be000080be0000000010000000e12ee540e12e65c1e12ee541000000"
    "00000000000000000000000000000000001100000000000000000000000000b4420000aa420000000000000000000000"
    "00000000001400000000003e420000084100409c44000000000000000000000000000000000000000015000000000080"
    "3f000000400000404000004842000000400000f0c10000000000000000";

class XplaneTruth : public testing::Test {
 protected:
  void make(std::string_view source, std::string_view time = "field", std::int64_t version = 12) {
    Settings settings(find_truth_format("xplane")->settings);
    settings.set_text("source", source);
    settings.set("version", version);
    settings.set_text("time", time);
    decoder_ = find_truth_format("xplane")->make(settings);
  }
  TruthResult decode(std::span<const std::byte> bytes) { return decode_truth(*decoder_, bytes, truth_); }
  // East at 50 m/s, descending, north 30 m/s: x is east, y south.
  void expect_state(double rate_bound) const {
    EXPECT_EQ(truth_.time.ns, 12'500'000'000);
    EXPECT_EQ(truth_.specific_force_B, units::standard_gravity * Vector3(-0.125, -0.25, -1));
    EXPECT_LE((truth_.omega_BN_B - Vector3(0.125, -0.25, 0.5)).norm(), rate_bound);
    const Vector3 turning = Vector3(0, 0, units::earth_rate).cross(truth_.r_BN_N);
    const Vector3 v_B = truth_.q_NB.conjugate() * (truth_.v_BN_N - turning);
    EXPECT_LE((v_B - Vector3(50, -30, -2)).norm(), 1e-5);
  }

  std::unique_ptr<TruthDecoder> decoder_;
  Truth truth_;
};

TEST_F(XplaneTruth, RequestsEachDatarefAgainAndAgain) {
  make("rref");
  EXPECT_EQ(decoder_->deadline(), std::nullopt);  // of a capture, to which nothing can be sent
  decoder_->start({5});
  ASSERT_EQ(decoder_->deadline(), HostTime{5});
  const auto sent = std::make_unique<FrameBuffer>();
  decoder_->poll({6}, *sent);
  ASSERT_EQ(sent->frames().size(), 16U);
  constexpr std::size_t g_axil = 13;
  std::vector<std::byte> wanted = hex_bytes(xplane_request);
  wanted.resize(413);
  wanted[5] = std::byte{100};  // times per second
  wanted[9] = std::byte{g_axil};
  const std::span<const std::byte> frame = sent->frames()[g_axil].bytes;
  EXPECT_EQ(std::vector<std::byte>(frame.begin(), frame.end()), wanted);
  EXPECT_EQ(decoder_->deadline(), HostTime{2'000'000'006});
  sent->clear();
  decoder_->poll({2'000'000'006}, *sent);
  EXPECT_EQ(sent->frames().size(), 16U);
  make("data");
  decoder_->start({5});
  EXPECT_EQ(decoder_->deadline(), std::nullopt);
}

TEST_F(XplaneTruth, AnswersInOneDatagramOrInSeveral) {
  make("rref");
  const std::vector<std::byte> answer = hex_bytes(xplane_answer);
  ASSERT_EQ(decode(answer), TruthResult::ok);
  expect_state(1e-4);
  std::vector<std::byte> rest(answer.begin(), answer.begin() + 5);
  rest.insert(rest.end(), answer.begin() + 5 + 8 * 8, answer.end());
  EXPECT_EQ(decode(std::span(answer).first(5 + 8 * 8)), TruthResult::no_state);
  EXPECT_EQ(decode(hex_bytes("524546")), TruthResult::not_this_kind);
  ASSERT_EQ(decode(rest), TruthResult::ok);
  expect_state(1e-4);

  EXPECT_EQ(decode(hex_bytes(xplane_11_rows)), TruthResult::no_state);  // not asked for
  EXPECT_EQ(decode(std::span(answer).first(12)), TruthResult::too_short);
  EXPECT_EQ(decode(std::span(answer).first(5)), TruthResult::too_short);
  std::vector<std::byte> nan = answer;
  nan[5 + 4 + 3] = std::byte{0x7F};
  nan[5 + 4 + 2] = std::byte{0xC0};
  EXPECT_EQ(decode(nan), TruthResult::not_finite);
  EXPECT_EQ(remark(*decoder_, TruthResult::not_finite), "time, f32 at byte 0, is nan");
  make("rref", "arrival");
  ASSERT_EQ(decode(nan), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 0);
}

// X-Plane 10 has another fifth byte: charlylima/XPlaneUDP at 065edcb, XPlaneUdp.py.
TEST_F(XplaneTruth, AnAnswerOfXplaneItselfAndOfVersion10) {
  make("rref");
  std::vector<std::byte> one = hex_bytes(xplane_one_answer);
  one[5] = std::byte{13};  // as the index was requested
  EXPECT_EQ(decode(one), TruthResult::no_state);
  std::vector<std::byte> rest = hex_bytes(xplane_answer);
  rest.erase(rest.begin() + 5 + 13 * 8, rest.begin() + 5 + 14 * 8);
  rest[4] = std::byte{'O'};
  ASSERT_EQ(decode(rest), TruthResult::ok);
  EXPECT_NEAR(truth_.specific_force_B.x(), 0.0324549600481987 * units::standard_gravity, 1e-15);
}

TEST_F(XplaneTruth, RowsOfTheDataOutput) {
  make("data", "field", 11);
  ASSERT_EQ(decode(hex_bytes(xplane_11_rows)), TruthResult::ok);
  expect_state(1e-4);
  make("data");
  std::vector<std::byte> data = hex_bytes(xplane_12_rows);
  ASSERT_EQ(decode(data), TruthResult::ok);
  expect_state(1e-4);
  data[4] = std::byte{'*'};  // as X-Plane 11 sends it (PrzemyslawHausman/X-Plane-UDP-..., README.md at 039faef)
  EXPECT_EQ(decode(data), TruthResult::ok);
  EXPECT_EQ(decode(std::span(data).first(5 + 36 * 5)), TruthResult::too_short);
  EXPECT_EQ(remark(*decoder_, TruthResult::too_short),
            "rows of the Data Output are missing; select 1, 4, 16, 17, 20 and 21 for the network");
}

}  // namespace
}  // namespace imud
