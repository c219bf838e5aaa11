// log_formats: files of measurements that other programs have logged, which imu-decode and imu-allan read as if they
// were a protocol.
#pragma once

#include <span>
#include <string_view>

#include "protocols/protocol.hpp"

namespace imud {

// Entries with a decoder, but no device: they are not in protocols(). The last lines of STEM.cpp here are the entry
// STEM_log_format. Their decoders keep a message in memory, and
// throw std::runtime_error, with the fault and the remedy, if the input is another kind of file.
std::span<const Protocol* const> log_formats() noexcept;
// Returns the log format of that name; nullptr: there is none.
const Protocol* find_log_format(std::string_view name) noexcept;

// Returns the protocol or log format of that name; nullptr: there is none.
const Protocol* find_input_format(std::string_view name) noexcept;

}  // namespace imud
