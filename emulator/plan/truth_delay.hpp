// TruthDelay: how far behind live truth the sensors sample.
#pragma once

#include "core/time.hpp"

namespace imud {

struct TruthDelay {
  Nanoseconds delay{0};          // time behind the arrivals of lowest latency, not negative
  double automatic_percent = 0;  // 50 to 100: the delay follows the arrivals (TruthClock::delay_s()); 0: it does not
};

}  // namespace imud
