// Shared by the tests of the whole daemon: a folder for the test alone, a configuration, the closing summary.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/tools/run_program.hpp"

namespace imud {

class RunTest : public testing::Test {
 protected:
  RunTest() {
    std::string name = testing::TempDir() + "imud_run_XXXXXX";
    folder_ = ::mkdtemp(name.data());
  }
  ~RunTest() override { std::filesystem::remove_all(folder_); }

  std::string path(const std::string& name) const { return folder_ + "/" + name; }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name), std::ios::binary) << text;
    return path(name);
  }

  // A configuration with one imu without errors. In realtime the delay is 0, so that sample 0 is at the first truth,
  // and no sample is skipped, however long a busy machine holds the process up.
  std::string config(const std::string& clock, const std::string& truth_port, const std::string& truth_format,
                     double rate_hz, const std::string& protocol, const std::string& port) const {
    return write("config.toml",
                 fmt::format(R"(seed = 1
clock = "{}"
{}[truth]
port = "{}"
format = "{}"
{}[[imu]]
rate_hz = {}
protocol = "{}"
port = "{}"
gyro.max_rad_per_s = 100
accelerometer.max_m_per_s2 = 1000
)",
                             clock, clock == "realtime" ? "realtime.skip_after_ms = 3600000\n" : "", truth_port,
                             truth_format, clock == "realtime" ? "delay_ms = 0\n" : "", rate_hz, protocol, port));
  }

  // The summary of the run that wrote it to path("summary.json").
  nlohmann::json summary() const { return nlohmann::json::parse(read_file(path("summary.json"))); }

  // Rows of measurement CSV as text fields, without the header row.
  static std::vector<std::vector<std::string>> rows(const std::string& csv) {
    std::vector<std::vector<std::string>> all;
    for (const std::string& line : lines_of(csv)) {
      if (line.starts_with("time_ns")) continue;
      std::vector<std::string> fields(1);
      for (const char c : line)
        if (c == ',')
          fields.emplace_back();
        else
          fields.back() += c;
      all.push_back(fields);
    }
    return all;
  }

  std::string folder_;
};

}  // namespace imud
