// The wrapper of ptrace() for user-mode-linux, on hosts of both kinds: simulated ones, and the one at hand with
// states of several lengths.
#include "tools/vcan/xstate.hpp"

#include <dlfcn.h>
#include <elf.h>
#include <gtest/gtest.h>
#include <sys/ptrace.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <span>
#include <stdexcept>
#include <vector>

namespace imud {
namespace {

using Bytes = std::vector<std::byte>;

constexpr std::size_t xstate_bv_offset = 512;
constexpr std::size_t header_end = 576;
constexpr std::size_t uml_length = 2696;
void* const xstate_type = reinterpret_cast<void*>(std::uintptr_t{NT_X86_XSTATE});

// Sapphire Rapids: AVX, opmask, ZMM (two), PKRU, tile configuration, tile data. CPUID has more components (11, 12),
// which are not part of the standard format.
constexpr XstateLayout sapphire_rapids = [] {
  XstateLayout layout{};
  layout[2] = {576, 256};
  layout[5] = {1088, 64};
  layout[6] = {1152, 512};
  layout[7] = {1664, 1024};
  layout[9] = {2688, 8};
  layout[17] = {2752, 64};
  layout[18] = {2816, 8192};
  return layout;
}();
constexpr std::uint64_t up_to_pkru = 0x2e7;

std::uint64_t xstate_bv_of(const Bytes& state) {
  std::uint64_t bits;
  std::memcpy(&bits, state.data() + xstate_bv_offset, sizeof bits);
  return bits;
}
void set_xstate_bv(Bytes& state, std::uint64_t bits) {
  std::memcpy(state.data() + xstate_bv_offset, &bits, sizeof bits);
}

// No byte is 0, or equal to the byte of another `kind` at the same offset.
Bytes pattern(std::size_t size, unsigned int kind) {
  Bytes bytes(size);
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::byte>(1 + (i * 7 + kind * 50) % 251);
  return bytes;
}

struct Call {
  int request;
  pid_t pid;
  void* address;
  void* data;
};

// A kernel as far as the extended state of one process is concerned: x86's xstateregs_get() and xstateregs_set().
struct FakeHost {
  Bytes state;
  std::vector<Call> calls{};
  int get_error = 0;       // of PTRACE_GETREGSET
  int set_error = 0;       // of PTRACE_SETREGSET in the right size
  int other_error = 0;     // of any other request
  long other_result = 42;  // of any other request
};
FakeHost* host = nullptr;

long fail_with(int error) {
  errno = error;
  return -1;
}

long fake_ptrace(int request, pid_t pid, void* address, void* data) {
  host->calls.push_back({request, pid, address, data});
  if (address != xstate_type || (request != PTRACE_SETREGSET && request != PTRACE_GETREGSET))
    return host->other_error != 0 ? fail_with(host->other_error) : host->other_result;
  if (data == nullptr) return fail_with(EFAULT);
  iovec& io = *static_cast<iovec*>(data);
  const std::size_t length = std::min(io.iov_len, host->state.size());
  if (request == PTRACE_GETREGSET) {
    if (host->get_error != 0) return fail_with(host->get_error);
    std::memcpy(io.iov_base, host->state.data(), length);
  } else {
    if (length != host->state.size()) return fail_with(EFAULT);
    if (host->set_error != 0) return fail_with(host->set_error);
    std::memcpy(host->state.data(), io.iov_base, length);
  }
  io.iov_len = length;
  return 0;
}

class XstateTest : public ::testing::Test {
 protected:
  XstateTest() { host = &host_; }

  long call(int request, void* address, void* data) {
    return ptrace_any_xstate(fake_ptrace, sapphire_rapids, request, 1234, address, data);
  }
  long set(Bytes& state) {
    iovec io{state.data(), state.size()};
    const long result = call(PTRACE_SETREGSET, xstate_type, &io);
    EXPECT_EQ(io.iov_base, state.data());
    return result;
  }

  FakeHost host_{pattern(11008, 1)};
};

TEST_F(XstateTest, ComponentsWithinALength) {
  EXPECT_EQ(components_within(576, sapphire_rapids), 0x3u);
  EXPECT_EQ(components_within(831, sapphire_rapids), 0x3u);
  EXPECT_EQ(components_within(832, sapphire_rapids), 0x7u);
  EXPECT_EQ(components_within(2695, sapphire_rapids), 0xe7u);
  EXPECT_EQ(components_within(uml_length, sapphire_rapids), up_to_pkru);
  EXPECT_EQ(components_within(2816, sapphire_rapids), 0x202e7u);
  EXPECT_EQ(components_within(11008, sapphire_rapids), 0x602e7u);
  XstateLayout last{};
  last[63] = {576, 8};
  EXPECT_EQ(components_within(584, last), 0x8000000000000003u);
}

TEST_F(XstateTest, ALargerHostGetsItsWholeState) {
  Bytes given = pattern(uml_length, 2);
  set_xstate_bv(given, 0x602e7);  // as read while the tiles were in use
  const Bytes before = given;
  errno = ENOTTY;
  ASSERT_EQ(set(given), 0);
  EXPECT_EQ(errno, ENOTTY);
  EXPECT_EQ(given, before);
  ASSERT_EQ(host_.calls.size(), 3u);
  for (const Call& call : host_.calls) {
    EXPECT_EQ(call.pid, 1234);
    EXPECT_EQ(call.address, xstate_type);
  }

  ASSERT_EQ(host_.state.size(), 11008u);
  EXPECT_EQ(xstate_bv_of(host_.state), up_to_pkru);
  set_xstate_bv(host_.state, 0x602e7);
  EXPECT_TRUE(std::equal(given.begin(), given.end(), host_.state.begin()));
}

TEST_F(XstateTest, NoBitIsSetThatTheCallerDidNotSet) {
  Bytes given = pattern(uml_length, 2);
  set_xstate_bv(given, 0x201);
  set_xstate_bv(host_.state, 0x602e7);
  ASSERT_EQ(set(given), 0);
  EXPECT_EQ(xstate_bv_of(host_.state), 0x201u);
}

TEST_F(XstateTest, AHostThatTheStateFitsIsAskedOnce) {
  for (const std::size_t size : {std::size_t{832}, std::size_t{2440}, uml_length}) {  // AVX; Zen 4; Ice Lake
    host_ = {pattern(size, 1)};
    Bytes given = pattern(uml_length, 2);
    ASSERT_EQ(set(given), 0);
    ASSERT_EQ(host_.calls.size(), 1u) << size;
    ASSERT_EQ(host_.state.size(), size);
    EXPECT_TRUE(std::equal(host_.state.begin(), host_.state.end(), given.begin()));
  }
}

TEST_F(XstateTest, OtherRequestsPassUntouched) {
  long number = 0;
  Bytes bytes = pattern(uml_length, 2);
  iovec io{bytes.data(), bytes.size()};
  struct {
    int request;
    void* address;
    void* data;
  } const others[] = {
      {PTRACE_SETREGSET, reinterpret_cast<void*>(std::uintptr_t{NT_PRSTATUS}), &io},
      {PTRACE_SYSCALL, nullptr, nullptr},
      {PTRACE_PEEKUSER, reinterpret_cast<void*>(std::uintptr_t{8}), &number},
      {PTRACE_SETFPREGS, nullptr, &number},
      {PTRACE_CONT, xstate_type, &io},
  };
  for (const int error : {0, EFAULT, ESRCH}) {
    for (const auto& [request, address, data] : others) {
      host_.calls.clear();
      host_.other_error = error;
      errno = ENOTTY;
      EXPECT_EQ(call(request, address, data), error == 0 ? 42 : -1);
      EXPECT_EQ(errno, error == 0 ? ENOTTY : error);
      ASSERT_EQ(host_.calls.size(), 1u);
      EXPECT_EQ(host_.calls[0].request, request);
      EXPECT_EQ(host_.calls[0].pid, 1234);
      EXPECT_EQ(host_.calls[0].address, address);
      EXPECT_EQ(host_.calls[0].data, data);
    }
  }
}

TEST_F(XstateTest, AShortGetIsTruncatedByTheHostAlone) {
  Bytes got(uml_length);
  iovec io{got.data(), got.size()};
  EXPECT_EQ(call(PTRACE_GETREGSET, xstate_type, &io), 0);
  EXPECT_EQ(io.iov_len, uml_length);
  EXPECT_TRUE(std::equal(got.begin(), got.end(), host_.state.begin()));
  EXPECT_EQ(host_.calls.size(), 1u);
}

TEST_F(XstateTest, ErrorsPassThrough) {
  Bytes given = pattern(uml_length, 2);
  const auto errno_of_set = [&](std::size_t calls) {
    host_.calls.clear();
    EXPECT_EQ(set(given), -1);
    EXPECT_EQ(host_.calls.size(), calls);
    return errno;
  };
  host_.set_error = EINVAL;  // such as a reserved bit in the header
  EXPECT_EQ(errno_of_set(3), EINVAL);
  host_ = {pattern(uml_length, 1)};
  host_.set_error = ESRCH;
  EXPECT_EQ(errno_of_set(1), ESRCH);
  host_.set_error = EFAULT;  // in the right size: there must be no further attempt
  EXPECT_EQ(errno_of_set(2), EFAULT);
  host_ = {pattern(11008, 1)};
  host_.get_error = ESRCH;
  EXPECT_EQ(errno_of_set(2), EFAULT);
  host_ = {pattern(100'000, 1)};  // larger than the wrapper's buffer
  EXPECT_EQ(errno_of_set(2), EFAULT);
  EXPECT_EQ(host_.state, pattern(100'000, 1));
}

TEST_F(XstateTest, WhatHoldsNoHeaderFailsAsBefore) {
  Bytes given = pattern(header_end - 8, 2);
  EXPECT_EQ(set(given), -1);
  EXPECT_EQ(errno, EFAULT);
  EXPECT_EQ(call(PTRACE_SETREGSET, xstate_type, nullptr), -1);
  EXPECT_EQ(errno, EFAULT);
  iovec nowhere{nullptr, uml_length};
  host_.set_error = EFAULT;
  EXPECT_EQ(call(PTRACE_SETREGSET, xstate_type, &nowhere), -1);
  EXPECT_EQ(errno, EFAULT);
  EXPECT_EQ(host_.calls.size(), 3u);
  EXPECT_EQ(host_.state, pattern(11008, 1));
}

// A process that is stopped for its tracer, this one.
class StoppedProcess {
 public:
  StoppedProcess() : pid_(::fork()) {
    if (pid_ == 0) {
      ::ptrace(PTRACE_TRACEME, 0, nullptr, nullptr);
      ::raise(SIGSTOP);
      ::_exit(0);
    }
    int status = 0;
    ::waitpid(pid_, &status, 0);
    if (pid_ < 0 || !WIFSTOPPED(status)) throw std::runtime_error("no process to trace");
  }
  ~StoppedProcess() {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  StoppedProcess(const StoppedProcess&) = delete;
  StoppedProcess& operator=(const StoppedProcess&) = delete;

  pid_t pid() const { return pid_; }
  Bytes xstate() const {
    Bytes state(65536);
    iovec io{state.data(), state.size()};
    if (::ptrace(PTRACE_GETREGSET, pid_, NT_X86_XSTATE, &io) != 0) throw std::runtime_error("no extended state");
    state.resize(io.iov_len);
    return state;
  }

 private:
  pid_t pid_;
};

// With AVX a processor of any kind has a larger state than a caller that stops after SSE.
TEST(XstatePreload, SetsStatesOfAnyLengthOnThisProcessor) {
  void* const library = ::dlopen(IMUD_BIN_DIR "/libxstate_preload.so", RTLD_NOW | RTLD_LOCAL);
  ASSERT_NE(library, nullptr) << ::dlerror();
  const auto wrapped = reinterpret_cast<decltype(&::ptrace)>(::dlsym(library, "ptrace"));
  ASSERT_NE(wrapped, nullptr);
  ASSERT_NE(wrapped, &::ptrace);

  const StoppedProcess process;
  const std::size_t whole_size = process.xstate().size();
  ASSERT_GE(whole_size, header_end);
  constexpr std::size_t avx_end = 832;
  std::vector<std::size_t> lengths{header_end, whole_size, uml_length};
  if (whole_size >= avx_end) lengths.push_back(avx_end);
  for (const std::size_t length : lengths) {
    // Before, all of SSE and AVX is in use.
    Bytes full = process.xstate();
    std::uint64_t bits = 0b10;
    std::fill(full.begin() + 160, full.begin() + 416, std::byte{0x5a});
    if (whole_size >= avx_end) {
      bits |= 0b100;
      std::fill(full.begin() + header_end, full.begin() + avx_end, std::byte{0xa5});
    }
    set_xstate_bv(full, xstate_bv_of(full) | bits);
    iovec io{full.data(), full.size()};
    ASSERT_EQ(::ptrace(PTRACE_SETREGSET, process.pid(), NT_X86_XSTATE, &io), 0);
    full = process.xstate();
    ASSERT_EQ(xstate_bv_of(full) & bits, bits);

    Bytes given = full;
    given.resize(length);
    // Bits that the kernel refuses: of components that are not covered, supervisor's or not defined.
    if (length < whole_size) set_xstate_bv(given, xstate_bv_of(given) | ~std::uint64_t{0b111});
    const Bytes registers = pattern(256, static_cast<unsigned int>(length));
    std::copy(registers.begin(), registers.end(), given.begin() + 160);
    io = {given.data(), given.size()};
    ASSERT_EQ(wrapped(PTRACE_SETREGSET, process.pid(), NT_X86_XSTATE, &io), 0) << length << " of " << whole_size;

    const Bytes is = process.xstate();
    ASSERT_EQ(is.size(), whole_size);
    EXPECT_TRUE(std::equal(registers.begin(), registers.end(), is.begin() + 160));
    const std::size_t kept = std::min(length, whole_size);
    const auto rest = std::span(is).subspan(header_end);
    EXPECT_TRUE(
        std::ranges::equal(rest.first(kept - header_end), std::span(given).subspan(header_end, kept - header_end)));
    // SSE is in use, AVX only if it was given. Components not in use read as zeros.
    EXPECT_EQ(xstate_bv_of(is) & 0b110, kept >= avx_end ? bits : 0b10) << length << " of " << whole_size;
    if (kept == header_end) {
      const auto avx = rest.first(std::min(whole_size, avx_end) - header_end);
      EXPECT_EQ(std::ranges::count(avx, std::byte{0}), std::ssize(avx));
    }
  }
  ::dlclose(library);
}

}  // namespace
}  // namespace imud
