// Sets and reads any speed of a serial line, also speeds without a constant of termios (374400, 1843200).
#pragma once

#include <optional>

namespace imud {

// Sets both directions to `baud` (bit/s) with BOTHER and changes nothing else. Returns false, with errno, on
// failure.
bool set_line_speed(int fd, unsigned baud) noexcept;

// Returns the output speed in bit/s that the driver reports; nullopt if it reports none.
std::optional<unsigned> line_speed(int fd) noexcept;

// Returns true if tcsetattr() has set the output speed by one of termios' constants (B115200). Returns false after
// set_line_speed(), which uses BOTHER.
bool has_speed_constant(int fd) noexcept;

}  // namespace imud
