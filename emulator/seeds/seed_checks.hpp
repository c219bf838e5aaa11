// Checks of the files and ports of replays with many seeds.
#pragma once

#include <string>
#include <string_view>

#include "emulator/plan/config.hpp"
#include "emulator/run/run.hpp"

namespace imud {

// The placeholder of the seed in the imus' ports.
inline constexpr std::string_view seed_placeholder = "{seed}";

// Throws PortError if an option is given that is of a single run: runs beside one another write one summary and one
// file of labels, and no other file of RunOptions.
void refuse_single_run_options(const RunOptions& options);

// Throws PortError if two runs would write to one port, or a port is no file. `repeats`: the runs repeat a record.
// `many`: there are several seeds. `has_arrays`: no port is opened.
void check_seed_ports(const Config& config, bool repeats, bool many, bool has_arrays);

// Throws OpenError if the summary, the labels or the arrays `npy` would be written over a file of the runs, or over
// one another. `npy`: empty if there are no arrays; throws as array_paths().
void check_seed_files(const Config& config, const RunOptions& options, const std::string& npy);

// Returns the origin of the arrays of these runs; empty if the capture can be read only once.
std::string origin_of(const Config& config, const RunOptions& options);

}  // namespace imud
