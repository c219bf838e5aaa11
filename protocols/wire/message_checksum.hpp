// Checksums of CAN messages: plain CRCs, CRCs of the AUTOSAR end-to-end (E2E) profiles, and sums of car makers.
//
// Source: AUTOSAR, Specification of CRC Routines, and PRS_E2EProtocol, as known from other implementations of it; the
// standard's own text was not at hand. The vectors in tests/protocols/message_checksum_test.cpp are from
// independent implementations.
//
// | profile | polynomial, initial value, final XOR | over all bytes but its own, and        | counter  | its bytes |
// |---------|--------------------------------------|----------------------------------------|----------|-----------|
// | j1850   | CRC-8 SAE J1850: 1D, FF, FF          |                                        | any      | 1         |
// | h2f     | CRC-8H2F: 2F, FF, FF                 |                                        | any      | 1         |
// | e2e_p01 | 1D, 00, 00                           | first: data id, as in `DataIdMode`     | 0 to 14  | 1         |
// | e2e_p02 | 2F, FF, FF                           | last: element `counter` of the ids     | 0 to 15  | 1         |
// | e2e_p05 | CRC-16 CCITT-FALSE: 1021, FFFF, 0000 | last: data id, low byte, high byte     | 0 to 255 | 2, Intel  |
// | e2e_p11 | 1D, 00, 00                           | first: data id, both or nibble         | 0 to 14  | 1         |
//
// The sums are from commaai/opendbc at 7343a66 (opendbc/car/toyota/toyotacan.py, honda/hondacan.py,
// subaru/subarucan.py, tesla/teslacan.py, psa/psacan.py, volkswagen/mqbcan.py and mlbcan.py). Its
// chrysler_checksum is j1850.
//
// | profile | over all bits but its own                                                            | bits |
// |---------|--------------------------------------------------------------------------------------|------|
// | sum     | the sum of START and the bytes                                                       | 8    |
// | toyota  | the sum of the bytes of the identifier, the number of bytes, and the bytes           | 8    |
// | subaru  | the sum of the bytes of the identifier, and the bytes                                | 8    |
// | tesla   | the sum of the two low bytes of the identifier, and the bytes                        | 8    |
// | xor     | the exclusive or of START and the bytes (Volkswagen: PQ, with START also MLB)        | 8    |
// | honda   | 8 (29-bit identifiers: 11), less the halves of the bytes of identifier and message   | 4    |
// | psa     | START (default 11), less the halves of the bytes                                     | 4    |
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace imud {

enum class ChecksumProfile : std::uint8_t {
  none,
  j1850,
  h2f,
  e2e_p01,
  e2e_p02,
  e2e_p05,
  e2e_p11,
  sum,
  toyota,
  subaru,
  tesla,
  xor_bytes,
  honda,
  psa
};

// How profiles 1 and 11 include the data id.
enum class DataIdMode : std::uint8_t {
  both,    // low byte, then high byte
  low,     // low byte
  alt,     // low byte if the counter is even, otherwise high byte
  nibble,  // low byte, then 0; bits 8 to 11 of the id, which has 12 bits, are sent beside the counter
};

struct MessageChecksum {
  ChecksumProfile profile = ChecksumProfile::none;
  DataIdMode mode = DataIdMode::both;
  std::uint16_t data_id = 0;
  std::array<std::uint8_t, 16> data_ids = {};  // of profile 2
  std::uint8_t start = 0;                      // of the sums
  bool is_upper_half = false;                  // of a checksum of 4 bits: its place in its byte

  unsigned bits() const noexcept;
  std::size_t size() const noexcept { return bits() > 8 ? 2 : 1; }  // bytes that hold bits of the checksum
  // Adds the profile's inputs other than the message bytes, identifier and size, to `start`. To be called once.
  void begin_with(std::uint32_t id, bool extended, std::size_t message_size) noexcept;
  // The number of values of the counter; 0: as many as its field holds.
  unsigned counter_values() const noexcept;

  // Returns the checksum of `message`. The checksum field begins in byte `at`, and its bits are excluded.
  // `counter` is the value of the message's alive counter.
  std::uint16_t of(std::span<const std::byte> message, std::size_t at, unsigned counter) const noexcept;
};

// Reads "j1850", "h2f", "e2e_p01:ID[:MODE]", "e2e_p02:32 hexadecimal digits", "e2e_p05:ID", "e2e_p11:ID[:MODE]",
// "sum[:START]", "xor[:START]", "psa[:START]", "toyota", "subaru", "tesla" or "honda". Returns nullopt for any
// other text.
std::optional<MessageChecksum> parse_checksum(std::string_view text) noexcept;
inline constexpr std::string_view checksum_syntax =
    "j1850, h2f, e2e_p01:ID:MODE (both, low, alt, or nibble with an ID of up to 0xFFF), "
    "e2e_p02:IDS (16 bytes in hexadecimal), e2e_p05:ID, e2e_p11:ID:MODE (both, or nibble as of e2e_p01), "
    "sum:START, xor:START, psa:START, toyota, subaru, tesla or honda";

}  // namespace imud
