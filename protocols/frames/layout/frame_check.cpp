#include "protocols/frames/layout/frame_check.hpp"

#include <algorithm>

#include "core/numbers/number_text.hpp"

namespace imud {
namespace {

// Returns the bytes of a width in bits, 8 to 64.
std::optional<std::size_t> bytes_in(std::string_view text) noexcept {
  const auto bits = number_in<unsigned>(text);
  if (!bits || *bits == 0 || *bits > 64 || *bits % 8 != 0) return std::nullopt;
  return *bits / 8;
}

bool is_power(std::size_t size) noexcept { return size == 1 || size == 2 || size == 4 || size == 8; }

}  // namespace

std::optional<FrameCheck> FrameCheck::find(std::string_view name, std::span<const FrameDescription::Check> own) {
  FrameCheck check;
  const CrcAlgorithm* known = find_crc(name);
  const auto described = std::ranges::find(own, name, &FrameDescription::Check::name);
  if (described != own.end() || known != nullptr) {
    check.kind_ = Kind::crc;
    check.crc_.emplace(described != own.end() ? described->parameters : known->parameters);
    check.size_ = check.crc_->width() / 8;
    return check;
  }
  if (name == "fletcher8") {
    check.kind_ = Kind::fletcher;
    check.size_ = 2;
    return check;
  }
  if (name.starts_with('-')) check.sign_ = Sign::negative;
  if (name.starts_with('~')) check.sign_ = Sign::complement;
  if (check.sign_ != Sign::plain) name.remove_prefix(1);
  const bool is_sum = name.starts_with("sum");
  if (!is_sum && !name.starts_with("xor")) return std::nullopt;
  name.remove_prefix(3);
  const std::size_t slash = name.find('/');
  const auto size = bytes_in(name.substr(0, slash));
  if (!size) return std::nullopt;
  check.size_ = *size;
  if (!is_sum) {
    check.kind_ = Kind::exclusive_or;
    check.word_size_ = *size;
  }
  if (slash != name.npos) {
    const auto word = bytes_in(name.substr(slash + 1));
    if (!word || !is_power(*word)) return std::nullopt;
    check.word_size_ = *word;
  }
  return check;
}

std::vector<std::string> FrameCheck::names(std::span<const FrameDescription::Check> own) {
  std::vector<std::string> all = {"sum8",   "sum16",     "sum16/16", "sum32", "sum32/16", "sum32/32", "-sum8",
                                  "-sum16", "-sum16/16", "~sum8",    "xor8",  "xor16",    "xor32",    "fletcher8"};
  for (const FrameDescription::Check& one : own) all.push_back(one.name);
  for (const CrcAlgorithm& one : crc_algorithms()) all.emplace_back(one.name);
  return all;
}

std::uint64_t FrameCheck::of(std::span<const std::byte> frame, std::span<const Range> ranges,
                             std::span<const std::byte> extra, bool is_big) const noexcept {
  if (kind_ == Kind::crc) {
    std::uint64_t state = crc_->start();
    for (const auto& [begin, end] : ranges) state = crc_->update(state, frame.subspan(begin, end - begin));
    return crc_->finish(crc_->update(state, extra));
  }
  // The bytes of a word may lie in two ranges.
  std::uint64_t sum = 0, second = 0, word = 0;
  std::size_t in_word = 0;
  const auto add = [&](std::span<const std::byte> bytes) {
    for (const std::byte byte : bytes) {
      const auto number = std::to_integer<std::uint64_t>(byte);
      word = is_big ? word << 8 | number : word | number << 8 * in_word;
      if (++in_word < word_size_) continue;
      sum = kind_ == Kind::exclusive_or ? sum ^ word : sum + word;
      second += sum;
      word = 0;
      in_word = 0;
    }
  };
  for (const auto& [begin, end] : ranges) add(frame.subspan(begin, end - begin));
  add(extra);
  if (kind_ == Kind::fletcher)
    return is_big ? (sum & 0xFFU) << 8 | (second & 0xFFU) : (second & 0xFFU) << 8 | (sum & 0xFFU);
  return sign_ == Sign::negative ? 0 - sum : sign_ == Sign::complement ? ~sum : sum;
}

}  // namespace imud
