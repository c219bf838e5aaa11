#include "tools/truth/datagram_faults.hpp"

namespace imud {

DatagramFaults::DatagramFaults(const Rates& rates) : rates_(rates), engine_(rates.seed) {}

double DatagramFaults::uniform() { return static_cast<double>(engine_() >> 11U) * 0x1p-53; }

DatagramFaults::Fate DatagramFaults::next(std::size_t size) {
  const auto happens = [this](double percent) { return 100.0 * uniform() < percent; };
  Fate fate;
  fate.drop = happens(rates_.drop_percent);
  fate.duplicate = happens(rates_.duplicate_percent);
  fate.reorder = happens(rates_.reorder_percent);
  fate.corrupt = happens(rates_.corrupt_percent) && size > 0;
  fate.bit = static_cast<std::size_t>(uniform() * static_cast<double>(size * 8));
  fate.delay = Nanoseconds(static_cast<std::int64_t>(uniform() * rates_.jitter_ms * 1e6));
  return fate;
}

}  // namespace imud
