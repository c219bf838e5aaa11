// RackRecord: the records of a rack's runs as one.
#pragma once

#include <string>
#include <string_view>

namespace imud {

// The record of a run, from the command line of its unit.
struct UnitRecord {
  std::string file;       // of `--record`; empty: the run is not recorded
  bool is_split = false;  // `--record-max-mb` is given: the record is FILE-00001.pcapng and so on
};
// `exec_start`: the property ExecStart of the unit, as `systemctl show` has it.
UnitRecord unit_record(std::string_view exec_start);

// Copies the records of all runs from their hosts, and merges them by time to the pcapng file `output`. Its
// interfaces are HOST/RUN/INTERFACE. Prints what was merged. Returns 0; 3 if a record is absent or damaged, and the
// others are merged; 1 if there is none, or the file could not be written: then it stays as it was. Throws
// ConfigError if the rack's file is wrong.
int rack_record(const std::string& path, const std::string& output);

}  // namespace imud
