#include "transports/can/can_filters.hpp"

#include <algorithm>

namespace imud {

void CanFilters::set(std::span<const CanFilter> filters) noexcept {
  filtered_ = filters.size() <= most;
  count_ = filtered_ ? filters.size() : 0;
  std::copy_n(filters.begin(), count_, filters_.begin());
}

bool CanFilters::pass(const CanHeader& header) const noexcept {
  const auto passes = [&](const CanFilter& filter) {
    const bool matches = header.extended == filter.extended && ((header.id ^ filter.id) & filter.mask) == 0 &&
                         (header.remote ? filter.remote : filter.data);
    return matches != filter.inverted;
  };
  return !filtered_ || header.error ||
         std::any_of(filters_.begin(), filters_.begin() + static_cast<std::ptrdiff_t>(count_), passes);
}

}  // namespace imud
