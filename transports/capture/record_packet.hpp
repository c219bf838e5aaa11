// The packets of a record (imud run --record), as they stand in its pcapng file.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/frame.hpp"
#include "transports/capture/udp_packet.hpp"
#include "transports/endpoint.hpp"

namespace imud {

// The link types of a record's interfaces (https://www.tcpdump.org/linktypes.html).
namespace link_type {
inline constexpr std::uint16_t raw_ip = 101;         // LINKTYPE_RAW: datagrams of truth
inline constexpr std::uint16_t bytes = 147;          // LINKTYPE_USER0: bytes of a stream or of a serial line
inline constexpr std::uint16_t event = 148;          // LINKTYPE_USER1: a RecordEvent
inline constexpr std::uint16_t text = 149;           // LINKTYPE_USER2: a piece of the configuration
inline constexpr std::uint16_t can_socketcan = 227;  // LINKTYPE_CAN_SOCKETCAN
}  // namespace link_type

// The name of the interface that has the events; a file is a record if it has this interface.
inline constexpr std::string_view events_interface = "imud";
inline constexpr std::string_view truth_interface = "truth";
// The name of the interface that has the configuration, TOML with the value of every key, in pieces after `begin`.
inline constexpr std::string_view config_interface = "imud config";

// One action of the sampling thread. A record has these events in the order of the actions. 32 bytes,
// little-endian: u8 type, u8 flags, u16 interface, u32 0, i64 a, i64 b, i64 c. `interface` is the number of the
// imu's own interface, whose frames leave. Host times are in ns of CLOCK_MONOTONIC.
struct RecordEvent {
  enum class Type : std::uint8_t {
    deadlines = 0,  // the devices' deadlines were polled. Not written: later events state until when
    begin = 1,    // of a file. a: what was added to host times for the packets' times; b: number of the file, from 1;
                  // c: version
    power_on,     // of an imu. a: host time
    power_cycle,  // of all imus. a: host time; b: when deadlines were polled last
    truth,        // a record of the truth port was processed. flags: TruthIntake::Outcome; a: time of the truth, if
                  // it was neither ignored nor withheld; b: the watermark
    disconnected,  // the simulator has disconnected from the truth port
    forget_past,   // the truth before the newest was discarded
    run,        // a run of the truth begins, or after a leap goes on. flags: goes_on; b: when deadlines were polled
                // last
    set_clock,  // of an imu. a: device time; b: host time, if has_host_time
    start_samples,  // of an imu
    advance,        // slow imus have integrated the truth up to a
    sample,         // an imu has taken a sample. flags: MotionState::Basis, or at_rest; a: the truth time sampled, or
                    // ns since power on; b: time of the newest truth; c: number on the imu's grid
    transmit,       // the devices have received the samples taken. flags: skipped, whose frames are not sent; a: the
                    // instant, host time; b: when deadlines were polled last
    receive,        // a device receives the next packet of its host. flags: the UART; a: host time
    lost,           // a: number of packets that are missing here
    end,            // of the run. b: when deadlines were polled last
    command,        // a command changed the run. flags: Command::Kind; interface: the imu's own, or all_imus; a: host
                    // time; b: the bits of its value, a double, or, if its kind records none, when deadlines were
                    // polled last; c: its number. The next packet of this interface is the fault, TOML, if it begins
                    // one
    mark,           // as command; the next packet of this interface is its text
  };
  static constexpr std::uint8_t is_live = 1;         // begin: truth was no capture
  static constexpr std::uint8_t input_ended = 1;     // disconnected: the truth's capture has ended
  static constexpr std::uint8_t goes_on = 1;         // run
  static constexpr std::uint8_t has_host_time = 1;   // set_clock
  static constexpr std::uint8_t at_rest = 4;         // sample
  static constexpr std::uint8_t skipped = 1;         // transmit
  static constexpr std::uint16_t all_imus = 0xFFFF;  // command
  // In records of version 1 a run also began after a pause of the simulator; they are repeated as they were made.
  // Records up to version 2 have no event for a truth that a fault withholds.
  static constexpr std::int64_t version = 3, oldest_version = 1;
  static constexpr std::size_t size = 32;

  Type type = Type::begin;
  std::uint8_t flags = 0;
  std::uint16_t interface = 0;
  std::int64_t a = 0, b = 0, c = 0;
};
using RecordEventBytes = std::array<std::byte, RecordEvent::size>;

RecordEventBytes encode_record_event(const RecordEvent& event) noexcept;
// Returns nullopt if the bytes are no event.
std::optional<RecordEvent> decode_record_event(std::span<const std::byte> bytes) noexcept;

// Append a CAN frame as SocketCAN packet, or a datagram with IP and UDP headers that have the known addresses and
// ports: IPv4 if both addresses can be IPv4, otherwise IPv6.
void append_can_packet(std::vector<std::byte>& out, const Frame& frame);
void append_udp_packet(std::vector<std::byte>& out, std::span<const std::byte> payload, const Endpoint& from,
                       const Endpoint& to);
UdpPacket decode_udp_packet(std::span<const std::byte> packet) noexcept;
// Returns the CAN frame of a SocketCAN packet; its data are a view of `packet`. Returns nullopt if the packet is
// no CAN frame.
std::optional<Frame> decode_can_packet(std::span<const std::byte> packet) noexcept;

}  // namespace imud
