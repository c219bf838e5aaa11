// FaultBook: all faults of a run, both configured and begun by control.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "emulator/faults/fault_log.hpp"
#include "emulator/plan/fault_config.hpp"

namespace imud {

// Faults stay where they are, so that a thread may use one while another adds the next. One thread adds: the main
// thread, or the sampling thread where a run is repeated from its record.
class FaultBook {
 public:
  static constexpr std::size_t most_added = 1024;  // in a run

  // `can_grow`: faults may be added. `imus`: the number of imus.
  FaultBook(const std::vector<FaultConfig>& configured, bool can_grow, std::size_t imus)
      : log_(FaultLog::default_size, configured.size() + (can_grow ? most_added : 0), imus), can_grow_(can_grow) {
    if (!configured.empty()) log_.reserve();
    faults_.reserve(configured.size() + (can_grow ? most_added : 0));
    faults_.insert(faults_.end(), configured.begin(), configured.end());
    texts_.reserve(can_grow ? most_added : 0);
    configured_ = configured.size();
    size_ = configured_;
  }
  FaultBook(const FaultBook&) = delete;
  FaultBook& operator=(const FaultBook&) = delete;

  bool can_grow() const noexcept { return can_grow_; }
  std::size_t capacity() const noexcept { return faults_.capacity(); }
  std::span<const FaultConfig> configured() const noexcept { return {faults_.data(), configured_}; }
  FaultLog& log() noexcept { return log_; }
  const FaultLog& log() const noexcept { return log_; }

  // --- Any thread ---
  std::span<const FaultConfig> all() const noexcept {
    return {faults_.data(), size_.load(std::memory_order_acquire)};
  }
  // `number` was returned by add().
  const FaultConfig& operator[](std::uint32_t number) const noexcept { return all()[number]; }
  // The size of the vector may change in add() meanwhile.
  std::string_view text(std::uint32_t number) const noexcept { return *(texts_.data() + (number - configured_)); }

  // --- The thread that adds ---
  bool is_full() const noexcept { return !can_grow_ || faults_.size() == faults_.capacity(); }
  // Returns the number of the fault. `text`: the input of read_fault(), for the record. Must not be called if the
  // book is full.
  std::uint32_t add(FaultConfig fault, std::string text) {
    log_.reserve();
    faults_.push_back(std::move(fault));
    texts_.push_back(std::move(text));
    size_.store(faults_.size(), std::memory_order_release);
    return static_cast<std::uint32_t>(faults_.size() - 1);
  }

 private:
  std::vector<FaultConfig> faults_;
  std::vector<std::string> texts_;  // of the added faults
  std::size_t configured_ = 0;
  std::atomic<std::size_t> size_ = 0;
  FaultLog log_;
  bool can_grow_;
};

}  // namespace imud
