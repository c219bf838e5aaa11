// Merges pcapng files by the times of their packets.
#pragma once

#include <atomic>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace imud {

// A file that is merged with others.
struct MergedCapture {
  std::string path;
  std::string prefix;         // goes before the names of its interfaces
  std::uint64_t packets = 0;  // from here on set by merge_pcapng()
  std::string end_warning;    // describes how the file ended if it is damaged
};

// Returns true if the file begins as pcapng.
bool is_pcapng(const std::string& path);

// Writes all packets of `captures` to a file as one section. Each file offers its next packet; the earliest one goes
// first, and of equal times the packet of the first file. mergecap(1) merges in this order. So the packets of a file
// stay in their order. The interfaces of a file follow one another. Returns 0, or the errno of the write that has
// failed; ECANCELED: `stop` was set. Throws PortError if one of them is no pcapng.
int merge_pcapng(std::span<MergedCapture> captures, int file, std::string_view application,
                 const std::atomic<bool>& stop);

}  // namespace imud
