// ProgramBuild: what tells two builds of one version of imud apart.
#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace imud {

// Returns the GNU build id of this program in hexadecimal, as `readelf -n` shows it: the linker's digest of the
// program. It is the same on every machine that has the program, and no time is in it. Without a build id: the
// SHA-256 of the program's file. Throws OpenError if that cannot be read. Any thread may call it.
const std::string& program_build();

// Returns the build id, in hexadecimal, in a segment of notes (elf(5), PT_NOTE), whose parts are aligned to so many
// bytes; empty if there is none.
std::string build_id_in(std::span<const std::byte> notes, std::size_t alignment);

}  // namespace imud
