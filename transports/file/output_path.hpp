// Outputs that a program is given by name, and standard output: checks, and whole writes.
#pragma once

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace imud {

// Returns the first symbolic link on the way to `path` through which another user could direct an output elsewhere:
// it stands in a folder that its group or others can write, as /tmp, and belongs neither to root nor to `user`.
// Returns an empty text if there is none. Linux' fs.protected_symlinks covers only folders with the sticky bit.
std::string foreign_link(const std::string& path, uid_t user = ::geteuid());
// Returns the refusal of such a path: "LINK is a symbolic link that ...; give another path"; empty if there is none.
std::string foreign_link_fault(const std::string& path);

// Returns true if the path names standard output: `-`, /dev/stdout, ...
bool is_standard_output(const std::string& path);

// Writes all bytes to a file or pipe, and waits for a slow reader. Returns 0, or the errno of the write that has
// failed.
int write_whole(int file, std::span<const std::byte> bytes) noexcept;
// Writes all bytes at an offset of a file. Returns 0, or the errno of the write that has failed.
int write_whole_at(int file, std::span<const std::byte> bytes, std::uint64_t offset) noexcept;

// Writes out what was printed to standard output. Returns 0, or the errno of a write to it that has failed, now or
// before; a reader that has closed its end is no failure.
int flush_standard_output() noexcept;

}  // namespace imud
