// Streams of the products that are C++, described: the same bytes. The environment variable IMUD_LIKE_SAMPLES sets
// the number of samples.
#include "tests/protocols/frames/frame_like_devices.hpp"

#include <cstdlib>

namespace imud {
namespace {

TEST(FrameLikeDevices, SendTheSameBytes) {
  const char* wanted = std::getenv("IMUD_LIKE_SAMPLES");
  const long samples = wanted != nullptr ? std::atol(wanted) : 10'000;
  const auto frames = std::make_unique<FrameBuffer>();
  std::vector<std::byte> bytes;
  std::size_t products = 0;
  for (const FrameLikeDevice& like : frame_like_devices()) {
    ++products;
    SCOPED_TRACE(like.product);
    const Protocol& protocol = protocol_named(like.product);
    Line device(protocol, settings_of(protocol, like.settings)), described = frame_line(like.description);
    FrameMotion motion(like.rate_hz);
    for (long k = 0; k < samples; ++k) {
      const Sample sample = motion.next();
      frames->clear();
      for (auto due = device.device->deadline(); due && *due <= sample.time; due = device.device->deadline())
        device.device->poll(*due, *frames);
      device.device->sample(sample, *frames);
      bytes.clear();
      for (const Frame& frame : frames->frames()) bytes.insert(bytes.end(), frame.bytes.begin(), frame.bytes.end());
      ASSERT_FALSE(bytes.empty());
      ASSERT_EQ(bytes_of(described, sample), bytes) << "sample " << k;
    }
  }
  EXPECT_EQ(products, 3U);
}

}  // namespace
}  // namespace imud
