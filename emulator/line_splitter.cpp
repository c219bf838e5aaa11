#include "emulator/line_splitter.hpp"

#include <cstring>

namespace imud {

std::optional<std::span<const std::byte>> LineSplitter::next() {
  if (give_rest_) {
    give_rest_ = false;
    rest_.clear();
  }
  while (!chunk_.empty()) {
    const void* at = std::memchr(chunk_.data(), '\n', chunk_.size());
    const std::size_t length =
        at == nullptr ? chunk_.size() : static_cast<std::size_t>(static_cast<const std::byte*>(at) - chunk_.data());
    const std::span<const std::byte> part = chunk_.first(length);
    const bool whole = at != nullptr;
    chunk_ = chunk_.subspan(whole ? length + 1 : length);
    if (skipping_) {
      skipping_ = !whole;
      continue;
    }
    if (rest_.size() + part.size() > max_line) {
      ++too_long_;
      rest_.clear();
      skipping_ = !whole;
      continue;
    }
    if (whole && rest_.empty()) return part;
    rest_.insert(rest_.end(), part.begin(), part.end());
    if (!whole) return std::nullopt;
    give_rest_ = true;
    return std::span<const std::byte>(rest_);
  }
  return std::nullopt;
}

}  // namespace imud
