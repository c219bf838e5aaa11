// RackRecord: merges the records of a rack's runs into one file.
#pragma once

#include <string>
#include <string_view>

namespace imud {

// The record of a run, as the command line of its systemd unit states it.
struct UnitRecord {
  std::string file;       // of `--record`; empty: the run is not recorded
  bool is_split = false;  // `--record-max-mb` is given: the record is FILE-00001.pcapng and so on
};
// `exec_start`: the property ExecStart of the unit, as `systemctl show` has it.
UnitRecord unit_record(std::string_view exec_start);

// Copies the records of all runs from their hosts, and merges them by time into the pcapng file `output`, whose
// interfaces are named HOST/RUN/INTERFACE. Prints which records were merged. Returns 0; 3 if a record is absent or
// damaged and the others are merged; 1 if there is no record: then `output` is left unchanged. Throws ConfigError if
// the rack's file is wrong, and std::runtime_error if `output` cannot be written.
int rack_record(const std::string& path, const std::string& output);

}  // namespace imud
