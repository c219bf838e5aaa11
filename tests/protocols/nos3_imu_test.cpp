// NOS3's generic_imu: requests and replies.
#include <gtest/gtest.h>

#include <string>

#include "core/units.hpp"
#include "tests/protocols/can_text.hpp"
#include "tests/protocols/recording.hpp"

namespace imud {
namespace {

class Nos3Imu : public testing::Test {
 protected:
  std::string ask(const std::string& request) {
    std::string replies;
    each_frame(request, [&](const Frame& frame) {
      frames_->clear();
      device_->receive(frame, {}, *frames_);
      for (const Frame& reply : frames_->frames()) replies += (replies.empty() ? "" : " ") + can_text(reply);
    });
    return replies;
  }
  void take(double acceleration_g, double rate_deg_per_s) {
    Sample sample;
    sample.specific_force = units::standard_gravity * Vector3(acceleration_g, -acceleration_g, 0);
    sample.rate = units::degree * Vector3(rate_deg_per_s, -rate_deg_per_s, 0);
    frames_->clear();
    device_->sample(sample, *frames_);
    EXPECT_TRUE(frames_->frames().empty()) << "nothing may precede a reply";
  }

  const Protocol& protocol_ = protocol_named("nos3-imu");
  std::unique_ptr<FrameBuffer> frames_ = std::make_unique<FrameBuffer>();
  std::unique_ptr<Device> device_ = protocol_.make(settings_of(protocol_, ""));
};

// 1 g and 10 deg/s, by the formulas of generic_imu_device.c.
TEST_F(Nos3Imu, ARequestIsAnsweredWithTheNewestSample) {
  take(1, 10);
  EXPECT_EQ(ask("00F#8002"), "000#8CCCCCC483333302");
  EXPECT_EQ(ask("00F#8003"), "000#7333332C7CCCCC9E");
  EXPECT_EQ(ask("00F#8004"), "000#7FFFFFF87FFFFFD0");
  take(0, 0);
  EXPECT_EQ(ask("00F#8002"), "000#7FFFFFF87FFFFFD0");
  take(1e9, 1e9);
  EXPECT_EQ(ask("00F#8002"), "000#FFFFFFFFFFFFFFFF");
  EXPECT_EQ(ask("00F#8003"), "000#0000000000000000");
}

TEST_F(Nos3Imu, HousekeepingCountsTheCommandsBefore) {
  EXPECT_EQ(ask("00F#8001"), "000#0000000000000000");
  EXPECT_EQ(ask("00F#8000"), "");
  EXPECT_EQ(ask("00F#8002 00F#8001").substr(21), "000#0000000300000000");
  EXPECT_EQ(ask("00F#80FF"), "");
  EXPECT_EQ(ask("00F#8001"), "000#0000000400000000") << "an unknown command counts as none";
  device_->power_on({});
  EXPECT_EQ(ask("00F#8001"), "000#0000000000000000");
}

TEST_F(Nos3Imu, OtherFramesAreNotAnswered) {
  EXPECT_EQ(ask("00F#80 00F#800200 00F#0002 00F#"), "");
  EXPECT_EQ(device_->counts()[0], 4U);
  EXPECT_EQ(ask("00F#8005 00F#80FF"), "");
  EXPECT_EQ(device_->counts()[0], 6U);
  EXPECT_EQ(ask("00F#R 0000000F#8002 00F##08002 00E#8002"), "");
  EXPECT_EQ(device_->counts()[0], 6U) << "these are not for the unit";
}

TEST_F(Nos3Imu, IdentifiersAreSettings) {
  device_ = protocol_.make(settings_of(protocol_, "request_id=0x123 reply_id=0x00F"));
  EXPECT_EQ(ask("00F#8004"), "");
  EXPECT_EQ(ask("123#8004"), "00F#7FFFFFF87FFFFFD0");
  const std::vector<CanFilter> filters = protocol_.can_filters(settings_of(protocol_, "request_id=0x123"));
  ASSERT_EQ(filters.size(), 1U);
  EXPECT_EQ(filters[0].id, 0x123U);
}

TEST_F(Nos3Imu, ARecordingIsDecodedByItsRequests) {
  const auto decoder = protocol_.make_decoder(settings_of(protocol_, ""));
  Recording got;
  const auto feed = [&](std::string_view text) {
    each_frame(text, [&](const Frame& frame) { decoder->feed(frame, got); });
  };
  const std::string x = "00F#8002 000#8CCCCCC483333302 ", y = "00F#8003 000#7333332C7CCCCC9E ",
                    z = "00F#8004 000#7FFFFFF87FFFFFD0 ", hk = "00F#8001 000#0000000300000000 ";
  feed(hk + x + y + hk + z);
  ASSERT_EQ(got.measurements.size(), 1U);
  EXPECT_TRUE(got.measurements[0].sample.rate.isApprox(units::degree * Vector3(10, -10, 0), 1e-12));
  EXPECT_TRUE(got.measurements[0].sample.specific_force.isApprox(units::standard_gravity * Vector3(1, -1, 0), 1e-12));
  feed(x + z + y + x + y + "00F#8004 000#00");
  EXPECT_EQ(got.measurements.size(), 1U);
  EXPECT_EQ(decoder->errors().malformed, 1U);
  EXPECT_EQ(decoder->errors().incomplete, 2U);
}

}  // namespace
}  // namespace imud
