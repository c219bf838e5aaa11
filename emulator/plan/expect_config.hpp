// ExpectConfig: an [[expect]] as it is configured.
#pragma once

#include <cstdint>
#include <string>

#include "emulator/plan/host_bytes.hpp"

namespace imud {

struct ExpectConfig {
  enum class What : std::uint8_t {
    host_sends,      // the host sends bytes, or `pattern`, within the time
    host_is_silent,  // the host sends no bytes, or not `pattern`, during the time
    host_reopens,    // the port, which had no reader, has a reader within the time
  };
  std::string name;  // "expect1" if it has none
  std::string imu;   // the imu whose host is watched
  What what = What::host_sends;
  HostBytes pattern;
  std::string fault_name;  // the fault after which the time begins; empty: none
  bool after_end = false;  // after the fault's end; false: after its begin
  double at_s = 0;         // without a fault: the begin of the time, s after the begin of the run
  double within_s = 0;     // the length of the time, above 0

  // Describes the expectation in a sentence.
  std::string text() const;
};

}  // namespace imud
