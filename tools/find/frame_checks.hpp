// FrameChecks: tells whole frames of a found message from damaged ones.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "tools/find/frame_finder.hpp"

namespace imud {

class FrameChecks {
 public:
  // Takes the first form of each check of `message`.
  explicit FrameChecks(const FoundMessage& message);

  // Returns true if all checks agree; true for a message without checks. `frame` has the message's length.
  bool hold(std::span<const std::byte> frame) const;

 private:
  struct Check {
    FrameCheck check;
    std::vector<FrameCheck::Range> ranges;
    std::vector<std::byte> extra;
    std::size_t at, size;
    bool is_big;
  };
  std::vector<Check> checks_;
  bool are_known_ = true;
};

}  // namespace imud
