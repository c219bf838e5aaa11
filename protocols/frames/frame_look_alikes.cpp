#include "protocols/frames/frame_look_alikes.hpp"

#include <algorithm>
#include <array>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "core/attitude.hpp"

namespace imud {
namespace {

// Pseudo-random samples of a vehicle. A field that is constant in all samples counts as a constant.
class RandomSamples {
 public:
  Sample next() {
    Sample sample;
    sample.time.ns = static_cast<std::int64_t>(random_() >> 8);
    sample.counter = random_() >> 16;
    sample.rate = vector(5);
    sample.specific_force = vector(50);
    sample.temperature_c = number(-40, 85);
    sample.q_LP = exp(vector(1));
    sample.magnetic_field = vector(6e-5);
    sample.pressure = number(5e4, 1.1e5);
    sample.status = static_cast<std::uint32_t>(random_());
    sample.navigation = {.is_known = true,
                         .satellites = static_cast<std::uint8_t>(number(4, 30)),
                         .gps_ns = 1'000'000'000'000'000'000 + static_cast<std::int64_t>(random_() >> 6),
                         .latitude = number(-1.5, 1.5),
                         .longitude = number(-3, 3),
                         .height = number(0, 1e4),
                         .r_E = vector(6e6),
                         .v_L = vector(100)};
    return sample;
  }
  MessageLayout::State state() { return {random_() >> 16, random_() >> 16, random_() % 2 == 0}; }
  Vector3 vector(double most) { return {number(-most, most), number(-most, most), number(-most, most)}; }

 private:
  double number(double low, double high) {
    return low + (high - low) * 0x1p-53 * static_cast<double>(random_() >> 11);
  }
  std::mt19937_64 random_;  // the standard defines its sequence
};

constexpr std::size_t tries = 16;
using Frames = std::array<std::vector<std::byte>, tries>;

// Returns frames of the message. The samples are the same for all messages.
Frames frames_of(const MessageLayout& layout) {
  RandomSamples random;
  Frames frames;
  for (std::vector<std::byte>& frame : frames) {
    const Sample sample = random.next();
    const Reading reading = {sample, random.vector(0.1), random.vector(1), exp(random.vector(0.1)), 0.01};
    std::vector<double> carried(layout.carries());
    frame.resize(layout.longest());
    frame.resize(layout.encode(reading, random.state(), carried, frame).size);
  }
  return frames;
}

enum class Fit : std::uint8_t { no, begins, whole };

// Returns how the frames fit the layout.
Fit fit(const Frames& frames, const MessageLayout& layout) {
  Fit all = Fit::whole;
  for (const std::vector<std::byte>& frame : frames) {
    const auto [match, size] = layout.match(frame);
    if (match != MessageLayout::Match::yes) return Fit::no;
    if (size != frame.size()) all = Fit::begins;
  }
  return all;
}

std::string named(const FrameMessage& message) {
  return "message \"" + message.name + "\" in line " + std::to_string(message.line);
}

}  // namespace

void refuse_look_alikes(std::span<const FrameMessage> messages, FrameEscape escape, std::string_view file) {
  std::vector<Frames> frames;
  for (const FrameMessage& message : messages) frames.push_back(frames_of(*message.layout));
  std::vector<FrameFault> faults;
  for (std::size_t j = 1; j < messages.size(); ++j)
    for (std::size_t i = 0; i < j; ++i) {
      const FrameMessage &first = messages[i], &second = messages[j];
      if (!first.by_settings.is_streamed || !second.by_settings.is_streamed ||
          first.by_settings.excludes(second.by_settings))
        continue;
      const Fit of_second = fit(frames[j], *first.layout);
      std::string like;
      if (of_second == Fit::whole)
        like = "its frames fit " + named(first) + ", too, and are decoded as that";
      else if (escape != FrameEscape::none)
        continue;
      else if (of_second == Fit::begins)
        like = "its frames begin with bytes that are frames of " + named(first);
      else if (fit(frames[i], *second.layout) == Fit::begins)
        like = "the frames of " + named(first) + " begin with bytes that are frames of this one";
      if (like.empty()) continue;
      faults.push_back({second.line, "message \"" + second.name + "\"",
                        like + "; let the two differ in a constant, a length or a check, or send them with different "
                               "values of a setting (when)"});
      break;
    }
  if (!faults.empty()) throw FrameFaults(file, std::move(faults));
}

}  // namespace imud
