// LineLoad: the share of its line or bus that an imu occupies.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace imud {

struct LineLoad {
  std::size_t frames_per_sample = 0;  // 0 for a product, which sends less often than it samples
  std::size_t bytes_per_sample = 0;   // data bytes on CAN
  double frames_per_s = 0;
  // On the wire (Transport::wire_time), at most, and on average; data bits only if the transport has no wire time.
  // They differ on a CAN bus, whose stuff bits depend on the data. The average is over typical samples, and over
  // random data for an identifier that is not sent with samples.
  double bits_per_s = 0, average_bits_per_s = 0;
  double line_bits_per_s = 0;  // the port's bit rate; 0: it has none
  // Share of the time in which the wire is busy, at most, and on average; 0: no rate.
  double percent = 0, average_percent = 0;
  std::string text() const;  // one line for people
};

// A bus (Transport::is_shared, and it has a bit rate) with the imus on it.
struct BusLoad {
  static constexpr double high_percent = 70;  // above it, frames of low priority wait long
  std::string address;                        // the port without its options
  std::vector<std::size_t> imus;              // indices
  double line_bits_per_s = 0;
  double percent = 0, average_percent = 0;  // as LineLoad, of all imus
  std::string text() const;                 // "45.1 % on average and 52.0 % at most of 500000 bit/s"
};

}  // namespace imud
