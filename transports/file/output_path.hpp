// Checks the paths of a program's outputs, and writes to files and standard output without loss.
#pragma once

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace imud {

// Returns the first symbolic link on the way to `path` through which another user could direct an output
// elsewhere: neither root nor `user` owns the link, and the folder's group or other users can write the folder of
// the link, such as /tmp. Returns an empty text if there is no such link. Linux' own protection,
// fs.protected_symlinks, covers only folders with the sticky bit.
std::string foreign_link(const std::string& path, uid_t user = ::geteuid());
// Returns the error message for a path with a foreign_link(): "LINK is a symbolic link that ...; give another
// path"; empty if the path has no such link.
std::string foreign_link_fault(const std::string& path);

// Returns true if the path names standard output: `-`, /dev/stdout, ...
bool is_standard_output(const std::string& path);

// Writes all bytes to a file or pipe, and waits for a slow reader. Returns 0, or the errno of the write that has
// failed.
int write_whole(int file, std::span<const std::byte> bytes) noexcept;
// Writes all bytes at an offset of a file. Returns 0, or the errno of the write that has failed.
int write_whole_at(int file, std::span<const std::byte> bytes, std::uint64_t offset) noexcept;

// Opens /dev/null in place of each standard stream that is closed. Otherwise the next file or socket that is opened
// is taken for the stream: what is printed goes into it, and who reads standard input waits for it.
void open_closed_streams() noexcept;

// Flushes standard output. Returns 0, or the errno of a write to standard output that has failed in this call or
// before. A pipe whose reader has closed its end is no failure.
int flush_standard_output() noexcept;

}  // namespace imud
