// The signals at a sensor's synchronisation pins as datagrams: imud receives edges and sends pulses.
//
// | datagram | offset | type | field                                              |
// |----------|--------|------|----------------------------------------------------|
// | edge     | 0      | i64  | simulation time of the edge, ns, little-endian     |
// | pulse    | 0      | i64  | simulation time at which the pulse begins, ns      |
// |          | 8      | i64  | simulation time at which the pulse ends, ns        |
//
// A datagram of any other length is also an edge, without a time.
#pragma once

#include <array>
#include <boost/endian/conversion.hpp>
#include <cstddef>
#include <optional>
#include <span>

#include "core/time.hpp"

namespace imud {

// Returns the time of an edge, or nullopt if the datagram carries none.
inline std::optional<TruthTime> decode_edge(std::span<const std::byte> datagram) noexcept {
  if (datagram.size() != sizeof(TruthTime::ns)) return std::nullopt;
  return TruthTime{boost::endian::load_little_s64(reinterpret_cast<const unsigned char*>(datagram.data()))};
}

inline std::array<std::byte, 16> encode_pulse(TruthTime begin, TruthTime end) noexcept {
  std::array<std::byte, 16> datagram;
  auto* bytes = reinterpret_cast<unsigned char*>(datagram.data());
  boost::endian::store_little_s64(bytes, begin.ns);
  boost::endian::store_little_s64(bytes + 8, end.ns);
  return datagram;
}

}  // namespace imud
