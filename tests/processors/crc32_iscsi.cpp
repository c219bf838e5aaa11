// ISA-L's function for run_hashes, which is built without ISA-L.
#include <boost/crc.hpp>

extern "C" unsigned crc32_iscsi(unsigned char* bytes, int size, unsigned seed) {
  boost::crc_optimal<32, 0x1EDC6F41, 0, 0, true, true> crc(seed);
  crc.process_bytes(bytes, static_cast<std::size_t>(size));
  return crc.checksum();
}
