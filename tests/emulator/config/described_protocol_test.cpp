// Shipped descriptions of frames as protocols: `protocol = "hipnuc"`.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "core/units.hpp"
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
  // A file of a user, with this line at its top.
  std::string user_file(const std::string& line) const {
    const std::string path = folder_ / "mine.toml";
    std::ofstream(path) << "frame_version = 1\nname = \"mine\"\n"
                        << line << "\n[[message]]\nlayout = [\"55 AA\", \"rate_x_deg_per_s:f32\"]\n";
    return "protocol = \"frame\"\ndevice.frame_file = \"" + path + "\"\n";
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

// It may have the rate, which is not missing then.
TEST_F(DescribedProtocol, AFaultOfAFileIsTheOnlyOne) {
  std::ofstream(path_) << "[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nport = \"pty:imu1\"\n"
                       << user_file("rate_hz = 100\nbytes_order = \"big\"") << ranges_;
  try {
    load_config(path_);
    FAIL() << "no fault";
  } catch (const ConfigError& error) {
    EXPECT_EQ(error.faults.size(), 1U) << error.what();
    EXPECT_TRUE(contains(error.what(), "bytes_order")) << error.what();
  }
}

// The rate by the description's key, and by its messages if all have one.
TEST_F(DescribedProtocol, HasTheRateOfItsDescription) {
  const auto rate_of = [this](const std::string& keys) {
    std::ofstream(path_) << "[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nport = \"file:imu1\"\n"
                         << keys << ranges_;
    return load_config(path_).imus.at(0).rate_hz;
  };
  std::map<std::string_view, double> rates;
  for (const Protocol* protocol : described_protocols())
    if (const double rate = default_rate_hz(*protocol, Settings(protocol->settings)); rate != 0) {
      rates[protocol->name] = rate;
      EXPECT_EQ(rate_of(fmt::format("protocol = \"{}\"\n", protocol->name)), rate) << protocol->name;
    }
  EXPECT_EQ(rates, (std::map<std::string_view, double>{{"bno08x-rvc", 100},
                                                       {"dmu", 200},
                                                       {"hg1120", 600},
                                                       {"hg4930", 600},
                                                       {"hipnuc", 100},
                                                       {"kvh1750", 1000},
                                                       {"kvh1775", 1000},
                                                       {"lpms-ig1", 500},
                                                       {"nmea", 10},
                                                       {"novatel-raw", 125},
                                                       {"razor", 50},
                                                       {"stim210", 2000},
                                                       {"witmotion", 200}}));
  EXPECT_EQ(rate_of("protocol = \"hipnuc\"\nrate_hz = 400\n"), 400);
  EXPECT_EQ(rate_of(user_file("rate_hz = 250")), 250);
  EXPECT_EQ(rate_of("protocol = \"frame\"\ndevice.frame_file = \"hg4930\"\n"), 600);
  for (const std::string& keys : {user_file(""), std::string("protocol = \"gx3\"\n")}) {
    std::ofstream(path_) << "[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nport = \"pty:a\"\n" << keys << ranges_;
    EXPECT_THROW(load_config(path_), ConfigError) << keys;
  }
  EXPECT_TRUE(contains(fault(user_file("rate_hz = 20000")), "rate_hz")) << fault(user_file("rate_hz = 20000"));
  EXPECT_TRUE(contains(fault(user_file("rate_hz = 0")), "rate_hz: give 0.001 to 10000"));
}

TEST_F(DescribedProtocol, HasATitleInALineOfItsOwn) {
  const std::vector<const Protocol*> all = described_protocols();
  const std::vector<DescribedTitle> titles = described_titles();
  ASSERT_EQ(titles.size(), all.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_EQ(titles[i].name, all[i]->name);
    EXPECT_EQ(titles[i].summary, all[i]->summary);
    EXPECT_EQ(titles[i].document, all[i]->document);
  }
}

TEST_F(DescribedProtocol, HasTheModelOfItsDescription) {
  std::set<std::string_view> with_model;
  for (const Protocol* protocol : described_protocols()) {
    const Settings settings(protocol->settings);
    const std::string& model = settings.frames()->model;
    EXPECT_EQ(default_model(*protocol, settings), model.empty() ? "white" : model) << protocol->name;
    if (model.empty()) continue;
    with_model.insert(protocol->name);
    EXPECT_EQ(std::ranges::count(presets(), model, &Preset::name), 1) << protocol->name;
  }
  EXPECT_EQ(with_model, (std::set<std::string_view>{"hg1120", "hg4930", "kvh1750", "kvh1775", "novatel-raw"}));

  // A preset has the ranges.
  const ImuConfig own = imu("protocol = \"hg4930\"\n");
  EXPECT_EQ(own.errors_model, "hg4930-ca51");
  EXPECT_NEAR(own.model.gyro.max, 400 * units::degree, 1e-12);
  EXPECT_EQ(imu("protocol = \"hg4930\"\nmodel = \"hg4930-aa51\"\n").errors_model, "hg4930-aa51");
  EXPECT_EQ(imu("protocol = \"hg4930\"\nmodel = \"white\"\n" + ranges_).errors_model, "white");
  // A configuration that names the description by frame_file keeps its errors.
  EXPECT_EQ(imu("protocol = \"frame\"\ndevice.frame_file = \"hg4930\"\n" + ranges_).errors_model, "white");
}

TEST_F(DescribedProtocol, AUsersFileMayNameAModel) {
  EXPECT_EQ(imu(user_file("model = \"adis16470\"")).errors_model, "adis16470");
  EXPECT_EQ(imu(user_file("") + ranges_).errors_model, "white");
  EXPECT_EQ(imu(user_file("model = \"adis16470\"") + "model = \"vn-100\"\n").errors_model, "vn-100");
  const std::string unknown = fault(user_file("model = \"adis16471\"") + ranges_);
  EXPECT_TRUE(contains(unknown, "imu.0.device.frame_file: ")) << unknown;
  EXPECT_TRUE(contains(unknown, "mine.toml: model: there is no preset \"adis16471\"; did you mean \"adis16470\"?"))
      << unknown;
  // A magnetometer is no model of an imu, and a path leads out of the folder.
  EXPECT_TRUE(contains(fault(user_file("model = \"rm3100\"") + ranges_), "there is no preset \"rm3100\""));
  EXPECT_TRUE(contains(fault(user_file("model = \"../other.toml\"") + ranges_), "model: give the name of a preset"));
}

}  // namespace
}  // namespace imud
