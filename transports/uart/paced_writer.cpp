#include "transports/uart/paced_writer.hpp"

#include <algorithm>
#include <cstdint>

namespace imud {
namespace {

constexpr std::int64_t second = 1'000'000'000;

}  // namespace

HostTime PacedWriter::Queued::received(std::size_t characters) const noexcept {
  const std::int64_t bits = static_cast<std::int64_t>(characters) * line.bits_per_character();
  return begin + Nanoseconds((bits * second + line.baud - 1) / line.baud);
}

std::size_t PacedWriter::Queued::received_by(HostTime now) const noexcept {
  if (now <= begin) return 0;
  if (now >= received(size)) return size;
  return static_cast<std::size_t>((now - begin).count() * line.baud / (second * line.bits_per_character()));
}

void PacedWriter::queue(std::span<const Frame> frames, const UartSettings& line, HostTime now, Nanoseconds max_wait,
                        PortCounters& counters, bool are_replies) noexcept {
  const bool too_late = idle_at_ - now > max_wait;
  for (const Frame& frame : frames) {
    const auto& bytes = frame.bytes;
    if (bytes.empty()) {
      counters.count_sent(are_replies);
      continue;
    }
    if (too_late || frames_ == max_frames || bytes.size() > max_characters - count_) {
      ++counters.dropped;
      continue;
    }
    Queued& added = queue_[(first_frame_ + frames_) % max_frames];
    added = {std::max(now, idle_at_), line, bytes.size(), are_replies};
    idle_at_ = added.received(bytes.size());
    ++frames_;
    const std::size_t at = (first_ + count_) % max_characters;
    const std::size_t before_end = std::min(bytes.size(), max_characters - at);
    std::copy_n(bytes.begin(), before_end, characters_.begin() + static_cast<std::ptrdiff_t>(at));
    std::copy(bytes.begin() + static_cast<std::ptrdiff_t>(before_end), bytes.end(), characters_.begin());
    count_ += bytes.size();
  }
}

void PacedWriter::release(HostTime now) noexcept {
  std::size_t received = 0;
  for (std::size_t i = 0; i < frames_; ++i) {
    const std::size_t of_frame = frame(i).received_by(now);
    received += of_frame;
    if (of_frame < frame(i).size) break;
  }
  received -= std::min(received, of_first_);
  free_ = received == count_ ? received : received - received % fifo;
}

std::span<const std::byte> PacedWriter::ready(HostTime now) noexcept {
  if (free_ == 0) release(now);
  if (free_ == 0) return {};
  std::size_t size = frame(0).size - of_first_;
  for (std::size_t i = 1; i < frames_ && size < free_ && frame(i).line == line(); ++i) size += frame(i).size;
  return {characters_.data() + first_, std::min({size, free_, max_characters - first_})};
}

void PacedWriter::written(std::size_t count, HostTime now, PortCounters& counters) noexcept {
  constexpr Nanoseconds pause = std::chrono::milliseconds(1);
  first_ = (first_ + count) % max_characters;
  count_ -= count;
  free_ -= count;
  of_first_ += count;
  while (frames_ > 0 && of_first_ >= frame(0).size) {
    of_first_ -= frame(0).size;
    counters.count_sent(frame(0).is_reply);
    first_frame_ = (first_frame_ + 1) % max_frames;
    --frames_;
  }
  retry_ = now + pause;
}

std::optional<HostTime> PacedWriter::next_flush() const noexcept {
  if (free_ > 0) return retry_;
  if (frames_ == 0) return std::nullopt;
  std::size_t characters = of_first_ + std::min(fifo, count_);
  for (std::size_t i = 0;; ++i) {
    if (characters <= frame(i).size) return frame(i).received(characters);
    characters -= frame(i).size;
  }
}

void PacedWriter::discard(PortCounters& counters) noexcept {
  counters.dropped += frames_;
  first_ = count_ = first_frame_ = frames_ = of_first_ = free_ = 0;
  idle_at_ = HostTime{};
}

}  // namespace imud
