#include "emulator/rack/rack_page.hpp"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>

#include "emulator/rack/rack_status.hpp"
#include "emulator/web/status_page.hpp"
#include "transports/host_clock.hpp"

namespace imud {

namespace {

using namespace std::chrono_literals;

// Asks the hosts in its own thread, so that a host which does not answer delays no page. Any thread may call text().
class RackWatch {
 public:
  explicit RackWatch(const Rack& rack) : rack_(rack), thread_([this] { watch(); }) {}
  ~RackWatch() {
    {
      const std::lock_guard lock(mutex_);
      stop_ = true;
    }
    changed_.notify_all();
    thread_.join();
  }
  RackWatch(const RackWatch&) = delete;
  RackWatch& operator=(const RackWatch&) = delete;

  // Returns the newest status as JSON, with its age in seconds; null before the first status.
  std::string text() {
    const std::lock_guard lock(mutex_);
    wanted_ = host_now();
    changed_.notify_all();
    if (status_.is_null()) return "null\n";
    status_["age_s"] = seconds(*wanted_ - asked_);
    return status_.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
  }

 private:
  static constexpr Nanoseconds pause = 2s;     // from an answer to the next question
  static constexpr Nanoseconds is_seen = 10s;  // the hosts are asked for this time after a page has read the status

  void watch() {
    std::unique_lock lock(mutex_);
    while (!stop_) {
      if (wanted_ && host_now() - *wanted_ < is_seen) {
        lock.unlock();
        Json status = ask();
        lock.lock();
        status_ = std::move(status);
        asked_ = host_now();
        changed_.wait_for(lock, pause, [this] { return stop_.load(); });
      } else {
        changed_.wait(lock);
      }
    }
  }

  Json ask() const {
    try {
      return rack_status(rack_, stop_);
    } catch (const std::exception& error) {  // such as too many open files
      return {
          {"rack", rack_.file}, {"good", false}, {"hosts", Json::array()}, {"remarks", Json::array({error.what()})}};
    }
  }

  const Rack& rack_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::atomic<bool> stop_ = false;
  std::optional<HostTime> wanted_;
  HostTime asked_;
  Json status_;
  std::thread thread_;  // last: it uses the others
};

}  // namespace

int serve_rack(const std::string& path, const WebConfig& web) {
  const Rack rack = read_rack(path);
  RackWatch watch(rack);
  serve_status(
      web, rack_page_files(), [&watch] { return watch.text(); }, path);
  return 0;
}

}  // namespace imud
