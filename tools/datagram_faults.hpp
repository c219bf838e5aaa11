// DatagramFaults: what a bad network does to datagrams, by chance but the same for the same seed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>

#include "core/time.hpp"

namespace imud {

class DatagramFaults {
 public:
  struct Rates {
    double drop_percent = 0;
    double duplicate_percent = 0;
    double reorder_percent = 0;
    double corrupt_percent = 0;
    double jitter_ms = 0;
    std::uint64_t seed = 1;
  };
  // What is to happen to one datagram.
  struct Fate {
    bool drop = false;
    bool duplicate = false;
    bool reorder = false;  // it leaves after the next one
    bool corrupt = false;  // bit `bit` of it is flipped
    std::size_t bit = 0;
    Nanoseconds delay{};
  };

  explicit DatagramFaults(const Rates& rates);

  // Of the next datagram, `size` bytes long. Every call draws the same count of numbers, so that one rate does not
  // change which datagrams another one strikes.
  Fate next(std::size_t size);

 private:
  double uniform();  // [0, 1); the standard's distributions differ from library to library

  Rates rates_;
  std::mt19937_64 engine_;
};

}  // namespace imud
