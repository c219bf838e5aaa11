#include "protocols/wire/crc.hpp"

#include <algorithm>

#include "protocols/wire/bits.hpp"

namespace imud {
namespace {

// Names, parameters and check values: Cook, Catalogue of parametrised CRC algorithms.
constexpr CrcAlgorithm algorithms[] = {
    {"crc8/smbus", {8, 0x07, 0, false, false, 0}, 0xF4},
    {"crc8/maxim-dow", {8, 0x31, 0, true, true, 0}, 0xA1},
    {"crc8/rohc", {8, 0x07, 0xFF, true, true, 0}, 0xD0},
    {"crc8/sae-j1850", {8, 0x1D, 0xFF, false, false, 0xFF}, 0x4B},
    {"crc8/autosar", {8, 0x2F, 0xFF, false, false, 0xFF}, 0xDF},
    {"crc8/cdma2000", {8, 0x9B, 0xFF, false, false, 0}, 0xDA},
    {"crc8/darc", {8, 0x39, 0, true, true, 0}, 0x15},
    {"crc8/dvb-s2", {8, 0xD5, 0, false, false, 0}, 0xBC},
    {"crc8/tech-3250", {8, 0x1D, 0xFF, true, true, 0}, 0x97},
    {"crc8/i-code", {8, 0x1D, 0xFD, false, false, 0}, 0x7E},
    {"crc8/i-432-1", {8, 0x07, 0, false, false, 0x55}, 0xA1},
    {"crc8/wcdma", {8, 0x9B, 0, true, true, 0}, 0x25},
    {"crc8/lte", {8, 0x9B, 0, false, false, 0}, 0xEA},
    {"crc8/nrsc-5", {8, 0x31, 0xFF, false, false, 0}, 0xF7},
    {"crc8/bluetooth", {8, 0xA7, 0, true, true, 0}, 0x26},
    {"crc8/gsm-a", {8, 0x1D, 0, false, false, 0}, 0x37},
    {"crc8/gsm-b", {8, 0x49, 0, false, false, 0xFF}, 0x94},
    {"crc8/opensafety", {8, 0x2F, 0, false, false, 0}, 0x3E},
    {"crc8/hitag", {8, 0x1D, 0xFF, false, false, 0}, 0xB4},
    {"crc8/mifare-mad", {8, 0x1D, 0xC7, false, false, 0}, 0x99},
    {"crc16/arc", {16, 0x8005, 0, true, true, 0}, 0xBB3D},
    {"crc16/modbus", {16, 0x8005, 0xFFFF, true, true, 0}, 0x4B37},
    {"crc16/usb", {16, 0x8005, 0xFFFF, true, true, 0xFFFF}, 0xB4C8},
    {"crc16/maxim-dow", {16, 0x8005, 0, true, true, 0xFFFF}, 0x44C2},
    {"crc16/umts", {16, 0x8005, 0, false, false, 0}, 0xFEE8},
    {"crc16/cms", {16, 0x8005, 0xFFFF, false, false, 0}, 0xAEE7},
    {"crc16/dds-110", {16, 0x8005, 0x800D, false, false, 0}, 0x9ECF},
    {"crc16/kermit", {16, 0x1021, 0, true, true, 0}, 0x2189},
    {"crc16/xmodem", {16, 0x1021, 0, false, false, 0}, 0x31C3},
    {"crc16/ibm-3740", {16, 0x1021, 0xFFFF, false, false, 0}, 0x29B1},
    {"crc16/spi-fujitsu", {16, 0x1021, 0x1D0F, false, false, 0}, 0xE5CC},
    {"crc16/mcrf4xx", {16, 0x1021, 0xFFFF, true, true, 0}, 0x6F91},
    {"crc16/genibus", {16, 0x1021, 0xFFFF, false, false, 0xFFFF}, 0xD64E},
    {"crc16/ibm-sdlc", {16, 0x1021, 0xFFFF, true, true, 0xFFFF}, 0x906E},
    {"crc16/gsm", {16, 0x1021, 0, false, false, 0xFFFF}, 0xCE3C},
    {"crc16/tms37157", {16, 0x1021, 0x89EC, true, true, 0}, 0x26B1},
    {"crc16/riello", {16, 0x1021, 0xB2AA, true, true, 0}, 0x63D0},
    {"crc16/iso-iec-14443-3-a", {16, 0x1021, 0xC6C6, true, true, 0}, 0xBF05},
    {"crc16/dnp", {16, 0x3D65, 0, true, true, 0xFFFF}, 0xEA82},
    {"crc16/en-13757", {16, 0x3D65, 0, false, false, 0xFFFF}, 0xC2B7},
    {"crc16/t10-dif", {16, 0x8BB7, 0, false, false, 0}, 0xD0DB},
    {"crc16/teledisk", {16, 0xA097, 0, false, false, 0}, 0x0FB3},
    {"crc16/cdma2000", {16, 0xC867, 0xFFFF, false, false, 0}, 0x4C06},
    {"crc16/profibus", {16, 0x1DCF, 0xFFFF, false, false, 0xFFFF}, 0xA819},
    {"crc16/opensafety-a", {16, 0x5935, 0, false, false, 0}, 0x5D38},
    {"crc16/opensafety-b", {16, 0x755B, 0, false, false, 0}, 0x20FE},
    {"crc16/dect-r", {16, 0x0589, 0, false, false, 0x0001}, 0x007E},
    {"crc16/dect-x", {16, 0x0589, 0, false, false, 0}, 0x007F},
    {"crc16/lj1200", {16, 0x6F63, 0, false, false, 0}, 0xBDF4},
    {"crc16/nrsc-5", {16, 0x080B, 0xFFFF, true, true, 0}, 0xA066},
    {"crc16/m17", {16, 0x5935, 0xFFFF, false, false, 0}, 0x772B},
    {"crc24/openpgp", {24, 0x864CFB, 0xB704CE, false, false, 0}, 0x21CF02},
    {"crc24/flexray-a", {24, 0x5D6DCB, 0xFEDCBA, false, false, 0}, 0x7979BD},
    {"crc24/flexray-b", {24, 0x5D6DCB, 0xABCDEF, false, false, 0}, 0x1F23B8},
    {"crc24/interlaken", {24, 0x328B63, 0xFFFFFF, false, false, 0xFFFFFF}, 0xB4F3E6},
    {"crc24/lte-a", {24, 0x864CFB, 0, false, false, 0}, 0xCDE703},
    {"crc24/lte-b", {24, 0x800063, 0, false, false, 0}, 0x23EF52},
    {"crc24/ble", {24, 0x00065B, 0x555555, true, true, 0}, 0xC25A56},
    {"crc24/os-9", {24, 0x800063, 0xFFFFFF, false, false, 0xFFFFFF}, 0x200FA5},
    {"crc32/iso-hdlc", {32, 0x04C11DB7, 0xFFFFFFFF, true, true, 0xFFFFFFFF}, 0xCBF43926},
    {"crc32/iscsi", {32, 0x1EDC6F41, 0xFFFFFFFF, true, true, 0xFFFFFFFF}, 0xE3069283},
    {"crc32/mpeg-2", {32, 0x04C11DB7, 0xFFFFFFFF, false, false, 0}, 0x0376E6E7},
    {"crc32/bzip2", {32, 0x04C11DB7, 0xFFFFFFFF, false, false, 0xFFFFFFFF}, 0xFC891918},
    {"crc32/jamcrc", {32, 0x04C11DB7, 0xFFFFFFFF, true, true, 0}, 0x340BC6D9},
    {"crc32/cksum", {32, 0x04C11DB7, 0, false, false, 0xFFFFFFFF}, 0x765E7680},
    {"crc32/xfer", {32, 0x000000AF, 0, false, false, 0}, 0xBD0BE338},
    {"crc32/aixm", {32, 0x814141AB, 0, false, false, 0}, 0x3010BF7F},
    {"crc32/autosar", {32, 0xF4ACFB13, 0xFFFFFFFF, true, true, 0xFFFFFFFF}, 0x1697D06A},
    {"crc32/base91-d", {32, 0xA833982B, 0xFFFFFFFF, true, true, 0xFFFFFFFF}, 0x87315576},
    {"crc32/cd-rom-edc", {32, 0x8001801B, 0, true, true, 0}, 0x6EC2EDC4},
    {"crc32/mef", {32, 0x741B8CD7, 0xFFFFFFFF, true, true, 0}, 0xD2C22F51},
    {"crc64/xz", {64, 0x42F0E1EBA9EA3693, 0xFFFFFFFFFFFFFFFF, true, true, 0xFFFFFFFFFFFFFFFF}, 0x995DC9BBDF1939FA},
    {"crc64/ecma-182", {64, 0x42F0E1EBA9EA3693, 0, false, false, 0}, 0x6C40DF5F0B497347},
    {"crc64/go-iso", {64, 0x1B, 0xFFFFFFFFFFFFFFFF, true, true, 0xFFFFFFFFFFFFFFFF}, 0xB90956C775A41001},
    {"crc64/we", {64, 0x42F0E1EBA9EA3693, 0xFFFFFFFFFFFFFFFF, false, false, 0xFFFFFFFFFFFFFFFF}, 0x62EC59E3F1A4F00A},
};

constexpr char lower(char c) noexcept { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

}  // namespace

std::span<const CrcAlgorithm> crc_algorithms() noexcept { return algorithms; }

const CrcAlgorithm* find_crc(std::string_view name) noexcept {
  const auto is_named = [name](const CrcAlgorithm& algorithm) {
    std::string_view wanted = algorithm.name, given = name;
    constexpr std::size_t prefix = 3;  // crc
    if (given.size() > wanted.size() && given[prefix] == '-') {
      if (!std::ranges::equal(given.substr(0, prefix), wanted.substr(0, prefix), {}, lower)) return false;
      given.remove_prefix(prefix + 1);
      wanted.remove_prefix(prefix);
    }
    return std::ranges::equal(given, wanted, {}, lower);
  };
  const auto* const found = std::ranges::find_if(algorithms, is_named);
  return found == std::end(algorithms) ? nullptr : found;
}

Crc::Crc(const CrcParameters& parameters) noexcept : parameters_(parameters) {
  const unsigned width = parameters.width;
  start_ = parameters.refin ? reflected(parameters.init, width) : parameters.init;
  const std::uint64_t poly = parameters.refin ? reflected(parameters.poly, width) : parameters.poly;
  for (std::size_t byte = 0; byte < table_.size(); ++byte) {
    std::uint64_t state = parameters.refin ? byte : std::uint64_t{byte} << (width - 8);
    for (int bit = 0; bit < 8; ++bit)
      if (parameters.refin)
        state = state >> 1 ^ ((state & 1U) != 0 ? poly : 0);
      else
        state = state << 1 ^ ((state >> (width - 1) & 1U) != 0 ? poly : 0);
    table_[byte] = state & low_bits(width);
  }
}

std::uint64_t Crc::update(std::uint64_t state, std::span<const std::byte> bytes) const noexcept {
  const unsigned top = parameters_.width - 8;
  if (parameters_.refin) {
    for (const std::byte byte : bytes) state = state >> 8 ^ table_[(state ^ std::to_integer<unsigned>(byte)) & 0xFFU];
    return state;
  }
  for (const std::byte byte : bytes)
    state = state << 8 ^ table_[(state >> top ^ std::to_integer<unsigned>(byte)) & 0xFFU];
  return state & low_bits(parameters_.width);
}

std::uint64_t Crc::finish(std::uint64_t state) const noexcept {
  const bool is_reversed = parameters_.refin != parameters_.refout;
  return (is_reversed ? reflected(state, parameters_.width) : state) ^ parameters_.xorout;
}

}  // namespace imud
