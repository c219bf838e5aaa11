// The CRC of ISA-L that protocols use, by Boost, for a run_hashes that is cross-compiled: the library of this machine
// is for its own processor.
#include <isa-l/crc.h>

#include <boost/crc.hpp>
#include <cstdint>

extern "C" std::uint32_t crc32_ieee(std::uint32_t init_crc, const unsigned char* buf, std::uint64_t len) {
  boost::crc_optimal<32, 0x04C11DB7> crc(~init_crc);
  crc.process_bytes(buf, len);
  return ~crc.checksum();
}
