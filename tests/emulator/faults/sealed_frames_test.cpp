// Faults that change the content of described frames, and write their checks: escapes, lines of text, messages with
// and without a check. wire_faults_test.cpp has the shipped descriptions.
#include <gtest/gtest.h>

#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "emulator/faults/wire_change.hpp"
#include "tests/emulator/faults/wire_bench.hpp"
#include "tests/protocols/frames/frame_unit.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

constexpr unsigned tries = 300;

// The frame of a sample, and the frame after a fault, for `tries` random bits.
class SealedFrames : public testing::Test {
 protected:
  void describe(const std::string& text) {
    settings_ = frame_settings(frames_of_text(text, "test.toml"));
    seal_ = make_seal(protocol_named("frame"), settings_);
    Sample sample;
    sample.rate = Vector3(0.1, -0.2, 0.3);
    sample.counter = 0xC0;
    Line line(protocol_named("frame"), settings_);
    right_ = concatenated(line.encode_all({&sample, 1}));
  }
  std::vector<std::byte> changed(WireFault kind, unsigned number) {
    const ActiveFault fault = WireWindow{kind, {1}}.at(10);
    WireChange change(fault, FaultNumbers(1, 2, number, 0));
    frame_->assign(right_);
    const std::span<std::byte> bytes = change.change(*frame_, *other_, seal_.get(), {}, {}, true).bytes();
    return {bytes.begin(), bytes.end()};
  }
  std::vector<std::byte> content_of(std::span<const std::byte> frame) {
    std::vector<std::byte> content(frame.size());
    content.resize(seal_->open(frame, content));
    return content;
  }
  std::vector<std::byte> frame_of(std::span<const std::byte> content) {
    std::vector<std::byte> frame(2 * content.size() + 16);
    frame.resize(seal_->close(content, frame));
    return frame;
  }
  // The measurements of a frame between right ones, less these.
  DecodeErrors decode(const std::vector<std::byte>& frame, std::size_t& measurements) const {
    Line line(protocol_named("frame"), settings_);
    Recording recording;
    for (const auto* one : {&right_, &frame, &right_}) line.decoder->feed(Frame{*one}, recording);
    line.decoder->finish(recording);
    measurements = recording.measurements.size() - 2;
    return line.decoder->errors();
  }

  Settings settings_;
  std::unique_ptr<FrameSeal> seal_;
  std::vector<std::byte> right_;
  std::unique_ptr<ChangingFrame> frame_ = std::make_unique<ChangingFrame>(),
                                 other_ = std::make_unique<ChangingFrame>();
};

TEST_F(SealedFrames, AreChangedBeforeTheEscapes) {
  for (const std::string escape : {"none", "slip", "hdlc", "dle", "cobs"}) {
    SCOPED_TRACE(escape);
    describe("frame_version = 1\nname = \"test\"\nescape = \"" + escape +
             "\"\n[[message]]\nlayout = [\"AA 55\", \"@a\", \"check:sum8:@b..@c\", \"@b\", \"7E C0 10\", "
             "\"sample_counter:u8\", \"rate_x_deg_per_s:i16*1e-2\", \"rate_y_deg_per_s:i16*1e-2\", \"@c\", "
             "\"check:crc16/xmodem:@a..@c be\"]\n");
    ASSERT_NE(seal_, nullptr);
    const std::vector<std::byte> content = content_of(right_);
    ASSERT_EQ(content.size(), 13U);
    EXPECT_EQ(frame_of(content), right_);
    std::size_t other_sizes = 0, measurements = 0;
    std::set<std::size_t> bits;
    for (unsigned number = 0; number < tries; ++number) {
      const std::vector<std::byte> wrong = changed(WireFault::content_wrong, number);
      EXPECT_EQ(decode(wrong, measurements).checksum, 0U);
      EXPECT_EQ(decode(wrong, measurements).skipped_bytes, 0U);
      EXPECT_EQ(measurements, 1U);
      other_sizes += wrong.size() != right_.size();
      // One bit of the numbers, and the checks.
      const std::vector<std::byte> inside = content_of(wrong);
      ASSERT_EQ(inside.size(), content.size());
      std::size_t differing = 0;
      for (std::size_t bit = 0; bit < 8 * 11; ++bit)
        if (((inside[bit / 8] ^ content[bit / 8]) >> bit % 8 & std::byte{1}) != std::byte{0} && bit / 8 != 2) {
          ++differing;
          bits.insert(bit);
        }
      EXPECT_EQ(differing, 1U);
      // With the checks of another content it is refused.
      std::vector<std::byte> unsealed = inside;
      unsealed[11] = content[11], unsealed[12] = content[12];
      EXPECT_EQ(decode(frame_of(unsealed), measurements).checksum, 1U);
      EXPECT_EQ(measurements, 0U);
      const std::vector<std::byte> refused = content_of(changed(WireFault::checksum_wrong, number));
      ASSERT_EQ(refused.size(), content.size());
      EXPECT_TRUE(std::equal(content.begin() + 3, content.begin() + 11, refused.begin() + 3));
      EXPECT_GT(decode(changed(WireFault::checksum_wrong, number), measurements).checksum, 0U);
      EXPECT_EQ(measurements, 0U);
      if (HasFailure()) return;
    }
    EXPECT_EQ(bits.size(), 40U) << "of the counter and the numbers";
    EXPECT_EQ(other_sizes > 0, escape == "slip" || escape == "hdlc");  // a byte became, or was, one that is escaped
  }
}

TEST_F(SealedFrames, MayBeLinesOfText) {
  describe(
      "frame_version = 1\nname = \"test\"\n[[message]]\ntext = \"$IMU,{rate_x_deg_per_s:.3f},"
      "{rate_y_deg_per_s:+08.3f},{rate_z_deg_per_s:.3f}*{check:xor8}\\r\\n\"\n");
  ASSERT_NE(seal_, nullptr);
  std::size_t measurements = 0, others = 0;
  for (unsigned number = 0; number < tries; ++number) {
    const std::vector<std::byte> wrong = changed(WireFault::content_wrong, number);
    others += wrong != right_;
    EXPECT_EQ(decode(wrong, measurements).checksum, 0U);
    EXPECT_EQ(decode(wrong, measurements).skipped_bytes, 0U);
    EXPECT_EQ(measurements, 1U);
    EXPECT_EQ(decode(changed(WireFault::checksum_wrong, number), measurements).checksum, 1U);
    EXPECT_EQ(measurements, 0U);
  }
  EXPECT_EQ(others, tries);
}

TEST_F(SealedFrames, OnlyWhereThereIsACheck) {
  const auto objection = [&](WireFault kind) {
    return wire_fault_objection(wire_fault_kinds()[static_cast<std::size_t>(kind)], protocol_named("frame"),
                                settings_);
  };
  const std::string plain = "[[message]]\nlayout = [\"AA 55\", \"rate_x_deg_per_s:f32\"]\n",
                    checked =
                        "[[message]]\nlayout = [\"AA 56\", \"@a\", \"rate_x_deg_per_s:f32\", \"check:sum8:@a..\"]\n",
                    head = "frame_version = 1\nname = \"test\"\n";
  describe(head + plain);
  EXPECT_EQ(seal_, nullptr);
  EXPECT_EQ(objection(WireFault::content_wrong),
            "the frames of frame have no checksum; bit_errors changes their content");
  EXPECT_EQ(changed(WireFault::content_wrong, 0), right_);
  describe(head + checked);
  EXPECT_EQ(objection(WireFault::content_wrong), "");
  std::size_t measurements = 0;
  for (unsigned number = 0; number < tries; ++number) {  // no number that is not finite
    EXPECT_NE(changed(WireFault::content_wrong, number), right_);
    EXPECT_EQ(decode(changed(WireFault::content_wrong, number), measurements).malformed, 0U);
  }
  describe(head + plain + checked);
  EXPECT_EQ(objection(WireFault::content_wrong), "");
  right_.resize(6);  // of the first message
  EXPECT_EQ(changed(WireFault::content_wrong, 0), right_);
}

TEST(SealedSignals, OfADbcFileHaveARightChecksum) {
  const ScratchFolder folder;
  std::ofstream(folder / "imu.dbc") << "BO_ 256 Imu: 8 imu\n SG_ Crc : 0|8@1+ (1,0) [0|0] \"\" host\n"
                                       " SG_ Counter : 8|4@1+ (1,0) [0|0] \"\" host\n"
                                       " SG_ RateX : 16|16@1- (0.01,0) [0|0] \"deg/s\" host\n";
  const std::string settings = "dbc_file=" + (folder / "imu.dbc") +
                               " signals=RateX=rate_x_deg_per_s,Counter=alive_counter"
                               " checksums=Crc=e2e_p01:0x123:both";
  const Protocol& dbc = protocol_named("dbc");
  for (const bool is_content : {true, false}) {
    WireBench plain("dbc", settings), bench("dbc", settings);
    const WireWindow window{is_content ? WireFault::content_wrong : WireFault::checksum_wrong, {1}};
    const auto right = plain.run({}, 30), faulty = bench.run({&window, 1}, 30);
    Line line(dbc, settings_of(dbc, settings));
    Recording recording;
    for (const auto& frames : faulty) line.feed(frames, recording);
    line.decoder->finish(recording);
    EXPECT_EQ(line.decoder->errors().checksum, is_content ? 0U : 10U);
    EXPECT_EQ(recording.measurements.size(), is_content ? 30U : 20U);
    for (std::size_t k = 0; k < 30; ++k) EXPECT_EQ(joined(faulty[k]) != joined(right[k]), k >= 10 && k <= 19) << k;
  }
  EXPECT_EQ(wire_fault_objection(wire_fault_kinds()[static_cast<std::size_t>(WireFault::content_wrong)], dbc,
                                 Settings(dbc.settings)),
            "the frames of dbc have no checksum");
}

}  // namespace
}  // namespace imud
