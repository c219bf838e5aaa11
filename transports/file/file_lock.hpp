// lock_file: the lock of a regular file, so that two processes do not write it.
#pragma once

namespace imud {

// Locks an open regular file (flock(2)) until its descriptor is closed. Returns false if another open descriptor has
// locked the file. Returns true without a lock for anything else, and on a file system without locks.
bool lock_file(int file) noexcept;

}  // namespace imud
