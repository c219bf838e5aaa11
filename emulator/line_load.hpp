// LineLoad: the share of its line or bus that an imu takes.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/frame.hpp"
#include "core/sample.hpp"
#include "emulator/config.hpp"

namespace imud {

struct LineLoad {
  std::size_t frames_per_sample = 0;  // 0 for a product, which sends less often than it samples
  std::size_t bytes_per_sample = 0;   // data bytes on CAN
  double frames_per_s = 0;
  double bits_per_s = 0;       // on the wire (Transport::wire_time); of data if frames leave instantly
  double line_bits_per_s = 0;  // the port's bit rate; 0: it has none
  double percent = 0;          // of the time that the wire is busy; 0 if it has no rate
  std::string text() const;    // one line for people
};

// Returns a sample of ordinary magnitude in which every digit is used.
Sample ordinary_sample();

// Frames of one kind that an imu sends.
struct SentFrames {
  CanHeader can;
  std::size_t bytes = 0;
  double per_s = 0;
};

// Returns all that an imu sends. On a CAN bus: what its protocol lists, whenever it is sent. Otherwise from ordinary
// samples encoded by its own protocol: the second second of a product, or one sample. The imu's protocol is valid.
std::vector<SentFrames> sent_frames(const ImuConfig& imu);

// Returns the load of the port's wire by these frames. The imu's protocol and port are valid.
LineLoad line_load(const ImuConfig& imu);

}  // namespace imud
