// Scenario: the faults of a run, and the expectations of its hosts.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/ground/table_reader.hpp"
#include "emulator/plan/config.hpp"

namespace imud {

// Reads the [[fault]] and [[expect]] of a configuration and of the files `scenarios`, whose digests are added to
// the configuration's digest. Requires that the imus and the clock are set. Adds the faults of the scenarios'
// texts to `wrong`.
void read_scenarios(TableReader& table, std::span<const std::string> scenarios, Faults& faults, Config& config,
                    std::vector<std::string>& wrong);

// Returns why a fault cannot begin in a run of this configuration: because of the run's clock, or because the
// run's truth is no record with the host's bytes; empty if the fault can begin.
std::string begin_objection(const FaultConfig& fault, const Config& config);
// Throws ConfigError if faults begin by bytes of the host, but no clock of the host paces the run, and the run
// repeats no record.
void check_begins_by_host(const Config& config, bool repeats);
// Reads a fault that the control protocol begins from its keys, TOML. `number`: the number of the fault. Adds to
// `wrong` the errors of the keys, or why the imus cannot have the fault; adds nothing if the fault is valid.
FaultConfig read_begun_fault(std::string_view text, std::size_t number, std::span<const ImuConfig> imus,
                             std::vector<std::string>& wrong);
// Returns the keys of the configuration's fault of that number, as TOML, without the keys that say when and how often
// it occurs, for read_begun_fault().
std::string text_to_begin(const Config& config, std::size_t number);

}  // namespace imud
