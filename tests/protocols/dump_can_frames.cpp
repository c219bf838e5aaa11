// Prints frames of native-can, one a line, for dbc_test.py: {"dbc": FILE, "frame": "ID#HEX" as candump writes it
// ("ID##FLAGS" for FD), "values": the decoded values of the sample to which the frame belongs}.
#include <cstdio>
#include <random>
#include <string>

#include "tests/protocols/recording.hpp"

namespace imud {
namespace {

std::string candump(const Frame& frame) {
  char text[8];
  std::snprintf(text, sizeof text, "%03X", frame.can.id);
  std::string line = text;
  line += frame.can.fd ? "##1" : "#";  // 1: bit rate switched
  for (const std::byte byte : frame.bytes) {
    std::snprintf(text, sizeof text, "%02X", std::to_integer<unsigned>(byte));
    line += text;
  }
  return line;
}

void print(const char* dbc, const Frame& frame, const Sample& sample) {
  std::printf("{\"dbc\": \"%s\", \"frame\": \"%s\", \"values\": {\"time_ns\": %lld, \"counter\": %llu", dbc,
              candump(frame).c_str(), static_cast<long long>(sample.time.ns),
              static_cast<unsigned long long>(sample.counter));
  const auto vector = [](const char* name, const Vector3& v) {
    for (int i = 0; i < 3; ++i) std::printf(", \"%s_%c\": %.17g", name, "xyz"[i], v[i]);
  };
  vector("gyro", sample.rate);
  vector("accel", sample.specific_force);
  vector("dtheta", sample.delta_angle);
  vector("dvel", sample.delta_velocity);
  std::printf(", \"temperature\": %.17g, \"status\": %u}}\n", sample.temperature_c, sample.status);
}

void dump(bool fd, const char* dbc) {
  const Protocol& protocol = protocol_named("native-can");
  Settings settings(protocol.settings);
  settings.set("fd", fd);
  Line line(protocol, settings);
  std::mt19937_64 random(3);
  std::vector<Sample> samples = random_samples(200, protocol, random);
  samples[1].rate = Vector3::Constant(-1e9);  // the ends of the ranges
  samples[1].delta_angle = Vector3::Constant(1e9);
  samples[1].temperature_c = -1e9;
  for (const Sample& sample : samples) {
    const std::span<const Frame> frames = line.encode(sample);
    Recording recording;
    for (const Frame& frame : frames) line.decoder->feed(frame, recording);
    for (const Frame& frame : frames) print(dbc, frame, recording.measurements.at(0).sample);
  }
}

}  // namespace
}  // namespace imud

int main() {
  imud::dump(false, "native_can.dbc");
  imud::dump(true, "native_can_fd.dbc");
}
