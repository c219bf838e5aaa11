// Truth faults: what goes wrong between the simulator and the sensors.
#pragma once

#include <memory>
#include <span>

#include "emulator/faults/fault_config.hpp"
#include "emulator/faults/fault_log.hpp"
#include "emulator/faults/fault_schedule.hpp"
#include "protocols/truth_format.hpp"

namespace imud {

// Returns a decoder that applies the faults of truth to what `decoder` decodes; `decoder` itself if there are none.
// Times are those of the truth, from the first of its run; sample numbers count truths. `faults` and `log` must
// outlive it. `most`: the number of faults that may be added to `schedule`, which is set to that of the decoder, or
// to nullptr, and has the thread of the decoder.
std::unique_ptr<TruthDecoder> with_faults(std::unique_ptr<TruthDecoder> decoder, std::span<const FaultConfig> faults,
                                          std::uint64_t seed, FaultLog& log, std::size_t most,
                                          FaultSchedule*& schedule);

}  // namespace imud
