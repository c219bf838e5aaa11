// run_loop CONFIG SECONDS: the loop that the host's clock paces, by a simulated clock, with truth at 100 Hz and ports
// that take everything. Fails if a sample is a period late.
#include <cstdlib>

#include "emulator/config/load_config.hpp"
#include "tests/emulator/simulated.hpp"

int main(int argc, char** argv) {
  using namespace imud;
  if (argc != 3) return 2;
  const double until_s = std::atof(argv[2]);
  SimulatedRun run(load_config(argv[1]));
  run.make_sensor = [](SimulatedHost&) { return std::make_unique<NoPort>(); };
  for (int k = 0; k < static_cast<int>(100 * until_s); ++k) {
    Truth truth;
    truth.time = TruthTime{} + k * std::chrono::milliseconds(10);
    truth.sequence = static_cast<std::uint32_t>(k);
    truth.has_specific_force = true;
    run.truth(0.01 * k, truth);
  }
  run.run(until_s);
  return run.counters().samples > 0 && run.counters().missed == 0 ? 0 : 1;
}
