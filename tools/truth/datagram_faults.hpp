// DatagramFaults: the random faults of a bad network. The same seed gives the same faults.
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>

#include "core/time.hpp"

namespace imud {

class DatagramFaults {
 public:
  struct Rates {  // percentages: of all datagrams
    double drop_percent = 0;
    double duplicate_percent = 0;
    double reorder_percent = 0;
    double corrupt_percent = 0;
    double jitter_ms = 0;  // longest delay; delays are uniformly distributed
    std::uint64_t seed = 1;
  };
  // The faults of one datagram.
  struct Fate {
    bool drop = false;
    bool duplicate = false;
    bool reorder = false;  // the datagram is sent after the next datagram
    bool corrupt = false;  // bit `bit` of the datagram is flipped
    std::size_t bit = 0;
    Nanoseconds delay{};
  };

  explicit DatagramFaults(const Rates& rates);

  // Returns the faults of the next datagram, which is `size` bytes long. Every call draws the same number of random
  // numbers, so that the rate of one fault does not change which datagrams have another.
  Fate next(std::size_t size);

 private:
  double uniform();  // [0, 1); not by the standard's distributions, which differ from library to library

  Rates rates_;
  std::mt19937_64 engine_;
};

}  // namespace imud
