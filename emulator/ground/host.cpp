#include "emulator/ground/host.hpp"

#include <sched.h>
#include <sys/epoll.h>
#include <sys/prctl.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <thread>

#include "transports/host_clock.hpp"

namespace imud {
namespace {
timespec to_timespec(std::int64_t ns) { return {ns / 1'000'000'000, ns % 1'000'000'000}; }

// In each wait, poll() costs some 1 us for each pty, and epoll costs one more call for all ptys together.
constexpr std::size_t most_polled = 4;

static_assert(EPOLLIN == POLLIN && EPOLLOUT == POLLOUT && EPOLLERR == POLLERR && EPOLLHUP == POLLHUP);
}  // namespace

MonotonicHost::MonotonicHost() noexcept { ::prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL); }

HostTime MonotonicHost::now() noexcept { return host_now(); }

HostTime MonotonicHost::sleep_until(HostTime time, Nanoseconds spin) noexcept {
  const timespec at = to_timespec((time - spin).ns);
  ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr);
  HostTime now = host_now();
  if (spin.count() > 0)
    while (now < time) now = host_now();
  return now;
}

// Uses the shortest of a few readings, which was interrupted least.
Host::Ahead MonotonicHost::ahead(clockid_t clock) noexcept {
  if (clock == CLOCK_MONOTONIC) return {};
  Ahead best{Nanoseconds{0}, Nanoseconds::max()};
  constexpr int readings = 4;
  for (int i = 0; i < readings; ++i) {
    timespec time{};
    const HostTime before = host_now();
    ::clock_gettime(clock, &time);
    const Nanoseconds half = (host_now() - before) / 2;
    const std::int64_t ns = std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
    if (half < best.uncertainty) best = {Nanoseconds{ns - (before + half).ns}, half};
  }
  return best;
}

void MonotonicHost::reserve_inputs(std::size_t count) {
  inputs_.assign(count, {-1, 0, 0});
  ready_.reserve(count);
  epoll_.reset(count > most_polled ? ::epoll_create1(EPOLL_CLOEXEC) : -1);
}

void MonotonicHost::watch(std::size_t input, int descriptor, short events, bool again) noexcept {
  pollfd& own = inputs_[input];
  const pollfd wanted{events != 0 ? descriptor : -1, events, 0};
  if (own.fd == wanted.fd && own.events == wanted.events && !again) return;
  const int before = own.fd;
  own = wanted;
  if (!epoll_) return;
  epoll_event event{static_cast<std::uint32_t>(events), {.u64 = input}};
  if (before >= 0 && before != own.fd) ::epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, before, nullptr);
  if (own.fd < 0) return;
  // The kernel forgets a descriptor that is closed.
  if (::epoll_ctl(epoll_.get(), EPOLL_CTL_MOD, own.fd, &event) == 0 || errno != ENOENT) return;
  if (::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, own.fd, &event) != 0 && errno == EPERM) has_file_ = true;
}

std::span<const Host::Ready> MonotonicHost::wait_for_input(HostTime time, Nanoseconds spin) noexcept {
  // First others on this processor bring the bytes that were sent to their readers.
  if (spin.count() > 0) ::sched_yield();
  HostTime now = host_now();
  for (const HostTime awake = std::min(time, now + spin); now < awake; now = host_now())
    if (const std::span<const Ready> ready = poll_inputs({}); !ready.empty()) return ready;
  return poll_inputs(std::max(time - now, Nanoseconds{0}));
}

std::span<const Host::Ready> MonotonicHost::poll_inputs(Nanoseconds at_most) noexcept {
  ready_.clear();
  pollfd all{epoll_.get(), POLLIN, 0};
  const bool is_direct = !epoll_ || has_file_;
  const std::span<pollfd> polled = is_direct ? std::span(inputs_) : std::span(&all, 1);
  const timespec timeout = to_timespec(at_most.count());
  if (::ppoll(polled.data(), polled.size(), &timeout, nullptr) <= 0) return {};
  if (is_direct) {
    for (std::size_t i = 0; i < inputs_.size(); ++i)
      if (inputs_[i].revents != 0) ready_.push_back({i, inputs_[i].revents});
    return ready_;
  }
  std::array<epoll_event, 64> events;
  const int count =
      ::epoll_wait(epoll_.get(), events.data(), static_cast<int>(std::min(events.size(), inputs_.size())), 0);
  for (int i = 0; i < count; ++i)
    ready_.push_back({events[static_cast<std::size_t>(i)].data.u64,
                      static_cast<short>(events[static_cast<std::size_t>(i)].events)});
  return ready_;
}

unsigned usable_processors() noexcept {
  cpu_set_t usable;  // of at most 1024 processors
  if (::sched_getaffinity(0, sizeof usable, &usable) == 0) return static_cast<unsigned>(CPU_COUNT(&usable));
  return std::max(1U, std::thread::hardware_concurrency());
}

}  // namespace imud
