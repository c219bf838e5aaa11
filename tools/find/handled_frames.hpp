// HandledFrames: the whole frames of two captures of one sensor, at rest and turned by hand, and the numbers in them
// on a common scale of time.
#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <span>
#include <tuple>
#include <vector>

#include "protocols/frames/layout/frame_number.hpp"
#include "tools/find/frame_finder.hpp"

namespace imud {

// A number in the frames of a message. An unsigned number is read less the middle of its range (offset binary).
struct NumberPlace {
  std::size_t message = 0;  // index of the message
  std::size_t at = 0;       // byte
  FrameNumber type = {};
  auto operator<=>(const NumberPlace& other) const noexcept {
    return std::tuple(message, at, type.format, type.bytes, type.is_big) <=>
           std::tuple(other.message, other.at, other.type.format, other.type.bytes, other.type.is_big);
  }
};

// Returns the number in a frame.
double value_in(std::span<const std::byte> frame, std::size_t at, const FrameNumber& type) noexcept;

enum class Handled : std::uint8_t { rest, turned };

// The statistics of a number in consecutive frames of one capture.
struct NumberStatistics {
  bool is_finite = false;  // no value is infinite, not a number, or beyond 1e12 or below 1e-12 but for 0
  double mean = 0, sigma = 0;
  double step = 0;  // the root mean square of the difference from one frame to the next
};

class HandledFrames {
 public:
  // The first `turned_bytes` of the stream are the capture that was turned, all other bytes are the capture at
  // rest. The stream must outlive this.
  HandledFrames(const std::vector<FoundMessage>& messages, std::span<const std::byte> stream,
                std::size_t turned_bytes);

  // Returns the statistics of at most so many pairs of frames, evenly spaced.
  NumberStatistics statistics(const NumberPlace& number, Handled capture, std::size_t most_pairs) const;
  // Returns the values in at most so many frames, evenly spaced.
  std::vector<double> values(const NumberPlace& number, Handled capture, std::size_t most) const;
  // Returns the means of a number in the blocks of a capture, which are calculated once.
  const std::vector<double>& blocks(const NumberPlace& number, Handled capture) const;

  // A block is a sequence of consecutive frames of the most frequent message, with the frames of the other
  // messages at that time.
  // Returns the time of the middle of each block, in frames of the most frequent message.
  const std::vector<double>& time(Handled capture) const { return part(capture).time; }
  // Returns the number of whole frames.
  std::size_t frame_count(std::size_t message, Handled capture) const { return part(capture).frames[message].size(); }

 private:
  using Frames = std::vector<std::span<const std::byte>>;
  struct Part {
    std::vector<Frames> frames;                     // whole frames, of each message
    std::vector<std::vector<std::size_t>> nearest;  // of each message, by frames of the most frequent one
    std::size_t block = 1;                          // frames
    std::vector<double> time;
    mutable std::map<NumberPlace, std::vector<double>> means;
  };
  const Part& part(Handled capture) const { return parts_[static_cast<std::size_t>(capture)]; }
  void align(Part& part, std::size_t most_frequent, bool is_alone);

  std::array<Part, 2> parts_;
};

}  // namespace imud
