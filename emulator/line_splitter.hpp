// LineSplitter: chunks of a text file in, whole lines out.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace imud {

// A line is whole when its line feed is there: the last line of a file that was cut short is none. All memory is
// taken by the constructor.
class LineSplitter {
 public:
  static constexpr std::size_t max_line = 65536;

  LineSplitter() { rest_.reserve(max_line); }

  // Takes the next chunk, which stays valid until next() has returned nullopt.
  void feed(std::span<const std::byte> chunk) { chunk_ = chunk; }
  // The next whole line without its line feed; nullopt when the chunk is used up. Valid until the next call.
  std::optional<std::span<const std::byte>> next();

  // Bytes after the last line feed.
  std::size_t rest() const { return rest_.size(); }
  // Lines beyond max_line, which were left out.
  std::uint64_t too_long() const { return too_long_; }

 private:
  std::span<const std::byte> chunk_;
  std::vector<std::byte> rest_;
  bool give_rest_ = false;
  bool skipping_ = false;
  std::uint64_t too_long_ = 0;
};

}  // namespace imud
