#include "protocols/quantities/line_truth_decoder.hpp"

#include <utility>

namespace imud {

void LineTruthDecoder::feed(std::span<const std::byte> bytes, TruthInput input, HostTime) noexcept {
  lines_.feed({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  ends_here_ = input == TruthInput::datagram && (bytes.empty() || bytes.back() != std::byte{'\n'});
}

std::optional<TruthResult> LineTruthDecoder::next(Truth& truth) noexcept {
  while (const auto line = lines_.next()) {
    if (!line->is_too_long()) return decode(line->text, truth);
    ++losses_.too_long;
    losses_.longest = max_line;
  }
  if (std::exchange(is_last_, false)) return decode_last(truth);
  if (!std::exchange(ends_here_, false)) return std::nullopt;
  return decode(lines_.finish_line().text, truth);
}

void LineTruthDecoder::end_of_file() noexcept { is_last_ = lines_.size() > 0 && lines_.size() <= max_line; }

// Decodes the last line, which has no line end. If it is not a whole row, it counts as cut short.
std::optional<TruthResult> LineTruthDecoder::decode_last(Truth& truth) noexcept {
  const auto line = lines_.finish_line();
  const TruthResult result = decode(line.text, truth);
  if (result == TruthResult::ok) {
    ++losses_.last_lines;
    return result;
  }
  if (!is_cut_short(result)) return std::nullopt;
  ++losses_.cut_short;
  losses_.cut_short_by = line.size;
  return std::nullopt;
}

void LineTruthDecoder::finish() noexcept {
  is_last_ = false;
  const std::size_t size = lines_.drop_line();
  if (size == 0) return;
  ++losses_.cut_short;
  losses_.cut_short_by = size;
  if (size > max_line) losses_.longest = max_line;
}

}  // namespace imud
