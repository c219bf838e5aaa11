// ptrace() for a tracer that assumes a shorter extended state of the processor (x87, SSE, AVX, ...) than the host
// has.
//
// Linux accepts PTRACE_SETREGSET of NT_X86_XSTATE in the host's whole size only; a shorter set fails with EFAULT. The
// kernel of Debian 12's user-mode-linux always sets 2696 bytes, which end with PKRU. It therefore cannot run on
// processors with AMX, whose state has 11008 bytes. tools/with-vcan preloads this wrapper into linux.uml.
#pragma once

#include <sys/types.h>

#include <array>
#include <cstddef>
#include <cstdint>

namespace imud {

// ptrace(2) with all of its arguments. Returns -1 and sets errno if it fails.
using Ptrace = long (*)(int request, pid_t pid, void* address, void* data);

// The place of one component in the standard (not compacted) format, in bytes. The size is 0 if it has none.
struct XstateComponent {
  std::uint32_t offset = 0;
  std::uint32_t size = 0;
};
// The index is the component's bit in xstate_bv. Elements 0 and 1 (x87, SSE) are ignored, because these components
// are always in the first 512 bytes.
using XstateLayout = std::array<XstateComponent, 64>;

// Returns the bits of xstate_bv whose components lie within the first `length` bytes. `length` is at least 576, so
// that the header is included.
std::uint64_t components_within(std::size_t length, const XstateLayout& layout) noexcept;

// Calls `real` with these arguments. If they set an extended state that is shorter than the host's, and `real` fails
// for that reason, sets a state of the host's size that begins with the caller's bytes. Components that the caller's
// bytes do not cover return to their initial state. Every other call passes through unchanged, errno included; so
// does a state of less than 576 bytes. `data` and the bytes that it points to must be readable. Any thread may call
// it, but no signal handler.
long ptrace_any_xstate(Ptrace real, const XstateLayout& layout, int request, pid_t pid, void* address,
                       void* data) noexcept;

}  // namespace imud
