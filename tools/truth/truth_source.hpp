// TruthSource: the datagrams that imu-truth sends, from a motion or a capture.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string_view>

#include "core/time.hpp"
#include "protocols/native_truth.hpp"
#include "tools/truth/motion.hpp"
#include "transports/port.hpp"

namespace imud {

struct TimedDatagram {
  Nanoseconds offset;                // from the start to the instant at which it is to be sent
  std::span<const std::byte> bytes;  // valid until the next call of the source
  std::uint32_t stream = 0;  // stream and sequence of the acknowledgement; for native datagrams of a motion only
  std::uint32_t sequence = 0;
};

// Returns the next datagram; nullopt after the last one. Throws std::runtime_error, which names the fault.
using TruthSource = std::function<std::optional<TimedDatagram>()>;

// Makes the truths of a motion on the grid start + k/rate.
class MotionTruths {
 public:
  struct Options {
    const Motion* motion = nullptr;
    MotionParameters parameters;
    double rate_hz = 100;
    double start_s = 0;
    std::optional<double> for_s;  // nullopt: without end; the last truth is the one at the end of this time
    std::uint32_t stream = 0;
    bool acknowledge = false;
    bool new_run = true;     // the first truth is marked as the beginning of a run
    ClockStamp first_stamp;  // of the first truth; the clock passes as simulation time does
  };
  explicit MotionTruths(const Options& options);

  // Throws std::runtime_error if the motion exceeds the ranges that the model accepts.
  std::optional<Truth> next();
  Nanoseconds offset() const { return grid_.offset(next_ - 1); }  // of the last truth from the start

 private:
  const Options options_;
  const Grid grid_;
  std::uint64_t next_ = 0;
};

// Returns the time of a clock, "tai", "utc" or "monotonic", at a host time near now. Throws std::invalid_argument for
// another word.
ClockStamp clock_stamp(std::string_view clock, HostTime time);

TruthSource native_source(const MotionTruths::Options& options);
// Makes a source of rows of text, one in a datagram, with the header row first.
TruthSource csv_source(const MotionTruths::Options& options);
// Makes a source of a capture's datagrams, byte for byte, at their recorded pace. `port` must outlive the source.
TruthSource capture_source(Port& port, std::optional<double> for_s);

}  // namespace imud
