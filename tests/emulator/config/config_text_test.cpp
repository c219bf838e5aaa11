// The text of a configuration: overrides by number, by name and for all, its digest, and what is wrong with a file.
#include "emulator/config/config_text.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "emulator/plan/config.hpp"
#include "tests/support/compressed.hpp"
#include "tests/support/text.hpp"
#include "tests/tools/run_program.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

class ConfigTextTest : public testing::Test {
 protected:
  ConfigText read(const std::vector<std::string>& overrides) {
    std::ofstream(path_)
        << "seed = 1\n[[imu]]\nrate_hz = 1\n[[imu]]\nname = \"left.wing\"\n[[imu]]\nname = \"nose\"\n";
    faults_ = Faults(path_);
    return read_config_text(path_, overrides, faults_);
  }
  // Returns the rates of the three imus, 0 where there is none.
  std::vector<std::int64_t> rates(const std::vector<std::string>& overrides) {
    const ConfigText text = read(overrides);
    EXPECT_TRUE(faults_.all().empty()) << faults_.all().at(0);
    std::vector<std::int64_t> all;
    for (std::size_t i = 0; i < 3; ++i) all.push_back(text.root["imu"][i]["rate_hz"].value_or(std::int64_t{0}));
    return all;
  }
  std::string fault_of(const std::string& content) {
    std::ofstream(path_) << content;
    try {
      read_config_text(path_, {}, faults_ = Faults(path_));
    } catch (const ConfigError& error) {
      return error.faults.at(0).substr(path_.size());
    }
    return {};
  }

  const ScratchFolder folder_;
  const std::string path_ = folder_ / "config.toml";
  Faults faults_{path_};
};

TEST_F(ConfigTextTest, OverridesByNumberByNameAndForAll) {
  using Rates = std::vector<std::int64_t>;
  EXPECT_EQ(rates({}), (Rates{1, 0, 0}));
  EXPECT_EQ(rates({"imu.1.rate_hz=5"}), (Rates{1, 5, 0}));
  EXPECT_EQ(rates({"imu.nose.rate_hz=6"}), (Rates{1, 0, 6}));
  EXPECT_EQ(rates({"imu.left.wing.rate_hz=7"}), (Rates{1, 7, 0}));
  EXPECT_EQ(rates({"imu.imu1.rate_hz=8"}), (Rates{8, 0, 0})) << "its name where it has none";
  EXPECT_EQ(rates({"imu.*.rate_hz=9", "imu.nose.rate_hz=2"}), (Rates{9, 9, 2}));
  EXPECT_EQ(read({"imu.*.device.model=x"}).root["imu"][2]["device"]["model"].value_or(std::string()), "x");
}

TEST_F(ConfigTextTest, OfTwoNamesThatFitTheLongerIsMeant) {
  for (const std::string names :
       {"[[imu]]\nname = \"a\"\n[[imu]]\nname = \"a.b\"\n", "[[imu]]\nname = \"0\"\n[[imu]]\nname = \"0.b\"\n"}) {
    std::ofstream(path_) << names;
    const std::string first = names.substr(names.find('"') + 1, 1);
    const ConfigText text = read_config_text(
        path_, std::vector<std::string>{"imu." + first + ".rate_hz=5", "imu." + first + ".b.rate_hz=6"}, faults_);
    EXPECT_TRUE(faults_.all().empty()) << faults_.all().at(0);
    EXPECT_EQ(text.root["imu"][0]["rate_hz"].value_or(0), 5);
    EXPECT_EQ(text.root["imu"][1]["rate_hz"].value_or(0), 6);
  }
}

TEST_F(ConfigTextTest, AnOverrideThatCannotBeSetIsAFault) {
  for (const std::string bad : {"imu.3.rate_hz=1", "imu.tail.rate_hz=1", "imu.nose=1", "imu.*=1", "imu.*.rate_hz.x=1",
                                "seed.x=1", "seed", "=1", "imu.0.name=\xff", "imu.0.name=a\x7f"}) {
    read({bad});
    ASSERT_EQ(faults_.all().size(), 1U) << bad;
    EXPECT_TRUE(contains(faults_.all()[0], "--set " + bad)) << faults_.all()[0];
  }
}

TEST_F(ConfigTextTest, TheDigestIsThatOfTheFileAndTheOverrides) {
  const std::string plain = read({}).sha256;
  EXPECT_EQ(plain.size(), 64U);
  EXPECT_EQ(read({}).sha256, plain);
  EXPECT_NE(read({"seed=2"}).sha256, plain);
}

TEST_F(ConfigTextTest, WhatIsWrongWithTheFileIsNamed) {
  std::filesystem::remove(path_);
  EXPECT_THROW(read_config_text(path_, {}, faults_), ConfigError);
  EXPECT_TRUE(contains(faults_.all().back(), "cannot be read: No such file or directory"));
  const std::string folder = std::filesystem::path(path_).parent_path();
  EXPECT_THROW(read_config_text(folder, {}, faults_), ConfigError);
  EXPECT_TRUE(contains(faults_.all().back(), "cannot be read: Is a directory"));
  EXPECT_THROW(read_config_text("/dev/zero", {}, faults_), ConfigError);
  EXPECT_TRUE(contains(faults_.all().back(), "cannot be read: File too large"));
}

// As in `imud replay flight.pcap imu.toml`.
TEST_F(ConfigTextTest, ACaptureIsNotReadAsAConfiguration) {
  std::size_t captures = 0;
  for (const auto& entry : std::filesystem::directory_iterator(IMUD_SOURCE_DIR "/tests/captures")) {
    const std::string name = entry.path().filename();
    if (name.find(".pcap") == name.npos) continue;
    ++captures;
    faults_ = Faults(entry.path());
    EXPECT_THROW(read_config_text(entry.path(), {}, faults_), ConfigError) << name;
    ASSERT_EQ(faults_.all().size(), 1U) << name;
    EXPECT_TRUE(contains(faults_.all()[0], "data such as a capture; give the configuration first"))
        << faults_.all()[0];
  }
  EXPECT_GE(captures, 2U);
  const std::string capture = read_file(IMUD_SOURCE_DIR "/tests/captures/jsbsim_c172_10s.pcap");
  for (const std::string& data : {capture, gzip(capture), zstd(capture)})
    EXPECT_TRUE(contains(fault_of(data), "such as a capture")) << data.substr(0, 4);
  EXPECT_FALSE(contains(fault_of("\n\r\n[imu"), "such as a capture"));
}

TEST_F(ConfigTextTest, AllErrorsOfSyntaxAreNamedAtOnce) {
  std::ofstream(path_) << ("seed = 1\n[truth\nport = udp\n[[imu]]\nrate_hz = 2..5\nname = \"a\"\nname = \"b\"\n");
  EXPECT_THROW(read_config_text(path_, {}, faults_), ConfigError);
  const std::vector<std::string> all = faults_.all();
  ASSERT_EQ(all.size(), 4U) << all[0];
  const std::string lines[] = {":2: TOML: ", ":3: TOML: ", ":5: TOML: ", ":7: TOML: "};
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_TRUE(contains(all[i], lines[i])) << all[i];
    EXPECT_EQ(contains(all[i], "(it may follow from line 2)"), i > 0) << all[i];
  }
}

TEST_F(ConfigTextTest, ASeedBeyondTheIntegersOfTomlNeedsQuotes) {
  EXPECT_TRUE(
      fault_of("seed = 10000000000000000000\n").ends_with("; a seed above 9223372036854775807 is given in quotes"));
}

// It ends, whatever the file is.
TEST_F(ConfigTextTest, AnErrorOfSyntaxAtTheEndIsNamedOnce) {
  std::ofstream(path_) << ("a = [1,\n2,\n");
  EXPECT_THROW(read_config_text(path_, {}, faults_), ConfigError);
  EXPECT_EQ(faults_.all().size(), 1U);
}

TEST_F(ConfigTextTest, AWordWithoutQuotesIsNamedWithItsColumn) {
  EXPECT_EQ(fault_of("[[imu]]\nprotocol = native\n"),
            ":2: TOML: column 12: native is not a value of TOML; put text in quotes: \"native\"");
  const std::pair<std::string, std::string> words[] = {{"a = fast # b = 3", "column 5: fast is"},
                                                       {"  a=true1\r", "column 5: true1 is"},
                                                       {"a = imu1\t", "column 5: imu1 is"},
                                                       {"a.b = /dev/ttyUSB0", "column 7: /dev/ttyUSB0 is"},
                                                       {"a = udp:127.0.0.1:9810", "column 5: udp:127.0.0.1:9810 is"},
                                                       {"a = [\"rate\", q]", "column 14: q is"},
                                                       {"a = [rate, q]", "column 6: rate is"},
                                                       {"a = {b = native}", "column 10: native is"}};
  for (const auto& [line, fault] : words)
    EXPECT_TRUE(contains(fault_of(line + "\n"), fault)) << line << fault_of(line);
  for (const std::string line : {"a = [1, 2\nb = 3", "a = 12 abc", "a = \"abc", "a = 42x", "a native", "native",
                                 "= x", "a =", "[a", "[imu]]\nx = 1", "", "a = '", "a = -inf0", "a = 1.2.3"})
    EXPECT_FALSE(contains(fault_of(line + "\n"), "quotes:")) << line;
}

}  // namespace
}  // namespace imud
