// Devices and decoders of protocol "frame" with a description of their own.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/frames/frame_file.hpp"
#include "emulator/plan/config.hpp"
#include "protocols/frames/frame_device.hpp"
#include "protocols/wire/byte_text.hpp"
#include "tests/protocols/recording.hpp"
#include "tests/support/hex_bytes.hpp"

namespace imud {

inline Settings frame_settings(std::shared_ptr<const FrameDescription> description) {
  Settings settings(protocol_named("frame").settings);
  settings.attach(std::move(description));
  return settings;
}

// A description of one message with these elements, one a line.
inline std::string one_message(std::string_view elements, std::string_view more = "") {
  std::string text =
      "frame_version = 1\nname = \"test\"\n[[message]]\nname = \"m\"\n" + std::string(more) + "\nlayout = [\n";
  while (!elements.empty()) {
    const std::string_view line = elements.substr(0, elements.find('\n'));
    elements.remove_prefix(std::min(elements.size(), line.size() + 1));
    text.append("'").append(line).append("',\n");
  }
  return text + "]\n";
}

inline Line frame_line(std::string_view text) {
  return Line(protocol_named("frame"), frame_settings(frames_of_text(text, "test.toml")));
}

// The bytes of the frames of one sample.
inline std::vector<std::byte> bytes_of(Line& line, const Sample& sample) {
  std::vector<std::byte> bytes;
  for (const Frame& frame : line.encode(sample)) bytes.insert(bytes.end(), frame.bytes.begin(), frame.bytes.end());
  return bytes;
}

// Return the answers of a unit to the bytes of a host: answer_to() as text, the other function both in hexadecimal.
inline std::string answer_to(Line& line, std::string_view request) {
  const auto replies = std::make_unique<FrameBuffer>();
  line.device->receive({std::as_bytes(std::span(request))}, {}, *replies);
  std::string text;
  for (const Frame& frame : replies->frames())
    text.append(reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size());
  return text;
}
inline std::string hex_answer(Line& line, std::string_view request) {
  const std::vector<std::byte> bytes = *hex_bytes_in(request);
  const std::string answer = answer_to(line, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  return hex_text(std::as_bytes(std::span(answer)));
}

// The faults of a description, one a line; empty if it has none.
inline std::string faults_of(const std::string& text) {
  try {
    static_cast<void>(frames_of_text(text, "test.toml"));
  } catch (const ConfigError& error) {
    std::string all;
    for (const std::string& fault : error.faults) all += (all.empty() ? "" : "\n") + fault;
    return all;
  }
  return "";
}

}  // namespace imud
