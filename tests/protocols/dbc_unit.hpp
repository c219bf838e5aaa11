// A device of protocol "dbc" with a file of its own.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/protocols/can_text.hpp"
#include "tests/protocols/recording.hpp"

namespace imud {

class DbcUnit : public testing::Test {
 protected:
  DbcUnit() {
    std::string name = (std::filesystem::temp_directory_path() / "dbc_test.XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
    path_ = (folder_ / "vehicle.dbc").string();
  }
  ~DbcUnit() override { std::filesystem::remove_all(folder_); }
  void write(std::string_view text) const { std::ofstream(path_, std::ios::binary) << text; }

  Settings settings(std::vector<std::string> signals, std::vector<std::string> checksums = {}) const {
    Settings settings(protocol_.settings);
    settings.set("dbc_file", path_);
    settings.set("signals", std::move(signals));
    settings.set("checksums", std::move(checksums));
    return settings;
  }
  std::string refusal(std::vector<std::string> signals, std::vector<std::string> checksums = {}) const {
    try {
      static_cast<void>(protocol_.make(settings(std::move(signals), std::move(checksums))));
    } catch (const std::invalid_argument& error) {
      std::string text = error.what();
      if (const std::size_t at = text.find(path_); !path_.empty() && at != std::string::npos)
        text.replace(at, path_.size(), "PATH");
      return text;
    }
    return "";
  }
  // The frames of the samples at 0, 10 ms and so on.
  static std::vector<std::string> sent(Device& device, Sample sample, int samples) {
    std::vector<std::string> lines;
    const auto frames = std::make_unique<FrameBuffer>();
    for (int i = 0; i < samples; ++i) {
      frames->clear();
      device.sample(sample, *frames);
      std::string line;
      for (const Frame& frame : frames->frames()) line += (line.empty() ? "" : " ") + can_text(frame);
      lines.push_back(line);
      sample.time = sample.time + std::chrono::milliseconds(10);
      ++sample.counter;
    }
    return lines;
  }

  const Protocol& protocol_ = protocol_named("dbc");
  std::filesystem::path folder_;
  std::string path_;
};

}  // namespace imud
