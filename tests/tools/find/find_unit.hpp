// Captures of sensors at rest and turned by hand, as imud's devices send them.
#pragma once

#include <cmath>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "core/units.hpp"
#include "tests/protocols/frames/frame_unit.hpp"

namespace imud {

// A sensor lies still, or is turned about all axes.
enum class Handling { rest, turned };

// The noise of a sensor of good grade, and a motion whose rates agree with the direction of gravity.
inline std::vector<Sample> handled_samples(Handling handling, std::size_t count, double rate_hz, unsigned seed = 1) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise;
  const auto noisy = [&](const Vector3& exact, double sigma) {
    return Vector3(exact + sigma * Vector3(noise(random), noise(random), noise(random)));
  };
  std::vector<Sample> samples(count);
  const double dt = 1 / rate_hz;
  Vector3 up(0.02, -0.03, 1);  // in the sensor's axes
  up.normalize();
  std::int64_t gps_ns = 1'440'000'001'000'000'000;
  for (std::size_t k = 0; k < count; ++k) {
    Sample& sample = samples[k];
    const double t = dt * static_cast<double>(k);
    Vector3 rate = Vector3::Zero();
    if (handling == Handling::turned)
      rate = Vector3(1.2 * std::sin(0.9 * t), std::sin(0.61 * t + 1), 0.8 * std::sin(0.37 * t + 2));
    const double angle = rate.norm() * dt;
    if (angle > 0) up = Eigen::AngleAxisd(-angle, rate.normalized()) * up;
    sample.time.ns = std::llround(1e9 * t) + 3'000'000'000;
    sample.counter = k + 1000;
    sample.rate = noisy(rate + Vector3(0.001, -0.002, 0.0015), 5e-4);
    sample.specific_force = noisy(-units::standard_gravity * up, 0.01);
    sample.delta_angle = dt * sample.rate;
    sample.delta_velocity = dt * sample.specific_force;
    sample.temperature_c = 31.5 + 0.1 * std::sin(0.05 * t);
    sample.magnetic_field = Vector3(2e-5, 1e-6, 4e-5);
    sample.pressure = 101325;
    sample.navigation = {.is_known = true, .gps_ns = gps_ns, .latitude = 0.8, .longitude = 0.1};
    gps_ns += std::llround(1e9 * dt);
  }
  return samples;
}

// A stream, and where each frame of it begins.
struct Capture {
  std::vector<std::byte> bytes;
  std::vector<std::size_t> begins;

  void add(std::span<const std::byte> frame) {
    begins.push_back(bytes.size());
    bytes.insert(bytes.end(), frame.begin(), frame.end());
  }
};

inline Capture capture_of(Line& line, std::span<const Sample> samples) {
  Capture capture;
  for (const Sample& sample : samples)
    for (const Frame& frame : line.encode(sample)) capture.add(frame.bytes);
  return capture;
}

// Shipped descriptions whose captures are searched: of bytes, with a check, and without a constant byte or a check of
// its own at the edge of the frame, which leaves open where frames begin.
constexpr std::string_view captured_descriptions[] = {"bno08x-rvc",   "dmu",     "gx3",    "hipnuc",
                                                      "inertiallabs", "isb-imu", "ncom",   "openimu",
                                                      "sensaition",   "stdbin",  "ubx-esf"};

inline Capture shipped_capture(std::string_view name, Handling handling, std::size_t count = 1000) {
  Line line(protocol_named("frame"), frame_settings(read_frames(std::string(name))));
  return capture_of(line, handled_samples(handling, count, 100));
}

inline Capture product_capture(std::string_view name, std::string_view settings, Handling handling, double seconds,
                               double rate_hz) {
  const Protocol& protocol = protocol_named(name);
  Line line(protocol, settings_of(protocol, settings));
  const auto samples = handled_samples(handling, static_cast<std::size_t>(seconds * rate_hz), rate_hz);
  line.device->power_on(samples.front().time);
  return capture_of(line, samples);
}

// Flips bits, and loses and inserts bytes, in about one frame of `one_in`.
inline std::vector<std::byte> damaged(const Capture& capture, unsigned one_in, unsigned seed = 1) {
  std::mt19937_64 random(seed);
  std::vector<std::byte> bytes = capture.bytes;
  for (std::size_t i = capture.begins.size(); i > 1; --i) {
    if (random() % one_in != 0) continue;
    const std::size_t begin = capture.begins[i - 2], at = begin + random() % (capture.begins[i - 1] - begin);
    const auto place = bytes.begin() + static_cast<std::ptrdiff_t>(at);
    if (const auto kind = random() % 4; kind == 0)
      bytes.erase(place);
    else if (kind == 1)
      bytes.insert(place, static_cast<std::byte>(random()));
    else
      *place ^= static_cast<std::byte>(1U << random() % 8);
  }
  return bytes;
}

}  // namespace imud
