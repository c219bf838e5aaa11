// TruthSource: where the datagrams that imu-truth sends come from.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "core/time.hpp"
#include "protocols/native_truth.hpp"
#include "tools/motion.hpp"
#include "transports/port.hpp"

namespace imud {

struct TimedDatagram {
  Nanoseconds offset;                // when it is due, from the start
  std::span<const std::byte> bytes;  // until the next call of the source
  std::uint32_t stream = 0;          // what its acknowledgement will say; native datagrams of a motion only
  std::uint32_t sequence = 0;
};

class TruthSource {
 public:
  virtual ~TruthSource() = default;
  // nullopt after the last. Throws std::runtime_error that says what is wrong.
  virtual std::optional<TimedDatagram> next() = 0;
  // A word on how it ended if it did not end well; empty otherwise.
  virtual std::string warning() const { return {}; }
};

// The truths of a motion on the grid start + k/rate.
class MotionTruths {
 public:
  struct Options {
    const Motion* motion = nullptr;
    MotionParameters parameters;
    double rate_hz = 100;
    double start_s = 0;
    std::optional<double> for_s;  // without it, without end; the truth at its end is the last
    std::uint32_t stream = 0;
    bool acknowledge = false;
    bool new_run = true;  // the first truth says so
  };
  explicit MotionTruths(const Options& options);

  // Throws std::runtime_error if the motion leaves what the model accepts.
  std::optional<Truth> next();
  Nanoseconds offset() const { return grid_.offset(next_ - 1); }  // of the last one from the start

 private:
  const Options options_;
  const Grid grid_;
  std::uint64_t next_ = 0;
};

std::unique_ptr<TruthSource> native_source(const MotionTruths::Options& options);
// Rows of text, a datagram each, the header row first.
std::unique_ptr<TruthSource> csv_source(const MotionTruths::Options& options);
// The datagrams of a capture byte for byte, at their recorded pace. `port` outlives the source.
std::unique_ptr<TruthSource> capture_source(Port& port, std::optional<double> for_s);

}  // namespace imud
