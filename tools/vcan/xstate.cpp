#include "tools/vcan/xstate.hpp"

#include <elf.h>
#include <sys/ptrace.h>
#include <sys/uio.h>

#include <cerrno>
#include <cstring>

namespace imud {
namespace {

// Intel SDM volume 1, section 13.4: the legacy region is followed by the header, which begins with xstate_bv.
constexpr std::size_t xstate_bv_offset = 512;
constexpr std::size_t header_end = 576;
// The components defined so far need a sixth of this. It is not on the stack, because a stack of user-mode-linux has
// 16 KiB.
constexpr std::size_t largest_xstate = 65536;
alignas(64) thread_local std::array<std::byte, largest_xstate> state;

}  // namespace

std::uint64_t components_within(std::size_t length, const XstateLayout& layout) noexcept {
  std::uint64_t bits = 0b11;
  std::uint64_t bit = 1;
  for (const auto& [offset, size] : layout) {
    if (size != 0 && offset + size <= length) bits |= bit;
    bit <<= 1;
  }
  return bits;
}

long ptrace_any_xstate(Ptrace real, const XstateLayout& layout, int request, pid_t pid, void* address,
                       void* data) noexcept {
  const int errno_before = errno;
  const long result = real(request, pid, address, data);
  if (result != -1 || errno != EFAULT || request != PTRACE_SETREGSET ||
      reinterpret_cast<std::uintptr_t>(address) != NT_X86_XSTATE || data == nullptr)
    return result;

  const iovec& given = *static_cast<const iovec*>(data);
  if (given.iov_base == nullptr || given.iov_len < header_end) return result;
  iovec whole{state.data(), state.size()};
  const long got = real(PTRACE_GETREGSET, pid, address, &whole);
  if (got == -1 || whole.iov_len <= given.iov_len || whole.iov_len == state.size()) {
    errno = EFAULT;  // The length was not the reason.
    return -1;
  }
  std::memcpy(state.data(), given.iov_base, given.iov_len);
  std::uint64_t xstate_bv = 0;
  std::memcpy(&xstate_bv, state.data() + xstate_bv_offset, sizeof xstate_bv);
  xstate_bv &= components_within(given.iov_len, layout);
  std::memcpy(state.data() + xstate_bv_offset, &xstate_bv, sizeof xstate_bv);
  const long set = real(PTRACE_SETREGSET, pid, address, &whole);
  if (set != -1) errno = errno_before;
  return set;
}

}  // namespace imud
