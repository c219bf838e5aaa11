// The names of the files of a record that --record-max-mb splits.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "emulator/record/record_file.hpp"

namespace imud {

// Returns the name of a piece: FILE-00001.pcapng of FILE.pcapng for number 1.
std::string piece_of(const RecordOptions& options, std::uint64_t number);
// Returns the first piece, and the others that exist; none if max_bytes is 0.
std::vector<std::string> pieces_of(const RecordOptions& options);

}  // namespace imud
