#include "protocols/frames/frame_message_seal.hpp"

#include <algorithm>
#include <utility>

namespace imud {

FrameMessageSeal::FrameMessageSeal(std::vector<FrameMessage> messages, FrameEscape escape)
    : messages_(std::move(messages)), escape_(escape) {}

std::span<std::byte> FrameMessageSeal::reseal(std::span<std::byte> frame, const CanHeader&) noexcept {
  for (const FrameMessage& message : messages_) {
    const MessageLayout& layout = *message.layout;
    if (!layout.reseal(frame)) continue;
    // The numbers of a frame with other optional elements are not known.
    const auto [match, size] = layout.match(frame);
    const bool is_known = match == MessageLayout::Match::yes && size == frame.size();
    ReadBack read;
    return !is_known || layout.decode(frame, read) ? frame : std::span<std::byte>();
  }
  return {};
}

std::size_t FrameMessageSeal::open(std::span<const std::byte> line, std::span<std::byte> content) noexcept {
  if (escape_ == FrameEscape::none) return FrameSeal::open(line, content);
  EscapeReader reader(escape_);
  for (std::size_t i = 0; i < line.size(); ++i)
    if (reader.take(line[i])) return i + 1 == line.size() ? FrameSeal::open(reader.content(), content) : 0;
  return 0;
}

std::size_t FrameMessageSeal::close(std::span<const std::byte> content, std::span<std::byte> line) noexcept {
  if (escape_ == FrameEscape::none) return FrameSeal::close(content, line);
  return longest_escaped(escape_, content.size()) <= line.size() ? escape_frame(escape_, content, line) : 0;
}

std::unique_ptr<FrameSeal> seal_of(std::vector<FrameMessage> messages, FrameEscape escape) {
  if (std::ranges::none_of(messages, [](const FrameMessage& message) { return message.layout->has_check(); }))
    return nullptr;
  return std::make_unique<FrameMessageSeal>(std::move(messages), escape);
}

}  // namespace imud
