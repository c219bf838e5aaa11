// The library that tools/with-vcan preloads into linux.uml. The library replaces the C library's ptrace().
#include <cpuid.h>
#include <dlfcn.h>

#include "tools/vcan/xstate.hpp"

namespace {

// Intel SDM volume 1, section 13.2: CPUID.(EAX=0DH, ECX=i) describes component i.
imud::XstateLayout layout_of_this_processor() {
  imud::XstateLayout layout{};
  for (unsigned int i = 0; auto& component : layout) {
    unsigned int size = 0, offset = 0, flags = 0, unused = 0;
    constexpr unsigned int supervisor = 1;
    if (i >= 2 && __get_cpuid_count(0xd, i, &size, &offset, &flags, &unused) && (flags & supervisor) == 0)
      component = {offset, size};
    ++i;
  }
  return layout;
}

const imud::XstateLayout layout = layout_of_this_processor();
const auto next_ptrace = reinterpret_cast<long (*)(int, ...)>(::dlsym(RTLD_NEXT, "ptrace"));

long real_ptrace(int request, pid_t pid, void* address, void* data) {
  return next_ptrace(request, pid, address, data);
}

}  // namespace

// <sys/ptrace.h> declares it with "...". On x86 the arguments are passed in the same places either way.
extern "C" long ptrace(int request, pid_t pid, void* address, void* data) noexcept {
  return imud::ptrace_any_xstate(real_ptrace, layout, request, pid, address, data);
}
