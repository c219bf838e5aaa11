// FrameMessageSeal: recomputes the checks in the messages of a description.
#pragma once

#include <memory>
#include <vector>

#include "protocols/frame_seal.hpp"
#include "protocols/frames/frame_device.hpp"

namespace imud {

// The whole frame is its content: any byte may change, as long as the constants stay and the numbers are finite.
class FrameMessageSeal final : public FrameSeal {
 public:
  FrameMessageSeal(std::vector<FrameMessage> messages, FrameEscape escape);

  std::span<std::byte> reseal(std::span<std::byte> frame, const CanHeader& can) noexcept override;
  std::size_t open(std::span<const std::byte> line, std::span<std::byte> content) noexcept override;
  std::size_t close(std::span<const std::byte> content, std::span<std::byte> line) noexcept override;

 private:
  std::vector<FrameMessage> messages_;
  FrameEscape escape_;
};

// Returns the seal of these messages; nullptr if no message has a check.
std::unique_ptr<FrameSeal> seal_of(std::vector<FrameMessage> messages, FrameEscape escape);

}  // namespace imud
