// FaultBook: all faults of a run, those that are configured and those that begin by control.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "emulator/faults/fault_config.hpp"
#include "emulator/faults/fault_log.hpp"

namespace imud {

// Faults stay where they are, so that the sampling thread may use one while the main thread adds the next.
class FaultBook {
 public:
  static constexpr std::size_t most_added = 1024;  // in a run

  // `can_grow`: faults may be added.
  FaultBook(const std::vector<FaultConfig>& configured, bool can_grow)
      : log_(configured.empty() && !can_grow ? 0 : FaultLog::default_size), can_grow_(can_grow) {
    faults_.reserve(configured.size() + (can_grow ? most_added : 0));
    faults_.insert(faults_.end(), configured.begin(), configured.end());
    configured_ = configured.size();
  }
  FaultBook(const FaultBook&) = delete;
  FaultBook& operator=(const FaultBook&) = delete;

  bool can_grow() const noexcept { return can_grow_; }
  std::size_t capacity() const noexcept { return faults_.capacity(); }
  std::span<const FaultConfig> configured() const noexcept { return {faults_.data(), configured_}; }
  FaultLog& log() noexcept { return log_; }
  const FaultLog& log() const noexcept { return log_; }

  // --- Main thread ---
  std::span<const FaultConfig> all() const noexcept { return faults_; }
  bool is_full() const noexcept { return !can_grow_ || faults_.size() == faults_.capacity(); }
  // Returns the number of the fault. Must not be called if the book is full.
  std::uint32_t add(FaultConfig fault) {
    faults_.push_back(std::move(fault));
    return static_cast<std::uint32_t>(faults_.size() - 1);
  }

  // --- Sampling thread ---
  // `number` was returned by add().
  const FaultConfig& operator[](std::uint32_t number) const noexcept { return faults_.data()[number]; }

 private:
  std::vector<FaultConfig> faults_;
  std::size_t configured_ = 0;
  FaultLog log_;
  bool can_grow_;
};

}  // namespace imud
