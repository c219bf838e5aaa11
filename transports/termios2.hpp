// Any speed of a serial line, also one that termios has no constant for (374400, 1843200).
#pragma once

#include <optional>

namespace imud {

// Sets both directions to `baud` (bit/s) with BOTHER, leaving all else. False, with errno, on failure.
bool set_line_speed(int fd, unsigned baud) noexcept;

// The output speed in bit/s that the driver reports; nullopt if it has none.
std::optional<unsigned> line_speed(int fd) noexcept;

}  // namespace imud
