// A canopen device on standard input and output, for canopen_eds_test.py. An input line is a frame as candump writes
// it ("60A#4000100000000000"), or "+MS", the milliseconds that pass, with a sample every 10 ms. Each is answered by
// one line with all frames that the device sends, separated by blanks. The arguments are settings (KEY=VALUE).
#include <iostream>
#include <memory>
#include <string>

#include "tests/protocols/can_text.hpp"
#include "tests/protocols/recording.hpp"

int main(int count, char** arguments) {
  using namespace imud;
  const Protocol& protocol = protocol_named("canopen");
  std::string texts;
  for (int i = 1; i < count; ++i) texts += std::string(i > 1 ? " " : "") + arguments[i];
  const std::unique_ptr<Device> device = protocol.make(settings_of(protocol, texts));
  const auto frames = std::make_unique<FrameBuffer>();
  std::string sent;
  const auto collect = [&] {
    for (const Frame& frame : frames->frames()) sent += (sent.empty() ? "" : " ") + can_text(frame);
    frames->clear();
  };
  DeviceTime now;
  const auto poll_until = [&](DeviceTime end) {
    while (device->deadline() && *device->deadline() <= end) {
      device->poll(*device->deadline(), *frames);
      collect();
    }
    now = end;
  };
  Sample sample;
  sample.rate = {0.25, -0.5, 1};
  sample.specific_force = {1, -2, -9.75};
  for (std::string line; std::getline(std::cin, line); std::cout << sent << std::endl, sent.clear()) {
    if (!line.starts_with('+')) {
      poll_until(now);
      each_frame(line, [&](const Frame& frame) { device->receive(frame, now, *frames); });
      collect();
      continue;
    }
    const Nanoseconds step = std::chrono::milliseconds(10);
    for (const DeviceTime end = now + std::chrono::milliseconds(std::stol(line.substr(1))); now < end;) {
      poll_until(std::min(end, now + step));
      sample.time = now;
      device->sample(sample, *frames);
      ++sample.counter;
      collect();
    }
  }
}
