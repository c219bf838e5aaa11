#include "protocols/wire/message_checksum.hpp"

#include <algorithm>
#include <boost/crc.hpp>
#include <functional>
#include <initializer_list>

#include "core/numbers/number_text.hpp"

namespace imud {
namespace {

using Crc1D = boost::crc_optimal<8, 0x1D, 0, 0, false, false>;
using CrcJ1850 = boost::crc_optimal<8, 0x1D, 0xFF, 0xFF, false, false>;
using CrcH2f = boost::crc_optimal<8, 0x2F, 0xFF, 0xFF, false, false>;
using CrcCcitt = boost::crc_optimal<16, 0x1021, 0xFFFF, 0, false, false>;

struct Profile {
  ChecksumProfile profile;
  std::string_view name;
  unsigned bits = 8;
  unsigned counter_values = 0;
};
constexpr Profile profiles[] = {{ChecksumProfile::none, ""},
                                {ChecksumProfile::j1850, "j1850"},
                                {ChecksumProfile::h2f, "h2f"},
                                {ChecksumProfile::e2e_p01, "e2e_p01", 8, 15},
                                {ChecksumProfile::e2e_p02, "e2e_p02", 8, 16},
                                {ChecksumProfile::e2e_p05, "e2e_p05", 16, 256},
                                {ChecksumProfile::e2e_p11, "e2e_p11", 8, 15},
                                {ChecksumProfile::sum, "sum"},
                                {ChecksumProfile::toyota, "toyota"},
                                {ChecksumProfile::subaru, "subaru"},
                                {ChecksumProfile::tesla, "tesla"},
                                {ChecksumProfile::xor_bytes, "xor"},
                                {ChecksumProfile::honda, "honda", 4},
                                {ChecksumProfile::psa, "psa", 4}};
static_assert(std::ranges::is_sorted(profiles, std::ranges::less_equal{}, &Profile::profile) &&
              std::size(profiles) == static_cast<std::size_t>(ChecksumProfile::psa) + 1);

const Profile& properties_of(ChecksumProfile profile) noexcept { return profiles[static_cast<std::size_t>(profile)]; }

constexpr std::uint16_t largest_nibble_id = 0xFFF;

unsigned halves(unsigned byte) noexcept { return (byte & 0xFU) + (byte >> 4 & 0xFU); }

// Returns the sum of each(byte) over the bytes of the identifier.
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

unsigned MessageChecksum::counter_values() const noexcept { return properties_of(profile).counter_values; }

unsigned MessageChecksum::bits() const noexcept { return properties_of(profile).bits; }

void MessageChecksum::begin_with(std::uint32_t id, bool extended, std::size_t message_size) noexcept {
  const auto whole = [](unsigned byte) { return byte; };
  unsigned sum = start;
  if (profile == ChecksumProfile::toyota) sum += static_cast<unsigned>(message_size) + sum_of_bytes(id, whole);
  if (profile == ChecksumProfile::subaru) sum += sum_of_bytes(id, whole);
  if (profile == ChecksumProfile::tesla) sum += sum_of_bytes(id & 0xFFFFU, whole);
  if (profile == ChecksumProfile::honda) sum += (extended ? 11U : 8U) - sum_of_bytes(id, halves);
  start = static_cast<std::uint8_t>(sum);
}

std::uint16_t MessageChecksum::of(std::span<const std::byte> message, std::size_t at,
                                  unsigned counter) const noexcept {
  const auto low = static_cast<std::uint8_t>(data_id), high = static_cast<std::uint8_t>(data_id >> 8);
  using Bytes = std::initializer_list<std::uint8_t>;
  // Returns the CRC of `first`, all bytes of the message except the checksum itself, and `last`.
  const auto crc_of = [&](auto crc, Bytes first, Bytes last) {
    for (const std::uint8_t byte : first) crc.process_byte(byte);
    crc.process_bytes(message.data(), at);
    const std::span<const std::byte> rest = message.subspan(at + size());
    crc.process_bytes(rest.data(), rest.size());
    for (const std::uint8_t byte : last) crc.process_byte(byte);
    return static_cast<std::uint16_t>(crc.checksum());
  };
  switch (profile) {
    case ChecksumProfile::none:
      break;
    case ChecksumProfile::j1850:
      return crc_of(CrcJ1850(), {}, {});
    case ChecksumProfile::h2f:
      return crc_of(CrcH2f(), {}, {});
    case ChecksumProfile::e2e_p01:
    case ChecksumProfile::e2e_p11:
      if (mode == DataIdMode::both) return crc_of(Crc1D(), {low, high}, {});
      if (mode == DataIdMode::nibble) return crc_of(Crc1D(), {low, 0}, {});
      return crc_of(Crc1D(), {mode == DataIdMode::alt && counter % 2 != 0 ? high : low}, {});
    case ChecksumProfile::e2e_p02:
      return crc_of(CrcH2f(), {}, {data_ids[counter % data_ids.size()]});
    case ChecksumProfile::e2e_p05:
      return crc_of(CrcCcitt(), {}, {low, high});
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
  using Kind = ChecksumProfile;
  constexpr std::string_view modes[] = {"both", "low", "alt", "nibble"};
  const auto* const known = std::ranges::find(profiles, part(text), &Profile::name);
  if (known == std::begin(profiles) || known == std::end(profiles)) return std::nullopt;
  MessageChecksum sum;
  sum.profile = static_cast<ChecksumProfile>(known - std::begin(profiles));
  if (sum.profile == Kind::sum || sum.profile == Kind::xor_bytes || sum.profile == Kind::psa) {
    const std::uint8_t delivered = sum.profile == Kind::psa ? 11 : 0;
    const auto start = text.empty() ? std::optional(delivered) : number_or_hex_in<std::uint8_t>(part(text));
    if (!start) return std::nullopt;
    sum.start = *start;
  } else if (sum.profile == Kind::e2e_p02) {
    const std::string_view digits = part(text);
    if (digits.size() != 2 * sum.data_ids.size()) return std::nullopt;
    for (std::size_t i = 0; i < sum.data_ids.size(); ++i) {
      const auto byte = number_in<std::uint8_t>(digits.substr(2 * i, 2), 16);
      if (!byte) return std::nullopt;
      sum.data_ids[i] = *byte;
    }
  } else if (sum.counter_values() != 0) {
    const auto id = number_or_hex_in<std::uint16_t>(part(text));
    if (!id) return std::nullopt;
    sum.data_id = *id;
    if (sum.profile != Kind::e2e_p05 && !text.empty()) {
      const auto* const mode = std::ranges::find(modes, part(text));
      if (mode == std::end(modes)) return std::nullopt;
      sum.mode = static_cast<DataIdMode>(mode - std::begin(modes));
      if (sum.profile == Kind::e2e_p11 && (sum.mode == DataIdMode::low || sum.mode == DataIdMode::alt))
        return std::nullopt;
      if (sum.mode == DataIdMode::nibble && sum.data_id > largest_nibble_id) return std::nullopt;
    }
  }
  if (!text.empty()) return std::nullopt;
  return sum;
}

}  // namespace imud
