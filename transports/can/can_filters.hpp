// CanFilters: the identifiers that a port receives.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "core/frame.hpp"

namespace imud {

// Implements Port::set_filters() for ports for which the kernel does not filter. Used by one thread.
class CanFilters {
 public:
  static constexpr std::size_t most = 64;
  void set(std::span<const CanFilter> filters) noexcept;
  bool pass(const CanHeader& header) const noexcept;

 private:
  std::array<CanFilter, most> filters_{};
  std::size_t count_ = 0;
  bool filtered_ = false;
};

}  // namespace imud
