#include "tests/support/locks.hpp"

#include <dlfcn.h>
#include <pthread.h>

#include <atomic>

namespace {

std::atomic<std::uint64_t> taken = 0;
thread_local bool counts = false;

// Calls the replaced function.
template <class Lock>
int count_and_call(std::atomic<int (*)(Lock*)>& known, const char* name, Lock* lock) noexcept {
  if (counts) ++taken;
  auto* function = known.load();
  if (function == nullptr) known = function = reinterpret_cast<int (*)(Lock*)>(::dlsym(RTLD_NEXT, name));
  return function(lock);
}

std::atomic<int (*)(pthread_mutex_t*)> mutex_lock = nullptr;
std::atomic<int (*)(pthread_rwlock_t*)> read_lock = nullptr;
std::atomic<int (*)(pthread_rwlock_t*)> write_lock = nullptr;

}  // namespace

extern "C" {
int pthread_mutex_lock(pthread_mutex_t* lock) noexcept {
  return count_and_call(mutex_lock, "pthread_mutex_lock", lock);
}
int pthread_rwlock_rdlock(pthread_rwlock_t* lock) noexcept {
  return count_and_call(read_lock, "pthread_rwlock_rdlock", lock);
}
int pthread_rwlock_wrlock(pthread_rwlock_t* lock) noexcept {
  return count_and_call(write_lock, "pthread_rwlock_wrlock", lock);
}
}

namespace imud {

void count_locks_of_this_thread() noexcept { counts = true; }
std::uint64_t locks_taken() noexcept { return taken; }

}  // namespace imud
