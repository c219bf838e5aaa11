// The dilutions of precision that products report: of a receiver with an almanac, and constants.
#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/frame.hpp"
#include "core/sample.hpp"
#include "protocols/protocol.hpp"

namespace imud {
namespace {

constexpr Dilution known = {2.5F, 2.25F, 1.25F, 1.875F, 1.0625F, 0.75F, 1.0F};

// Returns what a product sends in a second, of a receiver with these dilutions.
std::string sent_with(const Dilution& dilution, const char* protocol, const std::vector<std::string>& keys,
                      const std::vector<std::string>& values) {
  const Protocol& product = *find_protocol(protocol);
  Settings settings(product.settings);
  for (std::size_t i = 0; i < keys.size(); ++i) settings.set_text(keys[i], values[i]);
  const std::unique_ptr<Device> device = product.make(settings);
  const double rate_hz = product.product(settings).rate_hz;
  std::string all;
  const auto frames = std::make_unique<FrameBuffer>();
  for (std::uint64_t k = 0; k <= static_cast<std::uint64_t>(rate_hz); ++k) {
    Sample sample;
    sample.counter = k;
    sample.time = DeviceTime{static_cast<std::int64_t>(1e9 * static_cast<double>(k) / rate_hz)};
    sample.navigation.is_known = true;
    sample.navigation.gps_ns = 1'450'000'000'000'000'000 + sample.time.ns;
    sample.navigation.r_E = {6378137, 0, 0};
    sample.navigation.dilution = dilution;
    frames->clear();
    device->sample(sample, *frames);
    for (const Frame& frame : frames->frames())
      all.append(reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size());
  }
  return all;
}

std::string floats(const std::vector<float>& values, bool is_big_endian) {
  std::string bytes;
  for (const float value : values)
    for (int i = 0; i < 4; ++i)
      bytes += static_cast<char>(std::bit_cast<std::uint32_t>(value) >> (is_big_endian ? 24 - 8 * i : 8 * i) & 0xFFU);
  return bytes;
}

// Geometric, position, horizontal, vertical, time, north, east.
TEST(Dilutions, OfMip) {
  const auto sent = [](const Dilution& dilution) {
    return sent_with(dilution, "mip", {"model", "gnss_fields"}, {"3dm-gx5-45", "gnss_dop"});
  };
  const std::string own = floats({2.5F, 2.25F, 1.25F, 1.875F, 1.0625F, 0.75F, 1.0F}, true);
  EXPECT_NE(sent(known).find(own), std::string::npos);
  EXPECT_EQ(sent({}).find(own), std::string::npos);
  EXPECT_NE(sent({}).find(floats({1.65F, 1.44F, 0.80F, 1.20F, 0.80F, 0.57F, 0.57F}, true)), std::string::npos);
}

// Geometric, position, time, vertical, horizontal, north, east.
TEST(Dilutions, OfVectorNav) {
  const auto sent = [](const Dilution& dilution) {
    return sent_with(dilution, "vectornav", {"model", "async_type", "binary_1"}, {"vn-300", "0", "1,8,08,2000"});
  };
  const std::string own = floats({2.5F, 2.25F, 1.0625F, 1.875F, 1.25F, 0.75F, 1.0F}, false);
  EXPECT_NE(sent(known).find(own), std::string::npos);
  EXPECT_EQ(sent({}).find(own), std::string::npos);
  EXPECT_NE(sent({}).find(floats({1, 1, 1, 1, 1, 1, 1}, false)), std::string::npos);
}

}  // namespace
}  // namespace imud
