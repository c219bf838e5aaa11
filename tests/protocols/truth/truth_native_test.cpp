// The native truth datagram, both versions: a known answer, every cause, and the acknowledgement.
#include <gtest/gtest.h>

#include <bit>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "core/attitude.hpp"
#include "protocols/native_truth.hpp"
#include "protocols/truth_format.hpp"
#include "protocols/wire/crc32c.hpp"
#include "tests/support/decode_truth.hpp"

namespace imud {
namespace {

using Datagram = std::array<std::byte, native_truth_size>;
namespace flag = native_truth_flag;

template <class T>
void put(Datagram& datagram, std::size_t offset, T value) {
  const auto bytes = std::bit_cast<std::array<std::byte, sizeof(T)>>(value);
  std::ranges::copy(bytes, datagram.begin() + static_cast<std::ptrdiff_t>(offset));
}

// The checksum of version 2 is at another place.
void seal(Datagram& datagram) {
  const std::size_t at = datagram[4] == std::byte{2} ? 204 : 196;
  put(datagram, at, crc32c(std::span(datagram).first(at)));
}

Truth known_truth() {
  Truth truth;
  truth.time.ns = -5;
  truth.stream = 3;
  truth.sequence = 0xFFFFFFFF;
  truth.new_run = true;
  truth.r_BN_N = {6.7e6, -1.0, 2.0};
  truth.v_BN_N = {7.5e3, 0.1, -0.2};
  truth.q_NB = exp(Vector3(0.3, -0.4, 1.2));
  truth.omega_BN_B = {0.1, 0.2, -0.3};
  truth.has_angular_acceleration = true;
  truth.omegaDot_BN_B = {1.0, 2.0, 3.0};
  truth.has_specific_force = true;
  truth.specific_force_B = {-9.0, 0.5, 0.25};
  truth.accumulated_dv = AccumulatedDv::inertial;
  truth.accumulated_dv_B = {100.0, 200.0, 300.0};
  return truth;
}

class NativeTruth : public testing::Test {
 protected:
  NativeTruth() { encode_native_truth(known_truth(), datagram_); }

  TruthResult decode(std::span<const std::byte> bytes) { return decode_truth(*decoder_, bytes, truth_); }
  // Decodes the known datagram with `value` at `offset` and a right checksum.
  template <class T>
  TruthResult decode_with(std::size_t offset, T value) {
    changed_ = datagram_;
    put(changed_, offset, value);
    seal(changed_);
    return decode(changed_);
  }

  std::unique_ptr<TruthDecoder> decoder_ = find_truth_format("native")->make(Settings());
  Datagram datagram_;
  Datagram changed_;  // the last that decode_with() has decoded
  Truth truth_;
};

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

TEST_F(NativeTruth, ARefusalNamesWhatWasFound) {
  const auto text = [this](TruthResult result) { return remark(*decoder_, result); };
  EXPECT_EQ(text(decode(std::as_bytes(std::span("{\"time\": 1}", 11)))),
            "a datagram has 11 bytes, and one of this format 208: \"{\"time\": 1}\"");
  EXPECT_EQ(text(decode_with<std::uint32_t>(0, 0x50544854)),
            "a datagram begins with \"THTP\", and one of this format with \"IMUT\"");
  EXPECT_EQ(text(decode_with<std::uint16_t>(4, 3)), "version 3, and known are 1 and 2");
  EXPECT_EQ(text(decode_with(104, 2e5)), "omega_BN_B has 2e+05 as component 2, and the limit is 1e+05 rad/s");
  EXPECT_EQ(text(decode_with(160, nan)), "the specific force has nan as component 3, and the limit is 1e+08 m/s^2");
  EXPECT_EQ(text(decode_with(16, std::numeric_limits<std::int64_t>::max())),
            "time_ns is 9223372036854775807, and its limit is 4611686018427387904 ns");
  EXPECT_EQ(text(decode_with<std::uint16_t>(6, 12)), "the flags 4 and 8 exclude one another");
}

TEST_F(NativeTruth, BytesByHand) {
  Datagram bytes = {};
  const auto at = [&bytes](std::size_t offset, std::initializer_list<int> values) {
    for (const int value : values) bytes[offset++] = static_cast<std::byte>(value);
  };
  at(0, {'I', 'M', 'U', 'T', 1, 0, 0x37, 0, 7, 0, 0, 0, 4, 3, 2, 1});  // flags 1 2 4 16 32, stream 7
  at(16, {0x15, 0xCD, 0x5B, 0x07});                                    // 123456789 ns
  at(24 + 6, {0xF0, 0x3F});                                            // r 1, 2, -2
  at(32 + 7, {0x40});
  at(40 + 7, {0xC0});
  at(48 + 6, {0xE0, 0x3F});  // v 0.5, 0, -0.5
  at(64 + 6, {0xE0, 0xBF});
  at(88 + 6, {0xF0, 0x3F});           // sigma 0, 0, 1: half a turn about z
  at(96 + 6, {0xD0, 0x3F});           // omega x 0.25
  at(128 + 6, {0xC0, 0x3F});          // omegaDot y 0.125
  at(160 + 6, {0x20, 0xC0});          // specific force z -8
  at(168 + 6, {0x10, 0x40});          // accumulated x 4
  at(196, {0xAD, 0xAA, 0x67, 0x27});  // computed bit by bit elsewhere

  ASSERT_EQ(decode(bytes), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 123456789);
  EXPECT_EQ(truth_.stream, 7U);
  EXPECT_EQ(truth_.sequence, 0x01020304U);
  EXPECT_TRUE(truth_.acknowledge && truth_.new_run);
  EXPECT_EQ(truth_.r_BN_N, Vector3(1, 2, -2));
  EXPECT_EQ(truth_.v_BN_N, Vector3(0.5, 0, -0.5));
  EXPECT_LE((truth_.q_NB * Vector3(1, 2, 3) - Vector3(-1, -2, 3)).norm(), 1e-15);
  EXPECT_EQ(truth_.omega_BN_B, Vector3(0.25, 0, 0));
  EXPECT_TRUE(truth_.has_angular_acceleration && truth_.has_specific_force);
  EXPECT_EQ(truth_.omegaDot_BN_B, Vector3(0, 0.125, 0));
  EXPECT_EQ(truth_.specific_force_B, Vector3(0, 0, -8));
  EXPECT_EQ(truth_.accumulated_dv, AccumulatedDv::inertial);
  EXPECT_EQ(truth_.accumulated_dv_B, Vector3(4, 0, 0));

  Datagram encoded;
  EXPECT_EQ(encode_native_truth(truth_, encoded), native_truth_size);
  EXPECT_EQ(encoded, bytes);
}

TEST_F(NativeTruth, WhatIsEncodedComesBack) {
  for (const AccumulatedDv kind : {AccumulatedDv::none, AccumulatedDv::inertial, AccumulatedDv::body_sum}) {
    Truth sent = known_truth();
    sent.accumulated_dv = kind;
    encode_native_truth(sent, datagram_);
    ASSERT_EQ(decode(datagram_), TruthResult::ok);
    EXPECT_EQ(truth_.time, sent.time);
    EXPECT_EQ(truth_.stream, sent.stream);
    EXPECT_EQ(truth_.sequence, sent.sequence);
    EXPECT_EQ(truth_.acknowledge, sent.acknowledge);
    EXPECT_EQ(truth_.new_run, sent.new_run);
    EXPECT_EQ(truth_.r_BN_N, sent.r_BN_N);
    EXPECT_EQ(truth_.v_BN_N, sent.v_BN_N);
    EXPECT_LE((truth_.q_NB.coeffs() - sent.q_NB.coeffs()).norm(), 4e-16);
    EXPECT_EQ(truth_.omega_BN_B, sent.omega_BN_B);
    EXPECT_EQ(truth_.omegaDot_BN_B, sent.omegaDot_BN_B);
    EXPECT_EQ(truth_.specific_force_B, sent.specific_force_B);
    EXPECT_EQ(truth_.accumulated_dv, kind);
    EXPECT_EQ(truth_.accumulated_dv_B,
              kind == AccumulatedDv::none ? Vector3(Vector3::Zero()) : sent.accumulated_dv_B);
  }
}

TEST_F(NativeTruth, SigmaOfAnyNorm) {
  for (const double norm : {0.0, 1e-300, 1e-9, 0.5, 1.0, 1.5, 1e9, 1e150}) {
    const Vector3 sigma(norm, 0, 0);
    put(datagram_, 72, sigma.x());
    put(datagram_, 80, 0.0);
    put(datagram_, 88, 0.0);
    seal(datagram_);
    ASSERT_EQ(decode(datagram_), TruthResult::ok) << norm;
    EXPECT_NEAR(std::abs(truth_.q_NB.dot(exp(rotation_vector_from_mrp(sigma)))), 1.0, 1e-15) << norm;
  }
}

TEST_F(NativeTruth, EveryCauseInItsOrder) {
  EXPECT_EQ(decode({}), TruthResult::too_short);
  EXPECT_EQ(decode(std::span(datagram_).first(207)), TruthResult::too_short);
  std::vector<std::byte> longer(datagram_.begin(), datagram_.end());
  longer.push_back({});
  EXPECT_EQ(decode(longer), TruthResult::too_long);

  Datagram wrong = datagram_;
  put(wrong, 72, nan);
  EXPECT_EQ(decode(wrong), TruthResult::bad_checksum);
  put(wrong, 4, std::uint16_t{3});
  EXPECT_EQ(decode(wrong), TruthResult::bad_version);
  put(wrong, 0, 'i');
  EXPECT_EQ(decode(wrong), TruthResult::not_this_kind);

  EXPECT_EQ(decode_with(24, 1.0), TruthResult::ok);
  for (std::size_t offset = 24; offset < 192; offset += 8) {
    EXPECT_EQ(decode_with(offset, nan), TruthResult::not_finite) << offset;
    EXPECT_EQ(decode_with(offset, -infinity), TruthResult::not_finite) << offset;
    EXPECT_EQ(decode_with(offset, 1e200), TruthResult::out_of_range) << offset;  // |sigma|^2 overflows
  }
  EXPECT_EQ(decode_with(16, std::numeric_limits<std::int64_t>::max()), TruthResult::out_of_range);
  EXPECT_EQ(decode_with(6, std::uint16_t{flag::accumulated_dv_inertial | flag::accumulated_dv_body_sum}),
            TruthResult::out_of_range);
}

TEST_F(NativeTruth, FieldsNotGivenOrReservedAreIgnored) {
  put(datagram_, 6, std::uint16_t{0xFFC0});  // flags of a later version, none of version 1
  for (std::size_t offset = 120; offset < 192; offset += 8) put(datagram_, offset, nan);
  put(datagram_, 192, 1U);
  seal(datagram_);
  put(datagram_, 200, std::uint64_t{5});
  ASSERT_EQ(decode(datagram_), TruthResult::ok);
  EXPECT_FALSE(truth_.has_angular_acceleration || truth_.has_specific_force || truth_.acknowledge || truth_.new_run);
  EXPECT_EQ(truth_.accumulated_dv, AccumulatedDv::none);
  EXPECT_TRUE(truth_.omegaDot_BN_B.isZero() && truth_.specific_force_B.isZero() && truth_.accumulated_dv_B.isZero());
}

TEST_F(NativeTruth, EveryOneBitErrorIsRefused) {
  for (std::size_t bit = 0; bit < 8 * 200; ++bit) {
    datagram_[bit / 8] ^= static_cast<std::byte>(1U << bit % 8);
    EXPECT_NE(decode(datagram_), TruthResult::ok) << bit;
    datagram_[bit / 8] ^= static_cast<std::byte>(1U << bit % 8);
  }
  EXPECT_EQ(decode(datagram_), TruthResult::ok);
}

TEST_F(NativeTruth, AStampByHand) {
  Truth truth = known_truth();
  truth.stamp = {SharedClock::monotonic, {0x0102030405060708}};
  Datagram stamped;
  encode_native_truth(truth, stamped);
  constexpr int by_hand[] = {8, 7, 6, 5, 4, 3, 2, 1, 3, 0, 0, 0};
  for (std::size_t i = 0; i < std::size(by_hand); ++i)
    EXPECT_EQ(stamped[192 + i], static_cast<std::byte>(by_hand[i]));
  EXPECT_EQ(stamped[4], std::byte{2});
  // All else is as in version 1.
  EXPECT_TRUE(std::equal(stamped.begin() + 6, stamped.begin() + 192, datagram_.begin() + 6));
  ASSERT_EQ(decode(stamped), TruthResult::ok);
  EXPECT_EQ(truth_.stamp.clock, SharedClock::monotonic);
  EXPECT_EQ(truth_.stamp.time, truth.stamp.time);
  EXPECT_EQ(truth_.r_BN_N, truth.r_BN_N);
  for (std::size_t bit = 0; bit < 8 * stamped.size(); ++bit) {
    stamped[bit / 8] ^= static_cast<std::byte>(1U << bit % 8);
    EXPECT_NE(decode(stamped), TruthResult::ok) << bit;
    stamped[bit / 8] ^= static_cast<std::byte>(1U << bit % 8);
  }
  ASSERT_EQ(decode(datagram_), TruthResult::ok);
  EXPECT_EQ(truth_.stamp.clock, SharedClock::none) << "version 1 has none";
}

TEST_F(NativeTruth, AnImpossibleStampIsRefused) {
  Truth truth = known_truth();
  truth.stamp = {SharedClock::tai, {1}};
  encode_native_truth(truth, datagram_);
  EXPECT_EQ(decode_with<std::uint32_t>(200, 0), TruthResult::ok);
  EXPECT_EQ(truth_.stamp.clock, SharedClock::none);
  EXPECT_EQ(decode_with<std::uint32_t>(200, 4), TruthResult::out_of_range);
  EXPECT_EQ(remark(*decoder_, TruthResult::out_of_range),
            "the stamp is 1 ns of clock 4, and the clocks are 1 (TAI), 2 (UTC) and 3 (monotonic), with times below "
            "4611686018427387904 ns");
  for (const std::int64_t ns : {std::int64_t{1} << 62, std::numeric_limits<std::int64_t>::min()})
    EXPECT_EQ(decode_with(192, ns), TruthResult::out_of_range);
}

TEST_F(NativeTruth, AcknowledgementByHand) {
  Truth truth;
  truth.stream = 0x04030201;
  truth.sequence = 0x08070605;
  const auto frames = std::make_unique<FrameBuffer>();
  decoder_->acknowledge(truth, {-2}, 0x0102030405060708, *frames);
  ASSERT_EQ(frames->frames().size(), 1U);
  const std::span<const std::byte> bytes = frames->frames()[0].bytes;
  constexpr int by_hand[] = {'I',  'M',  'U',  'A',  1,    0,    0,    0,    1, 2, 3, 4, 5, 6, 7, 8,
                             0xFE, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 8, 7, 6, 5, 4, 3, 2, 1};
  std::vector<std::byte> wanted;
  for (const int value : by_hand) wanted.push_back(static_cast<std::byte>(value));
  EXPECT_EQ(std::vector<std::byte>(bytes.begin(), bytes.end()), wanted);

  NativeAcknowledgement acknowledgement;
  ASSERT_TRUE(decode_native_acknowledgement(bytes, acknowledgement));
  EXPECT_EQ(acknowledgement.stream, truth.stream);
  EXPECT_EQ(acknowledgement.sequence, truth.sequence);
  EXPECT_EQ(acknowledgement.time.ns, -2);
  EXPECT_EQ(acknowledgement.samples, 0x0102030405060708U);

  EXPECT_FALSE(decode_native_acknowledgement(bytes.first(31), acknowledgement));
  for (const std::size_t wrong : {0U, 3U, 4U, 5U}) {
    std::vector<std::byte> changed = wanted;
    changed[wrong] ^= std::byte{0x40};
    EXPECT_FALSE(decode_native_acknowledgement(changed, acknowledgement)) << wrong;
  }
}

}  // namespace
}  // namespace imud
