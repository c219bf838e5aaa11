#include "tools/checks/check_rule.hpp"

#include <algorithm>
#include <bit>

#include "protocols/frames/layout/frame_layout.hpp"

namespace imud {
namespace {

bool is_alike(const CrcParameters& a, const CrcParameters& b) noexcept {
  return a.width == b.width && a.poly == b.poly && a.refin == b.refin && a.refout == b.refout;
}

CheckRule plain_rule(CheckRule::Kind kind, std::size_t size, std::size_t word_size, std::vector<std::string> names,
                     bool is_negative = false) {
  CheckRule rule;
  rule.kind = kind;
  rule.size = size;
  rule.word_size = word_size;
  rule.is_negative = is_negative;
  rule.names = std::move(names);
  return rule;
}

}  // namespace

CheckRule crc_rule(const CrcParameters& parameters) {
  CheckRule rule;
  rule.kind = CheckRule::Kind::crc;
  rule.size = parameters.width / 8;
  rule.parameters = parameters;
  rule.parameters.init = rule.parameters.xorout = 0;
  rule.crc.emplace(rule.parameters);
  return rule;
}

std::vector<CheckRule> check_rules() {
  using enum CheckRule::Kind;
  std::vector<CheckRule> rules;
  for (const std::size_t size : {4U, 2U, 1U}) {
    const std::string bits = std::to_string(8 * size);
    for (std::size_t word = size; word > 0; word /= 2) {
      std::string name = "sum" + bits;
      if (word > 1) name += "/" + std::to_string(8 * word);
      rules.push_back(plain_rule(sum, size, word, {name}));
      rules.push_back(plain_rule(sum, size, word, {"-" + name, "~" + name}, true));
    }
    rules.push_back(plain_rule(exclusive_or, size, size, {"xor" + bits, "~xor" + bits}));
  }
  rules.push_back(plain_rule(fletcher, 2, 1, {"fletcher8"}));
  for (const CrcAlgorithm& algorithm : crc_algorithms()) {
    const auto known = std::ranges::find_if(rules, [&](const CheckRule& rule) {
      return rule.kind == crc && rule.zeros == 0 && is_alike(rule.parameters, algorithm.parameters);
    });
    if (known != rules.end()) {
      known->names.emplace_back(algorithm.name);
      continue;
    }
    rules.push_back(crc_rule(algorithm.parameters));
    rules.back().names.emplace_back(algorithm.name);
  }
  // Some products compute the check over padding bytes, up to words of four bytes, that are not sent.
  for (std::size_t i = 0, count = rules.size(); i < count; ++i)
    for (std::size_t zeros = 1; rules[i].kind == crc && rules[i].size == 4 && zeros < 4; ++zeros) {
      rules.push_back(rules[i]);
      rules.back().zeros = zeros;
    }
  // MAVLink's check also covers a byte that is specific to each message and is not sent.
  CheckRule mavlink = crc_rule(find_crc("crc16/mcrf4xx")->parameters);
  mavlink.names = {"crc16/mcrf4xx"};
  mavlink.zeros = 1;
  mavlink.is_extra_known = false;
  rules.push_back(std::move(mavlink));
  return rules;
}

std::uint64_t number_at(std::span<const std::byte> bytes, std::size_t at, std::size_t size, bool is_big) noexcept {
  std::uint64_t number = 0;
  for (std::size_t i = 0; i < size; ++i)
    number = number << 8 | std::to_integer<std::uint64_t>(bytes[at + (is_big ? i : size - 1 - i)]);
  return number;
}

double float_at(std::span<const std::byte> bytes, std::size_t at, std::size_t size, bool is_big) noexcept {
  const std::uint64_t bits = number_at(bytes, at, size, is_big);
  return size == 4 ? double{std::bit_cast<float>(static_cast<std::uint32_t>(bits))} : std::bit_cast<double>(bits);
}

void CheckDifference::add(std::byte one, std::byte other) noexcept {
  if (rule_.kind == CheckRule::Kind::crc) {
    const std::byte difference = one ^ other;
    sum_ = rule_.crc->update(sum_, {&difference, 1});
    return;
  }
  const auto a = std::to_integer<std::uint64_t>(one), b = std::to_integer<std::uint64_t>(other);
  word_ = is_big_ ? word_ << 8 | a : word_ | a << 8 * in_word_;
  other_word_ = is_big_ ? other_word_ << 8 | b : other_word_ | b << 8 * in_word_;
  if (++in_word_ < rule_.word_size) return;
  sum_ = rule_.kind == CheckRule::Kind::exclusive_or ? sum_ ^ word_ ^ other_word_ : sum_ + word_ - other_word_;
  second_ += sum_;
  word_ = other_word_ = 0;
  in_word_ = 0;
}

bool CheckDifference::agrees(std::span<const std::byte> one, std::span<const std::byte> other, std::size_t at,
                             bool is_big) const noexcept {
  if (rule_.kind == CheckRule::Kind::fletcher) {
    const auto differs = [&](std::size_t place, std::uint64_t by) {
      return ((number_at(one, place, 1, true) - number_at(other, place, 1, true) - by) & 0xFFU) != 0;
    };
    return !differs(at, sum_) && !differs(at + 1, second_);
  }
  const std::uint64_t a = number_at(one, at, rule_.size, is_big), b = number_at(other, at, rule_.size, is_big);
  if (rule_.kind == CheckRule::Kind::crc) {
    std::uint64_t state = sum_;
    constexpr std::byte zero{0};
    for (std::size_t i = 0; i < rule_.zeros; ++i) state = rule_.crc->update(state, {&zero, 1});
    return rule_.crc->finish(state) == (a ^ b);
  }
  if (rule_.kind == CheckRule::Kind::exclusive_or)
    return ((sum_ ^ a ^ b) & low_bits(static_cast<unsigned>(8 * rule_.size))) == 0;
  return (((rule_.is_negative ? 0 - sum_ : sum_) - (a - b)) & low_bits(static_cast<unsigned>(8 * rule_.size))) == 0;
}

bool agrees(const CheckRule& rule, std::span<const FrameCheck::Range> ranges, std::size_t at, bool is_big,
            std::span<const std::byte> one, std::span<const std::byte> other) noexcept {
  CheckDifference difference(rule, is_big);
  for (const auto& [begin, end] : ranges)
    for (std::size_t i = begin; i < end; ++i) difference.add(one[i], other[i]);
  return difference.is_whole() && difference.agrees(one, other, at, is_big);
}

}  // namespace imud
