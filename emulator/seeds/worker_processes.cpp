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
#include <csignal>
#include <cstring>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "core/numbers/number_text.hpp"
#include "transports/file/output_path.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {

namespace {

std::atomic<bool> stop = false;
static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<std::size_t>::is_always_lock_free);

// The number of the next item, and the open item of each worker, in memory that all processes share.
class SharedItems {
 public:
  static constexpr std::size_t none = std::numeric_limits<std::size_t>::max();

  SharedItems(std::size_t workers, std::size_t items) : items_(items), size_((1 + workers) * sizeof *numbers_) {
    void* memory = ::mmap(nullptr, size_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) throw std::runtime_error(fmt::format("shared memory: {}", std::strerror(errno)));
    numbers_ = static_cast<std::atomic<std::size_t>*>(memory);
    std::uninitialized_fill_n(numbers_, 1 + workers, none);
    next() = 0;
  }
  ~SharedItems() { ::munmap(numbers_, size_); }
  SharedItems(const SharedItems&) = delete;
  SharedItems& operator=(const SharedItems&) = delete;

  // Returns the next item for the worker of that number; nullopt if there is none. The item is recorded as the
  // worker's open item before it is taken, so that no item is lost if the worker dies at any instant.
  std::optional<std::size_t> take(std::size_t worker) noexcept {
    std::size_t item = next();
    do {
      if (item >= items_) {
        open(worker) = none;  // another worker has taken the last one
        return std::nullopt;
      }
      open(worker) = item;
    } while (!next().compare_exchange_weak(item, item + 1));
    return item;
  }
  std::atomic<std::size_t>& open(std::size_t worker) noexcept { return numbers_[1 + worker]; }
  bool has_next() noexcept { return next() < items_; }
  void end() noexcept { next() = items_; }

 private:
  std::atomic<std::size_t>& next() noexcept { return numbers_[0]; }

  const std::size_t items_, size_;
  std::atomic<std::size_t>* numbers_;
};

bool send_text(int file, std::string_view text) { return write_whole(file, std::as_bytes(std::span(text))) == 0; }

// Runs a worker, which writes lines "ITEM TEXT", or "! CAUSE". `first`: the item that the worker does before
// others.
[[noreturn]] void work(const WorkerProcesses& workers, SharedItems& items, std::size_t number,
                       std::optional<std::size_t> first, int out, pid_t parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(0);  // it has ended before that
  // The memory of an item is kept for the next item, because returning it to the kernel costs a tenth of a run.
  constexpr int kept = 16 * 1024 * 1024;
  ::mallopt(M_MMAP_THRESHOLD, kept);
  ::mallopt(M_TRIM_THRESHOLD, 8 * kept);
  try {
    for (auto item = first ? first : items.take(number); item && !stop; item = items.take(number))
      if (!send_text(out, fmt::format("{} {}\n", *item, workers.work(*item)))) break;
  } catch (const std::exception& error) {
    items.end();
    std::string cause = error.what();
    std::replace(cause.begin(), cause.end(), '\n', ' ');
    send_text(out, fmt::format("! {}\n", cause));
  }
  ::_exit(0);
}

struct Worker {
  pid_t process = 0;
  FileDescriptor in;
  std::string text = {};                 // the part of a line that has come so far
  std::optional<std::size_t> done = {};  // the last item whose text it has sent
};

// Owns the workers. No worker outlives this.
class Workers {
 public:
  Workers(const WorkerProcesses& workers, std::size_t items)
      : workers_(workers), all_(std::min<std::size_t>(workers.jobs, items)), items_(all_.size(), items) {
    try {
      for (std::size_t i = 0; i < all_.size(); ++i) start(i);
    } catch (...) {
      end_all();
      throw;
    }
  }
  ~Workers() { end_all(); }
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  // Takes the texts of the workers, for a fifth of a second at most. Returns false when all have ended.
  bool serve() {
    if (stop)
      for (const Worker& worker : all_)
        if (worker.process > 0) ::kill(worker.process, SIGTERM);
    std::vector<pollfd> ready;
    for (const Worker& worker : all_) ready.push_back({worker.in.get(), POLLIN, 0});  // of an ended one it is -1
    ::poll(ready.data(), ready.size(), 200);
    bool any = false;
    for (std::size_t i = 0; i < all_.size(); ++i) {
      if (ready[i].revents != 0) receive(i);
      any = any || all_[i].process > 0;
    }
    return any;
  }
  // Returns the open items of the workers.
  std::vector<std::size_t> open() noexcept {
    std::vector<std::size_t> open;
    for (std::size_t i = 0; i < all_.size(); ++i)
      if (const std::size_t item = items_.open(i); all_[i].process > 0 && item != SharedItems::none)
        open.push_back(item);
    return open;
  }
  // Begins no further item.
  void begin_no_more() noexcept { items_.end(); }
  const std::string& failure() const noexcept { return failure_; }

 private:
  void start(std::size_t number, std::optional<std::size_t> first = {}) {
    std::array<int, 2> ends{};
    if (::pipe2(ends.data(), O_CLOEXEC) != 0) throw std::runtime_error(fmt::format("pipe: {}", std::strerror(errno)));
    FileDescriptor read(ends[0]), write(ends[1]);
    items_.open(number) = first.value_or(SharedItems::none);
    const pid_t parent = ::getpid(), process = ::fork();
    if (process < 0) throw std::runtime_error(fmt::format("a worker process: {}", std::strerror(errno)));
    if (process == 0) {
      read.reset();  // with a reader left, a worker would wait for room in the pipe of an ended parent
      for (Worker& other : all_) other.in.reset();
      work(workers_, items_, number, first, write.get(), parent);
    }
    all_[number] = {process, std::move(read)};
  }
  void end_all() noexcept {
    const std::vector<std::size_t> last = open();
    for (Worker& worker : all_)
      if (worker.process > 0) {
        ::kill(worker.process, SIGKILL);
        ::waitpid(worker.process, nullptr, 0);
      }
    if (!last.empty()) workers_.at_work(last);
  }

  void receive(std::size_t number) {
    Worker& worker = all_[number];
    std::array<char, 65536> part;
    const ssize_t size = ::read(worker.in.get(), part.data(), part.size());
    if (size < 0) return;
    if (size == 0) return end(number);
    worker.text.append(part.data(), static_cast<std::size_t>(size));
    for (std::size_t at = 0; (at = worker.text.find('\n')) != std::string::npos; worker.text.erase(0, at + 1)) {
      const std::string_view line = std::string_view(worker.text).substr(0, at);
      const std::size_t blank = line.find(' ');
      if (line.front() == '!') {
        if (failure_.empty()) failure_ = line.substr(blank + 1);
        continue;
      }
      const std::size_t item = number_in<std::size_t>(line.substr(0, blank)).value_or(0);
      worker.done = item;
      workers_.take(item, std::string(line.substr(blank + 1)));
    }
  }

  void end(std::size_t number) {
    Worker& worker = all_[number];
    worker.in.reset();
    int status = 0;
    while (::waitpid(worker.process, &status, 0) < 0 && errno == EINTR) {
    }
    worker.process = 0;
    if (const std::size_t item = items_.open(number); item != SharedItems::none) workers_.at_work({item});
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return;
    const std::string cause = WIFSIGNALED(status)
                                  ? fmt::format("a worker process was ended by signal {}", WTERMSIG(status))
                                  : fmt::format("a worker process has ended with {}", WEXITSTATUS(status));
    if (workers_.lose) return replace(number, cause);
    items_.end();
    if (failure_.empty()) failure_ = cause;
  }

  // Starts another worker in place of one that has died.
  void replace(std::size_t number, const std::string& cause) {
    if (stop) return;
    const std::size_t item = items_.open(number);
    const bool is_open = item != SharedItems::none && item != all_[number].done;
    const bool is_lost = is_open && ++deaths_[item] > 1;
    if (is_lost) workers_.lose(item, cause);
    if (is_open && !is_lost)
      start(number, item);
    else if (items_.has_next())
      start(number);
  }

  const WorkerProcesses& workers_;
  std::vector<Worker> all_;
  SharedItems items_;
  std::map<std::size_t, int> deaths_;  // of workers, by their open item
  std::string failure_;
};

}  // namespace

void catch_workers_stop() noexcept {
  stop = false;
  struct sigaction action = {};
  action.sa_handler = [](int) { stop = true; };
  ::sigaction(SIGINT, &action, nullptr);
  ::sigaction(SIGTERM, &action, nullptr);
}

const std::atomic<bool>& workers_stop() noexcept { return stop; }

bool run_workers(const WorkerProcesses& processes, std::size_t items) {
  if (!processes.goes_on) catch_workers_stop();
  Workers workers(processes, items);
  while (workers.serve()) {
    processes.tick();
    processes.at_work(workers.open());
    if (processes.is_enough()) workers.begin_no_more();
  }
  if (!workers.failure().empty()) throw std::runtime_error(workers.failure());
  return !stop;
}

}  // namespace imud
