// Shared by the tests of DroneCAN: a device without start-up time, whose frames are one text, separated by blanks.
#pragma once

#include "tests/protocols/can_unit.hpp"

namespace imud::dronecan_test {

inline std::string text_of(std::span<const Frame> frames) {
  Texts texts;
  for (const Frame& frame : frames) texts.push_back(can_text(frame));
  return joined(texts);
}

class Unit : public CanUnit {
 public:
  explicit Unit(std::string_view chosen = "")
      : CanUnit("dronecan", chosen.empty() ? "start_up_ms=0" : "start_up_ms=0 " + std::string(chosen)) {}

  std::string answer(std::string_view text) { return joined(give(text)); }
  std::string pass(Nanoseconds time) { return joined(CanUnit::pass(time)); }
  std::string sample(const Sample& one = {}) { return joined(CanUnit::sample(one)); }
  // Returns the measurements in the text.
  std::vector<Measurement> decoded(std::string_view text) {
    Recording recording;
    const auto decoder = protocol.make_decoder(settings);
    each_frame(text, [&](const Frame& frame) { decoder->feed(frame, recording); });
    return recording.measurements;
  }
};

// Returns the number of frames in a text.
inline std::size_t frames_in(std::string_view text) {
  return static_cast<std::size_t>(std::ranges::count(text, '#'));
}

}  // namespace imud::dronecan_test
