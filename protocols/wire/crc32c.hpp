// CRC-32C (Castagnoli): polynomial 0x1EDC6F41, reflected, initial value and final complement all ones. Its value for
// the nine bytes "123456789" is 0xE3069283 (RFC 3720, section 12.1 and B.4).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace imud {

std::uint32_t crc32c(std::span<const std::byte> bytes) noexcept;

}  // namespace imud
