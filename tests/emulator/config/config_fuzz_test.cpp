// Random changes of configurations, overrides and command lines. No text makes imud crash or hang, and each gives a
// configuration or a list of faults. The environment variable IMUD_FUZZ_INPUTS sets their number. The seed is fixed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "emulator/commands/command_line.hpp"
#include "emulator/config/load_config.hpp"
#include "emulator/plan/config.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

class ConfigFuzz : public testing::Test {
 protected:
  // The examples, whose parts are combined.
  void SetUp() override {
    for (const auto& file : std::filesystem::recursive_directory_iterator(IMUD_SOURCE_DIR "/tools")) {
      if (file.path().extension() != ".toml") continue;
      std::ifstream stream(file.path());
      texts_.emplace_back(std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>());
      for (std::size_t at = 0, end = 0; (end = texts_.back().find('\n', at)) != std::string::npos; at = end + 1)
        lines_.push_back(texts_.back().substr(at, end - at));
    }
    ASSERT_GE(texts_.size(), 8U);
    // A scenario is a part of a configuration.
    const auto is_whole = [](const std::string& text) { return text.find("[[imu]]") != std::string::npos; };
    const std::string whole = *std::find_if(texts_.begin(), texts_.end(), is_whole);
    for (std::string& text : texts_)
      if (!is_whole(text)) text.insert(0, whole + "\n");
    for (const Protocol* protocol : protocols()) {
      words_.emplace_back(protocol->name);
      for (const Setting& setting : protocol->settings) words_.emplace_back(setting.key);
    }
    for (const TruthFormat* format : truth_formats()) words_.emplace_back(format->name);
    for (const Transport* transport : transports())
      words_.push_back(std::string(transport->name) + ":127.0.0.1:9810");
    for (const char* odd : {"",
                            "\"\"",
                            "''",
                            "-1",
                            "1e309",
                            "nan",
                            "-inf",
                            "18446744073709551616",
                            "[]",
                            "{}",
                            "[[",
                            "]]",
                            "\n[",
                            "imu.*.",
                            "\xff",
                            "\0x",
                            "true",
                            "2025-01-01T00:00:00Z",
                            "=",
                            ".",
                            "\"",
                            "?",
                            "&",
                            "\\u0000",
                            "[1,2,3]",
                            "[[1e308,1e308,0],[1e308,1e308,0],[0,0,1]]",
                            "file:/dev/null",
                            "auto",
                            "0",
                            "1e-320",
                            "9223372036854775807"})
      words_.emplace_back(odd);
  }

  std::size_t below(std::size_t n) { return std::uniform_int_distribution<std::size_t>(0, n - 1)(random_); }
  const std::string& any(const std::vector<std::string>& all) { return all[below(all.size())]; }

  std::string changed(std::string text) {
    const std::size_t at = below(text.size() + 1);
    switch (below(6)) {
      case 0:
        return text.insert(at, any(words_));
      case 1:
        return text.erase(at, below(20));
      case 2:
        return text.insert(at, "\n" + any(lines_) + "\n");
      case 3:
        if (at < text.size()) text[at] = static_cast<char>(below(256));
        return text;
      case 4: {  // another value of a key
        const std::size_t equals = text.find('=', at);
        if (equals == std::string::npos) return text + any(lines_);
        const std::size_t end = std::min(text.find('\n', equals), text.size());
        return text.replace(equals + 1, end - equals - 1, below(2) == 0 ? any(words_) : '"' + any(words_) + '"');
      }
      default:
        return text.substr(0, at) + any(texts_).substr(0, below(400));
    }
  }

  // A new file: ext4 waits for the disk when a file that was emptied is closed.
  static void write(const std::string& path, const std::string& text) {
    std::filesystem::remove(path);
    std::ofstream(path, std::ios::binary) << text;
  }

  static std::size_t inputs(std::size_t initial) {
    const char* wanted = std::getenv("IMUD_FUZZ_INPUTS");
    return wanted == nullptr ? initial : std::strtoull(wanted, nullptr, 10);
  }

  std::mt19937_64 random_{13};
  std::vector<std::string> texts_, lines_, words_;
  ScratchFolder folder_;
};

TEST_F(ConfigFuzz, AnyConfigurationIsReadOrRefused) {
  const std::string path = folder_ / "c.toml";
  std::size_t good = 0, refused = 0;
  for (std::size_t n = inputs(1500); n > 0; --n) {
    std::string text = any(texts_);
    for (std::size_t changes = below(4); changes > 0; --changes) text = changed(std::move(text));
    write(path, text);
    std::vector<std::string> overrides;
    for (std::size_t more = below(3); more > 0; --more) overrides.push_back(changed(any(lines_)));
    try {
      const Config config = load_config(path, overrides);
      ++good;
      write(path, config.resolved());
      EXPECT_EQ(load_config(path).resolved(), config.resolved()) << text;
    } catch (const ConfigError& error) {
      ++refused;
      EXPECT_FALSE(error.faults.empty());
    }
  }
  EXPECT_GT(good, 100U);
  EXPECT_GT(refused, 500U);
}

// Commands that begin something are given a configuration that does not exist.
TEST_F(ConfigFuzz, AnyCommandLineIsExecutedOrRefused) {
  const std::string path = folder_ / "c.toml";
  const std::vector<std::string> words = {
      "--set", "--require", "--json",    "--toml",    "--for",  "--fast",   "--help", "--x", "-",         "--",  "",
      "1e9",   "samples>0", "--summary", "--quality", "seed=1", "imu.*.x=", "=",      "-1",  "--version", "\xff"};
  std::size_t codes[3] = {};
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  for (std::size_t n = inputs(1000); n > 0; --n) {
    write(path, changed(any(texts_)));
    std::vector<std::string> line = {"imud"};
    switch (below(4)) {
      case 0:
        line.insert(line.end(), {"check", path});
        break;
      case 1:
        line.insert(line.end(), {"list", any(words_)});
        break;
      case 2:
        line.insert(line.end(), {below(2) == 0 ? "run" : "replay", folder_ / "none.toml"});
        break;
      default:
        line.push_back(changed("check"));
    }
    for (std::size_t more = below(5); more > 0; --more)
      line.push_back(below(3) == 0 ? any(words_) : below(2) == 0 ? changed("imu.0.rate_hz=1") : any(words));
    std::vector<const char*> arguments;
    for (const std::string& word : line) arguments.push_back(word.c_str());
    const int code = command_line(static_cast<int>(arguments.size()), arguments.data());
    EXPECT_TRUE(code == 0 || code == 2) << code << " of " << testing::PrintToString(line);
    ++codes[code & 3];
  }
  testing::internal::GetCapturedStdout();
  testing::internal::GetCapturedStderr();
  EXPECT_GT(codes[0], 20U);
  EXPECT_GT(codes[2], 100U);
}

}  // namespace
}  // namespace imud
