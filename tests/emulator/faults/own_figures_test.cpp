// The figures of its own errors that a device is given, as its bytes show them.
#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <fstream>
#include <string>

#include "tests/tools/run_program.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

std::string big_endian(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(bits >> shift & 0xFF);
  return bytes;
}

// Returns what a receiver sends of the captured flight.
std::string positions(const std::string& keys) {
  const ScratchFolder folder;
  const std::string config = folder / "config.toml", sent = folder / "sent";
  std::ofstream(config) << "[truth]\nport = \"udp:127.0.0.1:5140\"\nformat = \"jsbsim\"\n[earth]\nframe = "
                           "\"inertial\"\n[[imu]]\nprotocol = \"mip\"\nport = \"file:"
                        << sent << "\"\n[imu.device]\nmodel = \"3dm-gx5-45\"\ngnss_fields = [\"gnss_position\"]\n"
                        << keys;
  const ProgramResult result = run_program(
      "imud", {"replay", config, IMUD_TEST_DATA "/captures/jsbsim_c172_10s.pcap?port=5140", "--fast", "--for", "1"});
  EXPECT_NE(result.output.find("frames sent"), std::string::npos) << result.errors;
  return read_file(sent);
}

// MIP's horizontal and vertical accuracy stand side by side (0x81, 0x03).
TEST(OwnFigures, AccuraciesAreTheDeviationsOfTheNavigationErrors) {
  const std::string open_sky = big_endian(1.2F) + big_endian(1.8F), expected = big_endian(5) + big_endian(13);
  const std::string truth = positions("");
  EXPECT_NE(truth.find(open_sky), std::string::npos);
  EXPECT_EQ(truth.find(expected), std::string::npos);
  const std::string wrong =
      positions("[imu.navigation]\nposition_m = [3, 0, 12]\nposition_noise_m = [0, 4, 5]\nvelocity_m_per_s = 0.1\n");
  EXPECT_EQ(wrong.find(open_sky), std::string::npos);
  EXPECT_NE(wrong.find(expected), std::string::npos);
}

}  // namespace
}  // namespace imud
