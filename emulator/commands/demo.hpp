// The command `imud demo`: a captured flight becomes a sensor on a pty, and a decoder shows its packets.
#pragma once

#include <optional>

namespace CLI {
class App;
}

namespace imud {

struct DemoOptions {
  std::optional<double> duration_s;  // in real time; nullopt: the whole flight
};

// Adds the command with its options to the command line.
const CLI::App* add_demo_command(CLI::App& app, DemoOptions& options);

// Runs this program and imu-decode, which must be in the same folder. Prints a row of measurements each half second,
// then the reports of both programs. The flight and the configuration are in the installation, or in the source tree
// around the build. Returns the exit code: 1 if one of the programs has failed. Throws OpenError if a file is
// missing.
int demo(const DemoOptions& options);

}  // namespace imud
