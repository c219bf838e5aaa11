// Reads [[fault]] and [[expect]] from TOML. Each function adds a fault of the file for everything that is wrong.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "emulator/ground/table_reader.hpp"
#include "emulator/plan/expect_config.hpp"
#include "emulator/plan/fault_config.hpp"
#include "emulator/plan/host_bytes.hpp"

namespace imud {

struct ImuConfig;

// Reads a [[fault]]. `imus`: the names of all imus.
FaultConfig read_fault(TableReader& table, std::size_t index, const std::vector<std::string>& imus);
// Reads `device` of a fault that has settings: FaultConfig::settings of each of its imus (other_unit_reader.cpp).
void read_other_settings(TableReader& table, const std::vector<ImuConfig>& imus, FaultConfig& fault);

// Reads `text` or `hex`, at most 256 bytes (expect_reader.cpp).
HostBytes read_host_bytes(TableReader& table);
// Reads an [[expect]]. `imus`: the names of all imus; `faults`: all faults of the run (expect_reader.cpp).
ExpectConfig read_expect(TableReader& table, std::size_t index, const std::vector<std::string>& imus,
                         std::span<const FaultConfig> faults);

}  // namespace imud
