// A STIM300 with a host, for tests.
#pragma once

#include <gtest/gtest.h>

#include <boost/crc.hpp>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/protocol.hpp"
#include "tests/protocols/recording.hpp"
#include "tests/protocols/table_names.hpp"

namespace imud::stim300_test {

inline std::vector<std::byte> hex(std::string_view text) {
  std::vector<std::byte> bytes;
  for (std::size_t i = 0; i + 1 < text.size(); i += 2)
    bytes.push_back(static_cast<std::byte>(std::stoul(std::string(text.substr(i, 2)), nullptr, 16)));
  return bytes;
}

using Datagrams = std::vector<std::vector<std::byte>>;

// A unit with a host, sampled at its 2000 Hz or left without samples. Its deadlines are polled.
class Stim300Unit {
 public:
  explicit Stim300Unit(std::string_view settings = "start_up=false") {
    const Protocol& protocol = *find_protocol("stim300");
    Settings all(protocol.settings);
    while (!settings.empty()) {
      const std::string_view one = settings.substr(0, settings.find(','));
      settings.remove_prefix(std::min(settings.size(), one.size() + 1));
      all.set_text(one.substr(0, one.find('=')), one.substr(one.find('=') + 1));
    }
    device = protocol.make(all);
    decoder = protocol.make_decoder(all);
  }

  // Returns the datagrams of so many samples. The first sample ever is at time 0; later calls begin half a
  // millisecond after now().
  Datagrams run(int samples) {
    Datagrams all;
    for (int k = 0; k < samples; ++k) {
      sample.counter = count_++;
      sample.time = sample.counter == 0 ? now_ : now_ + std::chrono::microseconds(500);
      poll_until(sample.time, all);
      frames_->clear();
      device->sample(sample, *frames_);
      append(all);
    }
    return all;
  }
  // Returns the datagrams of a time without samples.
  Datagrams wait(Nanoseconds duration) {
    Datagrams all;
    poll_until(now_ + duration, all);
    return all;
  }
  // Send to the unit, and return its immediate answer.
  std::string send_line(std::string_view line) { return send(std::string(line) + "\r"); }
  std::string send(std::string_view text) {
    frames_->clear();
    device->receive({std::as_bytes(std::span(text))}, now_, *frames_);
    std::string answer;
    for (const Frame& frame : frames_->frames())
      for (const std::byte byte : frame.bytes) answer += static_cast<char>(byte);
    return answer;
  }
  // Sends a command of Utility Mode with its checksum. Returns the answer without its checksum, which it checks.
  std::string ask(const std::string& words) {
    const auto crc = [](const std::string& text) {
      boost::crc_optimal<8, 0x07, 0xFF, 0, false, false> sum;
      sum.process_bytes(text.data(), text.size());
      return std::to_string(sum.checksum());
    };
    const std::string answer = send_line("$" + words + "," + crc("$" + words + ","));
    const std::size_t comma = answer.rfind(',');
    if (comma == std::string::npos || answer.substr(comma + 1) != crc(answer.substr(0, comma + 1)) + "\r")
      return "bad " + answer;
    return answer.substr(0, comma);
  }
  Recording decode(const Datagrams& datagrams) const {
    Recording recording;
    for (const auto& datagram : datagrams) decoder->feed({datagram}, recording);
    return recording;
  }

  DeviceTime now() const { return now_; }
  void step_clock(Nanoseconds by) {
    device->step_clock(by);
    now_ = now_ + by;
  }

  Sample sample;
  std::unique_ptr<Device> device;
  std::unique_ptr<Decoder> decoder;

 private:
  void poll_until(DeviceTime end, Datagrams& all) {
    for (auto due = device->deadline(); due && *due <= end; due = device->deadline()) {
      ASSERT_GE(*due, now_);
      frames_->clear();
      device->poll(now_ = *due, *frames_);
      append(all);
      ASSERT_GT(device->deadline().value_or(now_ + std::chrono::hours(1)), now_);
    }
    now_ = end;
  }
  void append(Datagrams& all) const {
    for (const Frame& frame : frames_->frames()) all.emplace_back(frame.bytes.begin(), frame.bytes.end());
  }

  DeviceTime now_;
  std::uint64_t count_ = 0;
  std::unique_ptr<FrameBuffer> frames_ = std::make_unique<FrameBuffer>();
};

inline unsigned first(const std::vector<std::byte>& datagram) { return std::to_integer<unsigned>(datagram[0]); }

}  // namespace imud::stim300_test
