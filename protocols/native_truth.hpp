// The native truth datagram, versions 1 and 2, and its acknowledgement. Senders of truth and tests use this
// header; the truth format "native" decodes the datagram.
//
// Version 1, little-endian, 208 bytes:
//
// | offset | type    | field                                                                       |
// |--------|---------|-----------------------------------------------------------------------------|
// | 0      | u8[4]   | `IMUT`                                                                      |
// | 4      | u16     | version, 1                                                                  |
// | 6      | u16     | flags (native_truth_flag)                                                   |
// | 8      | u32     | stream (vehicle)                                                            |
// | 12     | u32     | sequence, +1 per datagram, wraps                                            |
// | 16     | i64     | simulation time, ns                                                         |
// | 24     | f64[3]  | r_BN_N, m                                                                   |
// | 48     | f64[3]  | v_BN_N, m/s                                                                 |
// | 72     | f64[3]  | sigma_BN, MRP of any norm                                                   |
// | 96     | f64[3]  | omega_BN_B, rad/s                                                           |
// | 120    | f64[3]  | omegaDot_BN_B, rad/s^2                                                      |
// | 144    | f64[3]  | specific force of B's origin, in B, m/s^2                                   |
// | 168    | f64[3]  | accumulated non-gravitational velocity of B's origin, m/s                   |
// | 192    | u32     | reserved                                                                    |
// | 196    | u32     | CRC-32C of bytes 0 to 195                                                   |
// | 200    | u8[8]   | reserved                                                                    |
//
// A sender writes 0 to the reserved fields and to the flags that version 1 does not define; a receiver ignores them,
// so that later additions stay compatible. A quantity whose flag is not set is ignored.
//
// Version 2 has the same length, and the same fields up to byte 191. It stamps the simulation time with the time of a
// clock that hosts share:
//
// | offset | type    | field                                                                       |
// |--------|---------|-----------------------------------------------------------------------------|
// | 4      | u16     | version, 2                                                                  |
// | 192    | i64     | when the simulation has this time, ns by that clock                         |
// | 200    | u32     | the clock: 1 CLOCK_TAI, 2 CLOCK_REALTIME, 3 CLOCK_MONOTONIC; 0: no stamp    |
// | 204    | u32     | CRC-32C of bytes 0 to 203                                                   |
//
// A sender computes the stamps: they advance by the same amount as the simulation time, unless the simulation
// pauses or does not run in real time. If a receiver read the clock at each truth instead, the jitter of the
// readings would appear in the motion.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/truth.hpp"

namespace imud {

namespace native_truth_flag {
inline constexpr std::uint16_t angular_acceleration = 1;
inline constexpr std::uint16_t specific_force = 2;
inline constexpr std::uint16_t accumulated_dv_inertial = 4;  // AccumulatedDv::inertial; excludes body_sum
inline constexpr std::uint16_t accumulated_dv_body_sum = 8;  // AccumulatedDv::body_sum
inline constexpr std::uint16_t acknowledge = 16;             // the sender waits for an answer (lockstep)
inline constexpr std::uint16_t new_run = 32;
}  // namespace native_truth_flag

inline constexpr std::size_t native_truth_size = 208;
inline constexpr std::size_t native_acknowledgement_size = 32;

// Writes a datagram, of version 2 if the truth has a stamp; returns its length, native_truth_size.
std::size_t encode_native_truth(const Truth& truth, std::span<std::byte, native_truth_size> datagram) noexcept;

// The answer to a datagram of either version: `IMUA`, u16 version 1, u16 0, then these members in this order.
struct NativeAcknowledgement {
  std::uint32_t stream = 0;
  std::uint32_t sequence = 0;  // of the truth answered
  TruthTime time;              // i64, ns; truth up to this time has been used
  std::uint64_t samples = 0;   // emitted so far in the run
};

// Returns false, with `acknowledgement` unchanged, if size, magic or version of the datagram are wrong.
bool decode_native_acknowledgement(std::span<const std::byte> datagram,
                                   NativeAcknowledgement& acknowledgement) noexcept;

}  // namespace imud
