// Shipped descriptions of frames as protocols: `protocol = "hipnuc"`.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include "emulator/config/load_config.hpp"
#include "emulator/config/presets.hpp"
#include "emulator/frames/described_protocols.hpp"
#include "emulator/frames/frame_file.hpp"
#include "emulator/plan/config.hpp"
#include "protocols/frames/layout/frame_description.hpp"
#include "protocols/truth_format.hpp"
#include "tests/protocols/recording.hpp"
#include "tests/support/text.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

class DescribedProtocol : public testing::Test {
 protected:
  ImuConfig imu(const std::string& keys) const {
    std::ofstream(path_) << "[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nport = \"pty:imu1\"\n"
                         << (contains(keys, "rate_hz") ? "" : "rate_hz = 100\n") << keys;
    return load_config(path_).imus.at(0);
  }
  std::string fault(const std::string& keys) const {
    try {
      imu(keys);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "no fault";
  }
  ScratchFolder folder_;
  const std::string path_ = folder_ / "config.toml";
  const std::string ranges_ = "gyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n";
};

TEST_F(DescribedProtocol, EveryFileIsOfferedUnderItsName) {
  std::set<std::string> files, names;
  for (const auto& file : std::filesystem::directory_iterator(IMUD_SOURCE_DIR "/protocols/frames"))
    if (file.path().extension() == ".toml") files.insert(file.path().stem());
  for (const Protocol* protocol : described_protocols()) {
    SCOPED_TRACE(protocol->name);
    const std::string name(protocol->name);
    names.insert(name);
    EXPECT_EQ(resolve_protocol(name), protocol);
    EXPECT_TRUE(is_described(*protocol));
    // A name has one meaning.
    EXPECT_EQ(find_protocol(name), nullptr);
    EXPECT_EQ(find_truth_format(name), nullptr);
    EXPECT_EQ(find_transport(name), nullptr);
    EXPECT_EQ(find_preset(name), nullptr);
    EXPECT_FALSE(protocol->summary.empty());
    EXPECT_FALSE(protocol->document.empty());
    const Settings settings(protocol->settings);
    ASSERT_NE(settings.frames(), nullptr);
    EXPECT_EQ(settings.frames()->file, name);
    EXPECT_TRUE(contains(protocol->layout(settings).at(0), protocol->summary));
    EXPECT_TRUE(std::ranges::none_of(protocol->settings, &Setting::names_frames));
    const std::vector<std::string> all = protocol_names();
    EXPECT_EQ(std::ranges::count(all, name), 1);
  }
  EXPECT_EQ(names, files);
  EXPECT_EQ(protocol_names().size(), protocols().size() + files.size());
  for (const Protocol* protocol : protocols()) {
    EXPECT_EQ(resolve_protocol(protocol->name), protocol);
    EXPECT_FALSE(is_described(*protocol));
  }
  EXPECT_EQ(resolve_protocol("hipnuk"), nullptr);
}

TEST_F(DescribedProtocol, SendsAndDecodesTheFramesOfItsFile) {
  std::size_t sent = 0;
  for (const Protocol* protocol : described_protocols()) {
    SCOPED_TRACE(protocol->name);
    const Protocol& frame = *find_protocol("frame");
    Settings settings(frame.settings);
    settings.set("frame_file", std::string(protocol->name));
    attach_frames(settings, frame.settings);
    Line by_name(*protocol), by_file(frame, settings);
    Recording of_name, of_file;
    Sample sample;
    for (int k = 0; k < 20; ++k) {
      sample.time.ns = 100'000'000LL * k;
      sample.counter = static_cast<std::uint64_t>(k);
      sample.rate = Vector3(0.1, -0.2, 0.01 * k);
      const std::vector<StoredFrame> a = by_name.encode_all({&sample, 1}), b = by_file.encode_all({&sample, 1});
      EXPECT_EQ(concatenated(a), concatenated(b));
      by_name.feed(a, of_name);
      by_file.feed(b, of_file);
      sent += a.size();
    }
    EXPECT_EQ(of_name.measurements.size(), of_file.measurements.size());
  }
  EXPECT_GE(sent, 20 * described_protocols().size());
}

TEST_F(DescribedProtocol, IsConfiguredAsAnyOther) {
  const ImuConfig hipnuc = imu("protocol = \"hipnuc\"\n" + ranges_);
  EXPECT_EQ(hipnuc.protocol, resolve_protocol("hipnuc"));
  EXPECT_EQ(hipnuc.settings.frames()->file, "hipnuc");
  EXPECT_EQ(hipnuc.errors_model, "white");
  EXPECT_EQ(hipnuc.port_settings.uart.baud, 115200U);
  EXPECT_EQ(imu("protocol = \"hipnuc\"\ndevice.baud = 230400\n" + ranges_).port_settings.uart.baud, 230400U);
  EXPECT_EQ(imu("protocol = \"witmotion\"\nrate_hz = 200\ndevice.settings = {BAUD = 115200}\n" + ranges_)
                .port_settings.uart.baud,
            115200U);
  EXPECT_TRUE(contains(fault("protocol = \"hipnuc\"\n"), "imu.0.gyro.max_rad_per_s: missing"))
      << fault("protocol = \"hipnuc\"\n");
  EXPECT_TRUE(contains(fault("protocol = \"hipnuk\"\n" + ranges_),
                       "imu.0.protocol: there is no \"hipnuk\"; did you mean \"hipnuc\"?"));
  for (const char* file : {"hipnuc", "mine.toml"})
    EXPECT_TRUE(
        contains(fault("protocol = \"hipnuc\"\ndevice.frame_file = \"" + std::string(file) + "\"\n" + ranges_),
                 "imu.0.device.frame_file: protocol \"hipnuc\" has its description; omit the key, or give "
                 "protocol = \"frame\""));
  // The fault of the description is one of the protocol.
  EXPECT_TRUE(contains(fault("protocol = \"kvh1750\"\n"), "imu.0.protocol: kvh1750: line "));
}

}  // namespace
}  // namespace imud
