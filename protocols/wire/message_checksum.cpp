#include "protocols/wire/message_checksum.hpp"

#include <boost/crc.hpp>
#include <charconv>

namespace imud {
namespace {

using Crc1D = boost::crc_optimal<8, 0x1D, 0, 0, false, false>;
using CrcJ1850 = boost::crc_optimal<8, 0x1D, 0xFF, 0xFF, false, false>;
using CrcH2f = boost::crc_optimal<8, 0x2F, 0xFF, 0xFF, false, false>;
using CrcCcitt = boost::crc_optimal<16, 0x1021, 0xFFFF, 0, false, false>;

// Processes all bytes but the `size` bytes from `at`.
template <class Crc>
void process(Crc& crc, std::span<const std::byte> message, std::size_t at, std::size_t size) noexcept {
  crc.process_bytes(message.data(), at);
  const std::span<const std::byte> rest = message.subspan(at + size);
  crc.process_bytes(rest.data(), rest.size());
}

template <class Number>
bool parse_whole(std::string_view text, Number& number, int base) noexcept {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number, base);
  return error == std::errc{} && end == text.data() + text.size();
}

// Reads a number, decimal or hexadecimal.
template <class Number>
bool parse_number(std::string_view text, Number& number) noexcept {
  const bool hexadecimal = text.starts_with("0x") || text.starts_with("0X");
  if (hexadecimal) text.remove_prefix(2);
  return parse_whole(text, number, hexadecimal ? 16 : 10);
}

unsigned halves(unsigned byte) noexcept { return (byte & 0xFU) + (byte >> 4 & 0xFU); }

// The sum of `each` of the bytes of the message and of the identifier.
template <class Each>
unsigned sum_of_bytes(std::uint32_t id, Each each) noexcept {
  return each(id & 0xFFU) + each(id >> 8 & 0xFFU) + each(id >> 16 & 0xFFU) + each(id >> 24);
}

// Removes and returns the text up to the next colon.
std::string_view part(std::string_view& text) noexcept {
  const std::string_view first = text.substr(0, text.find(':'));
  text.remove_prefix(std::min(text.size(), first.size() + 1));
  return first;
}

}  // namespace

unsigned MessageChecksum::counter_values() const noexcept {
  switch (profile) {
    case ChecksumProfile::e2e_p01:
    case ChecksumProfile::e2e_p11:
      return 15;
    case ChecksumProfile::e2e_p02:
      return 16;
    case ChecksumProfile::e2e_p05:
      return 256;
    default:
      return 0;
  }
}

unsigned MessageChecksum::bits() const noexcept {
  switch (profile) {
    case ChecksumProfile::e2e_p05:
      return 16;
    case ChecksumProfile::honda:
    case ChecksumProfile::psa:
      return 4;
    default:
      return 8;
  }
}

void MessageChecksum::begin_with(std::uint32_t id, bool extended, std::size_t message_size) noexcept {
  const auto whole = [](unsigned byte) { return byte; };
  unsigned sum = start;
  switch (profile) {
    case ChecksumProfile::toyota:
      sum += static_cast<unsigned>(message_size) + sum_of_bytes(id, whole);
      break;
    case ChecksumProfile::subaru:
      sum += sum_of_bytes(id, whole);
      break;
    case ChecksumProfile::tesla:
      sum += sum_of_bytes(id & 0xFFFFU, whole);
      break;
    case ChecksumProfile::honda:
      sum += (extended ? 11U : 8U) - sum_of_bytes(id, halves);
      break;
    default:
      break;
  }
  start = static_cast<std::uint8_t>(sum);
}

std::uint16_t MessageChecksum::of(std::span<const std::byte> message, std::size_t at,
                                  unsigned counter) const noexcept {
  const auto low = static_cast<std::uint8_t>(data_id), high = static_cast<std::uint8_t>(data_id >> 8);
  switch (profile) {
    case ChecksumProfile::none:
      break;
    case ChecksumProfile::j1850: {
      CrcJ1850 crc;
      process(crc, message, at, 1);
      return static_cast<std::uint16_t>(crc.checksum());
    }
    case ChecksumProfile::h2f: {
      CrcH2f crc;
      process(crc, message, at, 1);
      return static_cast<std::uint16_t>(crc.checksum());
    }
    case ChecksumProfile::e2e_p01:
    case ChecksumProfile::e2e_p11: {
      Crc1D crc;
      crc.process_byte(mode == DataIdMode::alt && counter % 2 != 0 ? high : low);
      if (mode == DataIdMode::both) crc.process_byte(high);
      if (mode == DataIdMode::nibble) crc.process_byte(0);
      process(crc, message, at, 1);
      return static_cast<std::uint16_t>(crc.checksum());
    }
    case ChecksumProfile::e2e_p02: {
      CrcH2f crc;
      process(crc, message, at, 1);
      crc.process_byte(data_ids[counter % data_ids.size()]);
      return static_cast<std::uint16_t>(crc.checksum());
    }
    case ChecksumProfile::e2e_p05: {
      CrcCcitt crc;
      process(crc, message, at, 2);
      crc.process_byte(low);
      crc.process_byte(high);
      return static_cast<std::uint16_t>(crc.checksum());
    }
    case ChecksumProfile::sum:
    case ChecksumProfile::toyota:
    case ChecksumProfile::subaru:
    case ChecksumProfile::tesla:
    case ChecksumProfile::xor_bytes: {
      unsigned sum = start;
      for (std::size_t i = 0; i < message.size(); ++i) {
        const auto byte = i == at ? 0U : std::to_integer<unsigned>(message[i]);
        sum = profile == ChecksumProfile::xor_bytes ? sum ^ byte : sum + byte;
      }
      return static_cast<std::uint16_t>(sum & 0xFFU);
    }
    case ChecksumProfile::honda:
    case ChecksumProfile::psa: {
      unsigned sum = start;
      for (std::size_t i = 0; i < message.size(); ++i)
        sum -= halves(std::to_integer<unsigned>(message[i]) & (i != at ? 0xFFU : is_upper_half ? 0x0FU : 0xF0U));
      return static_cast<std::uint16_t>(sum & 0xFU);
    }
  }
  return 0;
}

std::optional<MessageChecksum> parse_checksum(std::string_view text) noexcept {
  constexpr std::string_view names[] = {"j1850",  "h2f",    "e2e_p01", "e2e_p02", "e2e_p05", "e2e_p11", "sum",
                                        "toyota", "subaru", "tesla",   "xor",     "honda",   "psa"};
  constexpr std::string_view modes[] = {"both", "low", "alt", "nibble"};
  const std::string_view name = part(text);
  MessageChecksum sum;
  for (std::size_t i = 0; i < std::size(names); ++i)
    if (name == names[i]) sum.profile = static_cast<ChecksumProfile>(i + 1);
  switch (sum.profile) {
    case ChecksumProfile::none:
      return std::nullopt;
    case ChecksumProfile::j1850:
    case ChecksumProfile::h2f:
    case ChecksumProfile::toyota:
    case ChecksumProfile::subaru:
    case ChecksumProfile::tesla:
    case ChecksumProfile::honda:
      break;
    case ChecksumProfile::sum:
    case ChecksumProfile::xor_bytes:
    case ChecksumProfile::psa:
      sum.start = sum.profile == ChecksumProfile::psa ? 11 : 0;
      if (!text.empty() && !parse_number(part(text), sum.start)) return std::nullopt;
      break;
    case ChecksumProfile::e2e_p02: {
      const std::string_view digits = part(text);
      if (digits.size() != 2 * sum.data_ids.size()) return std::nullopt;
      for (std::size_t i = 0; i < sum.data_ids.size(); ++i)
        if (!parse_whole(digits.substr(2 * i, 2), sum.data_ids[i], 16)) return std::nullopt;
      break;
    }
    default: {
      if (!parse_number(part(text), sum.data_id)) return std::nullopt;
      if (sum.profile == ChecksumProfile::e2e_p05 || text.empty()) break;
      const std::string_view mode = part(text);
      std::size_t found = std::size(modes);
      for (std::size_t i = 0; i < std::size(modes); ++i)
        if (mode == modes[i]) found = i;
      if (found == std::size(modes)) return std::nullopt;
      sum.mode = static_cast<DataIdMode>(found);
      if (sum.profile == ChecksumProfile::e2e_p11 && (sum.mode == DataIdMode::low || sum.mode == DataIdMode::alt))
        return std::nullopt;
    }
  }
  if (!text.empty()) return std::nullopt;
  return sum;
}

}  // namespace imud
