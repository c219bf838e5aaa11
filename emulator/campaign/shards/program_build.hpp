// The build identifier of this program, which distinguishes two builds of the same version.
#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace imud {

// Returns the GNU build id of this program in hexadecimal, as `readelf -n` shows it: the linker's digest of the
// program, which is the same on every machine that has this program. If the program has no build id, returns the
// SHA-256 of the program's file. Throws OpenError if this file cannot be read. Any thread may call this.
const std::string& program_build();

// Returns the build id, in hexadecimal, in a segment of notes (elf(5), PT_NOTE); empty if there is none. The parts of
// the segment are aligned to `alignment` bytes.
std::string build_id_in(std::span<const std::byte> notes, std::size_t alignment);

}  // namespace imud
