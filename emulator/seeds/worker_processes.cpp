#include "emulator/seeds/worker_processes.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <malloc.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstring>
#include <new>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "transports/file_descriptor.hpp"

namespace imud {

namespace {

std::atomic<bool> stop = false;
static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<std::size_t>::is_always_lock_free);

// The number of the next item, in memory that all processes share.
class NextItem {
 public:
  NextItem() {
    void* memory =
        ::mmap(nullptr, sizeof(std::atomic<std::size_t>), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) throw std::runtime_error(fmt::format("shared memory: {}", std::strerror(errno)));
    next_ = new (memory) std::atomic<std::size_t>(0);
  }
  ~NextItem() { ::munmap(next_, sizeof *next_); }
  NextItem(const NextItem&) = delete;
  NextItem& operator=(const NextItem&) = delete;
  std::size_t take() noexcept { return next_->fetch_add(1); }
  void end(std::size_t items) noexcept { next_->store(items); }

 private:
  std::atomic<std::size_t>* next_;
};

bool write_all(int file, std::string_view text) {
  while (!text.empty()) {
    const ssize_t size = ::write(file, text.data(), text.size());
    if (size < 0 && errno == EINTR) continue;
    if (size < 0) return false;
    text.remove_prefix(static_cast<std::size_t>(size));
  }
  return true;
}

// The life of a worker: lines "ITEM TEXT", or "! CAUSE".
[[noreturn]] void work(const WorkerProcesses& workers, NextItem& next, std::size_t items, int out) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  // The memory of an item is kept for the next: returning it to the kernel costs a tenth of a run.
  constexpr int kept = 16 * 1024 * 1024;
  ::mallopt(M_MMAP_THRESHOLD, kept);
  ::mallopt(M_TRIM_THRESHOLD, 8 * kept);
  try {
    for (std::size_t item = next.take(); item < items && !stop; item = next.take())
      if (!write_all(out, fmt::format("{} {}\n", item, workers.work(item)))) break;
  } catch (const std::exception& error) {
    next.end(items);
    std::string cause = error.what();
    std::replace(cause.begin(), cause.end(), '\n', ' ');
    write_all(out, fmt::format("! {}\n", cause));
  }
  ::_exit(0);
}

struct Worker {
  pid_t process = 0;
  FileDescriptor in;
  std::string text;  // that is not a whole line yet
};

void catch_signals() {
  stop = false;
  struct sigaction action = {};
  action.sa_handler = [](int) { stop = true; };
  ::sigaction(SIGINT, &action, nullptr);
  ::sigaction(SIGTERM, &action, nullptr);
}

// Owns the workers: none outlives it.
class Workers {
 public:
  Workers(const WorkerProcesses& workers, std::size_t items) : workers_(workers), items_(items) {
    for (std::size_t i = 0; i < std::min<std::size_t>(workers.jobs, items); ++i) {
      std::array<int, 2> ends{};
      if (::pipe2(ends.data(), O_CLOEXEC) != 0)
        throw std::runtime_error(fmt::format("pipe: {}", std::strerror(errno)));
      FileDescriptor read(ends[0]), write(ends[1]);
      const pid_t process = ::fork();
      if (process < 0) throw std::runtime_error(fmt::format("a worker process: {}", std::strerror(errno)));
      if (process == 0) work(workers_, next_, items_, write.get());
      all_.push_back({process, std::move(read), {}});
    }
  }
  ~Workers() {
    for (Worker& worker : all_)
      if (worker.process > 0) {
        ::kill(worker.process, SIGKILL);
        ::waitpid(worker.process, nullptr, 0);
      }
  }
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  // Takes the texts of the workers, for a fifth of a second at most. Returns false when all have ended.
  bool serve() {
    if (stop)
      for (const Worker& worker : all_)
        if (worker.process > 0) ::kill(worker.process, SIGTERM);
    std::vector<pollfd> ready;
    for (const Worker& worker : all_) ready.push_back({worker.in.get(), POLLIN, 0});
    ::poll(ready.data(), ready.size(), 200);
    bool any = false;
    for (std::size_t i = 0; i < all_.size(); ++i) {
      if (ready[i].revents != 0) receive(all_[i]);
      any = any || all_[i].process > 0;
    }
    return any;
  }
  const std::string& failure() const noexcept { return failure_; }

 private:
  void receive(Worker& worker) {
    std::array<char, 65536> part;
    const ssize_t size = ::read(worker.in.get(), part.data(), part.size());
    if (size < 0) return;
    if (size == 0) return end(worker);
    worker.text.append(part.data(), static_cast<std::size_t>(size));
    for (std::size_t at = 0; (at = worker.text.find('\n')) != std::string::npos; worker.text.erase(0, at + 1)) {
      const std::string_view line = std::string_view(worker.text).substr(0, at);
      const std::size_t blank = line.find(' ');
      if (line.front() == '!') {
        if (failure_.empty()) failure_ = line.substr(blank + 1);
        continue;
      }
      std::size_t item = 0;
      std::from_chars(line.data(), line.data() + blank, item);
      workers_.take(item, std::string(line.substr(blank + 1)));
    }
  }

  void end(Worker& worker) {
    worker.in.reset();
    int status = 0;
    while (::waitpid(worker.process, &status, 0) < 0 && errno == EINTR) {
    }
    worker.process = 0;
    if (!WIFSIGNALED(status)) return;
    next_.end(items_);
    if (failure_.empty()) failure_ = fmt::format("a worker process was ended by signal {}", WTERMSIG(status));
  }

  const WorkerProcesses& workers_;
  const std::size_t items_;
  NextItem next_;
  std::vector<Worker> all_;
  std::string failure_;
};

}  // namespace

const std::atomic<bool>& workers_stop() noexcept { return stop; }

bool run_workers(const WorkerProcesses& processes, std::size_t items) {
  catch_signals();
  Workers workers(processes, items);
  while (workers.serve()) processes.tick();
  if (!workers.failure().empty()) throw std::runtime_error(workers.failure());
  return !stop;
}

}  // namespace imud
