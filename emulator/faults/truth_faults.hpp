// Truth faults: failures between the simulator and the sensors.
#pragma once

#include <memory>
#include <span>

#include "emulator/faults/fault_log.hpp"
#include "emulator/faults/fault_schedule.hpp"
#include "emulator/plan/fault_config.hpp"
#include "protocols/truth_format.hpp"

namespace imud {

// The faults of a decoder that with_faults() has returned. The decoder's thread uses them.
class TruthFaults {
 public:
  virtual ~TruthFaults() = default;
  virtual FaultSchedule& schedule() noexcept = 0;
  // A run of the truth has begun with the truth of `first`. It need not be called if that truth is marked as the
  // first of a run, or is the first of all.
  virtual void begin_run(TruthTime first) noexcept = 0;
};

// Returns a decoder that applies the faults of truth to the truths of `decoder`; `decoder` itself if there are none.
// Times are truth times since the first truth of the run. Sample numbers count truths. `faults` and `log` must
// outlive the returned decoder. `most`: the number of faults that may be added. `all` is set to the faults of the
// decoder, or to nullptr. A connection that is lost and comes back is no new run. For a truth that a fault delays or
// drops, the decoder's next() returns TruthResult::withheld.
std::unique_ptr<TruthDecoder> with_faults(std::unique_ptr<TruthDecoder> decoder, std::span<const FaultConfig> faults,
                                          std::uint64_t seed, FaultLog& log, std::size_t most, TruthFaults*& all);

}  // namespace imud
