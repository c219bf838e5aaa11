#include "protocols/frames/layout/frame_escape.hpp"

#include <utility>

namespace imud {
namespace {

constexpr unsigned dle = 0x10, etx = 0x03;

// A framing with one mark at both ends.
struct Marked {
  unsigned mark, escape, mark_code, escape_code;
};
constexpr Marked slip{0xC0, 0xDB, 0xDC, 0xDD}, hdlc{0x7E, 0x7D, 0x5E, 0x5D};

const Marked& marked(FrameEscape escape) noexcept { return escape == FrameEscape::slip ? slip : hdlc; }

std::size_t write_cobs(std::span<const std::byte> content, std::span<std::byte> out) noexcept {
  constexpr unsigned full = 0xFF;
  std::size_t size = 1, code_at = 0;
  unsigned code = 1;
  const auto close = [&] {
    out[code_at] = static_cast<std::byte>(code);
    code_at = size++;
    code = 1;
  };
  for (std::size_t i = 0; i < content.size(); ++i) {
    if (content[i] == std::byte{0}) {
      close();
      continue;
    }
    out[size++] = content[i];
    if (++code == full && i + 1 < content.size()) close();
  }
  out[code_at] = static_cast<std::byte>(code);
  out[size++] = std::byte{0};
  return size;
}

}  // namespace

std::size_t escape_frame(FrameEscape escape, std::span<const std::byte> content, std::span<std::byte> out) noexcept {
  if (escape == FrameEscape::cobs) return write_cobs(content, out);
  std::size_t size = 0;
  const auto put = [&](unsigned byte) { out[size++] = static_cast<std::byte>(byte); };
  if (escape == FrameEscape::dle) {
    put(dle);
    for (const std::byte byte : content) {
      if (byte == std::byte{dle}) put(dle);
      put(std::to_integer<unsigned>(byte));
    }
    put(dle);
    put(etx);
    return size;
  }
  const Marked& by = marked(escape);
  put(by.mark);
  for (const std::byte byte : content) {
    const auto value = std::to_integer<unsigned>(byte);
    if (value == by.mark || value == by.escape) {
      put(by.escape);
      put(value == by.mark ? by.mark_code : by.escape_code);
    } else {
      put(value);
    }
  }
  put(by.mark);
  return size;
}

std::uint64_t EscapeReader::take_skipped() noexcept { return std::exchange(skipped_, 0); }

// Discards what was read since the last frame.
void EscapeReader::fail() noexcept {
  skipped_ += bytes_;
  bytes_ = 0;
  size_ = 0;
  is_open_ = is_escaped_ = false;
}

void EscapeReader::finish() noexcept { fail(); }

void EscapeReader::put(std::byte byte) noexcept {
  if (size_ == held_.size()) return fail();
  held_[size_++] = byte;
}

bool EscapeReader::end() noexcept {
  if (size_ == 0) return false;
  is_ended_ = true;
  frame_bytes_ = std::exchange(bytes_, 0);
  return true;
}

bool EscapeReader::take(std::byte byte) noexcept {
  if (is_ended_) {
    size_ = 0;
    is_ended_ = false;
  }
  ++bytes_;
  const auto value = std::to_integer<unsigned>(byte);
  if (escape_ == FrameEscape::cobs) return take_cobs(value);
  return escape_ == FrameEscape::dle ? take_dle(value) : take_marked(value);
}

// The mark that ends a frame may also begin the next frame.
bool EscapeReader::take_marked(unsigned byte) noexcept {
  const Marked& by = marked(escape_);
  if (byte == by.mark) {
    const bool is_whole = is_open_ && !is_escaped_;
    if (is_whole && size_ > 0) {
      is_open_ = true;
      return end();
    }
    if (!is_whole && bytes_ > 1) {
      --bytes_;
      fail();
    }
    is_open_ = true;
    is_escaped_ = false;
    bytes_ = 0;
    return false;
  }
  if (!is_open_) {
    fail();
  } else if (is_escaped_) {
    is_escaped_ = false;
    if (byte == by.mark_code)
      put(static_cast<std::byte>(by.mark));
    else if (byte == by.escape_code)
      put(static_cast<std::byte>(by.escape));
    else
      fail();
  } else if (byte == by.escape) {
    is_escaped_ = true;
  } else {
    put(static_cast<std::byte>(byte));
  }
  return false;
}

// 10 begins a frame, doubles itself, or ends the frame with 03.
bool EscapeReader::take_dle(unsigned byte) noexcept {
  if (!is_escaped_) {
    if (byte == dle)
      is_escaped_ = true;
    else if (is_open_)
      put(static_cast<std::byte>(byte));
    else
      fail();
    return false;
  }
  is_escaped_ = false;
  if (is_open_ && byte == dle) {
    put(static_cast<std::byte>(dle));
    return false;
  }
  if (is_open_ && byte == etx) {
    is_open_ = false;
    return end();
  }
  if (byte == dle || byte == etx) {
    fail();
    return false;
  }
  // A new frame begins here, even if the frame before was not finished.
  if (bytes_ > 2) {
    bytes_ -= 2;
    fail();
    bytes_ = 2;
  }
  size_ = 0;
  is_open_ = true;
  put(static_cast<std::byte>(byte));
  return false;
}

bool EscapeReader::take_cobs(unsigned byte) noexcept {
  constexpr unsigned full = 0xFF;
  if (byte == 0) {
    const bool is_whole = is_open_ && left_ == 0;
    is_open_ = false;
    if (is_whole && size_ > 0) return end();
    if (bytes_ > 1) fail();
    bytes_ = 0;
    size_ = 0;
    is_skipping_ = false;
    return false;
  }
  if (is_skipping_) return false;
  if (!is_open_) {
    is_open_ = true;
    block_ = full;
    left_ = 0;
  }
  if (left_ > 0) {
    --left_;
    put(static_cast<std::byte>(byte));
    is_skipping_ = !is_open_;
    return false;
  }
  if (block_ != full) put(std::byte{0});
  is_skipping_ = !is_open_;
  block_ = byte;
  left_ = byte - 1;
  return false;
}

}  // namespace imud
