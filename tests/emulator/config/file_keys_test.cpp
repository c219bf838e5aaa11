// Keys that name files: relative paths are from the folder of the file that has the key.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "emulator/config/load_config.hpp"
#include "emulator/plan/config.hpp"
#include "protocols/protocol.hpp"
#include "tests/core/gnss/yuma_text.hpp"
#include "tests/support/text.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

namespace fs = std::filesystem;

// A key that names a file, the configuration with it, and what such a file has.
struct FileKey {
  std::string key;
  std::string truth, imu;  // lines before and in [[imu]]; {} is the path
  std::string content;
};

const std::string ranges = "rate_hz = 100\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 200\n";
const std::string native_unit = "protocol = \"native\"\nport = \"pty:imu1\"\n" + ranges;
const std::string whole_preset =
    "# mine\n# no document\n[imu.gyro]\nmax_deg_per_s = 400\n[imu.accelerometer]\nmax_g = "
    "10\n[imu.magnetometer]\nmax_ut "
    "= 100\n[imu.barometer]\nnoise_pa = 7\n";
const FileKey file_keys[] = {
    {"imu.model", "", "protocol = \"native\"\nport = \"pty:imu1\"\nrate_hz = 100\nmodel = \"{}\"\n", whole_preset},
    {"imu.magnetometer.model", "", native_unit + "magnetometer.model = \"{}\"\n", whole_preset},
    {"imu.barometer.model", "", native_unit + "barometer.model = \"{}\"\n", whole_preset},
    {"imu.navigation.gnss_almanac", "", native_unit + "navigation.gnss_almanac = \"{}\"\n", yuma_text()},
    {"imu.device.frame_file", "",
     "protocol = \"frame\"\nport = \"pty:imu1\"\n" + ranges + "device.frame_file = \"{}\"\n",
     "frame_version = 1\nname = \"mine\"\n[[message]]\nlayout = [\"55 AA\", \"rate_x_deg_per_s:f32\"]\n"},
    {"imu.device.dbc_file", "",
     "protocol = \"dbc\"\nport = \"can:vcan0?bitrate=500000\"\n" + ranges +
         "device.dbc_file = \"{}\"\ndevice.signals = [\"S=rate_x_deg_per_s\"]\n",
     "BO_ 256 M: 8 Imu\n SG_ S : 0|16@1- (0.01,0) [0|0] \"\" Host\n"},
    {"control.token_file", "[control]\nlisten = \"127.0.0.1:7700\"\ntoken_file = \"{}\"\n", native_unit,
     "0123456789abcdef\n"},
    {"web.token_file", "[web]\nlisten = \"127.0.0.1:8080\"\ntoken_file = \"{}\"\n", native_unit,
     "0123456789abcdef\n"},
};

class FileKeys : public testing::Test {
 protected:
  FileKeys() { fs::create_directories(folder_ / "below/deeper"); }
  ~FileKeys() override { fs::current_path(before_); }
  FileKeys(const FileKeys&) = delete;
  FileKeys& operator=(const FileKeys&) = delete;

  static std::string with_path(std::string text, const std::string& path) {
    if (const std::size_t at = text.find("{}"); at != text.npos) text.replace(at, 2, path);
    return text;
  }
  // Writes a configuration to the folder, in which the key names the file by `path`.
  std::string config_of(const FileKey& key, const std::string& path) const {
    const std::string config = folder_ / "below/imud.toml";
    std::ofstream(config) << "[truth]\nport = \"udp:127.0.0.1:9810\"\n"
                          << with_path(key.truth, path) << "[[imu]]\n"
                          << with_path(key.imu, path);
    return config;
  }
  // Returns the resolved value of the key in the configuration; its faults if it has any.
  static std::string used_by(const FileKey& key, const std::string& config) {
    try {
      const std::string resolved = load_config(config).resolved();
      const std::string name = key.key.substr(key.key.rfind('.') + 1);
      std::smatch found;
      const std::regex line("(?:^|\n)" + name + " = ['\"]([^'\"]*(?:mine)[^'\"]*)['\"]");
      return std::regex_search(resolved, found, line) ? found[1].str() : "no file in\n" + resolved;
    } catch (const ConfigError& error) {
      return error.what();
    }
  }

  ScratchFolder folder_;
  fs::path before_ = fs::current_path();
};

TEST_F(FileKeys, AreFromTheFolderOfTheConfiguration) {
  for (const FileKey& key : file_keys) {
    SCOPED_TRACE(key.key);
    const std::string file = folder_ / "below/deeper/mine.toml";
    std::ofstream(file) << key.content;
    EXPECT_EQ(used_by(key, config_of(key, "deeper/mine.toml")), file);
    EXPECT_EQ(used_by(key, config_of(key, file)), file) << "absolute";
    // Another in the current folder does not count, but where there is none beside the configuration.
    fs::current_path(std::string(folder_ / "below/deeper"));
    std::ofstream(folder_ / "below/mine.toml") << key.content;
    EXPECT_EQ(used_by(key, config_of(key, "mine.toml")), std::string(folder_ / "below/mine.toml"));
    fs::remove(std::string(folder_ / "below/mine.toml"));
    EXPECT_EQ(used_by(key, config_of(key, "mine.toml")), "mine.toml");
    fs::remove(file);
    // A token is read by the run.
    if (!key.key.ends_with("token_file")) {
      const std::string faults = used_by(key, config_of(key, "mine.toml"));
      EXPECT_TRUE(contains(faults, std::string(folder_ / "below/mine.toml"))) << faults;
    }
    fs::current_path(before_);
  }
}

// No output overwrites them.
TEST_F(FileKeys, AreFilesInUse) {
  for (const FileKey& key : file_keys) {
    const std::string file = folder_ / "below/mine.toml";
    std::ofstream(file) << key.content;
    const std::string use = std::regex_replace("the file of " + key.key, std::regex("imu\\."), "imu.0.");
    EXPECT_EQ(load_config(config_of(key, "mine.toml")).files.use_of(file), use);
  }
}

// A fault's settings of another unit, in a scenario of another folder.
TEST_F(FileKeys, OfAScenarioAreFromItsFolder) {
  fs::create_directories(std::string(folder_ / "scenarios"));
  const FileKey& frames = *std::ranges::find(file_keys, "imu.device.frame_file", &FileKey::key);
  std::ofstream(folder_ / "scenarios/mine.toml") << frames.content;
  std::ofstream(folder_ / "scenarios/swap.toml") << "[[fault]]\nimu = \"imu1\"\ntarget = \"message\"\nkind = "
                                                    "\"other_settings\"\nat_s = 1\ndevice = {frame_file = "
                                                    "\"mine.toml\"}\n";
  std::ofstream(folder_ / "below/mine.toml") << frames.content;
  const std::vector<std::string> scenarios = {folder_ / "scenarios/swap.toml"};
  const Config config = load_config(config_of(frames, "mine.toml"), {}, {}, scenarios);
  EXPECT_TRUE(contains(config.resolved(), std::string(folder_ / "scenarios/mine.toml"))) << config.resolved();
  EXPECT_EQ(config.files.use_of(folder_ / "scenarios/mine.toml"), "the file of fault.0.device.frame_file");
}

// The reference states the rule once, and lists the keys; the settings of the protocols are among them.
TEST_F(FileKeys, AreThoseOfTheReference) {
  std::set<std::string> tested, documented, cells;
  for (const FileKey& key : file_keys) tested.insert(key.key);
  std::ifstream file(IMUD_SOURCE_DIR "/emulator/CONFIGURATION.md");
  const std::string text(std::istreambuf_iterator<char>(file), {});
  const std::size_t begin = text.find("\nA key that names a file ("), end = text.find(')', begin);
  ASSERT_NE(end, text.npos);
  const std::string list = text.substr(begin, end - begin);
  const std::regex word("`([^`]+)`");
  for (std::sregex_iterator at(list.begin(), list.end(), word), last; at != last; ++at)
    documented.insert((*at)[1].str());
  EXPECT_EQ(documented, tested);
  for (const Protocol* protocol : protocols())
    for (const Setting& setting : protocol->settings)
      if (setting.names_frames || setting.key.ends_with("_file")) {
        EXPECT_TRUE(tested.contains(fmt::format("imu.device.{}", setting.key))) << setting.key;
      }
  // A cell of a table that promises a file belongs to one of the keys.
  std::size_t files = 0;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);)
    files += line.starts_with("| `") && (contains(line, "| text: a file |") || contains(line, "or a file |") ||
                                         contains(line, "FILE.toml\"` |"));
  EXPECT_EQ(files + 2, tested.size()) << "frame_file and dbc_file have cells of the code";
}

}  // namespace
}  // namespace imud
