// TcpStream: puts the segments of captured TCP connections in order.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "transports/capture/ip_packet.hpp"

namespace imud {

struct TcpSegment {
  enum class Outcome : std::uint8_t {
    whole,      // `payload` is the whole payload of the segment; often empty
    truncated,  // a segment from or to the port that is cut short
    not_ours,   // anything else
  } outcome;
  Endpoint from = {}, to = {};                        // valid if the packet is TCP, otherwise their ports are 0
  std::uint32_t sequence = 0;                         // of the first byte of `payload`
  bool begins = false, ends = false, resets = false;  // SYN, FIN, RST
  std::span<const std::byte> payload = {};
};

// Returns the segment in a packet. `port` is at either end of the connection. Any content is safe.
TcpSegment tcp_segment(const IpPacket& ip, std::uint16_t port) noexcept;

// Reassembles one connection after the other, and only one direction of each: the direction of the first payload.
// The next connection, or the rest after a hole, is a new stream. Repeated bytes are dropped. Early segments are
// kept until the bytes before them arrive. Bytes that have not arrived when most_held segments are kept, or when
// the connection ends, are a hole. A connection without an end ends when most_held segments of others follow.
// Allocates in the constructor only.
class TcpStream {
 public:
  static constexpr std::size_t most_held = 64;  // segments

  TcpStream();

  // Adds a segment. Requires Outcome::whole. Returns false if it carries nothing for the stream, such as an
  // acknowledgement, the opposite direction, or another connection at the same time. Before the next push(), call
  // next() until it returns nullopt.
  bool push(const TcpSegment& segment) noexcept;
  // Ends the stream: kept segments follow, as after a hole.
  void finish() noexcept { is_ending_ = is_active_; }

  struct Piece {
    std::span<const std::byte> bytes;  // not empty; valid until the next push()
    bool begins;                       // this piece begins a new stream
  };
  std::optional<Piece> next() noexcept;
  // Returns the sender of the stream.
  const Endpoint& from() const noexcept { return way_.from; }
  std::uint64_t holes() const noexcept { return holes_; }

 private:
  static constexpr std::size_t longest = 65536;  // bytes of a segment
  // A direction of a connection.
  struct Way {
    Endpoint from, to;
    bool operator==(const Way&) const noexcept = default;
    Way reversed() const noexcept { return {to, from}; }
  };
  struct Handshake {
    Way way;
    std::uint32_t first = 0;  // sequence number of its first byte
  };
  struct Held {
    bool is_used = false;
    std::uint32_t sequence = 0;
    std::size_t size = 0;
  };

  void ignore(const Way& way) noexcept;
  void take_handshake(const Way& way, const TcpSegment& segment) noexcept;
  bool begin(const Way& way, const TcpSegment& segment) noexcept;
  void hold(const TcpSegment& segment) noexcept;
  void skip_hole() noexcept;
  // Returns how far `sequence` is ahead of the delivered bytes; negative: behind. Sequence numbers wrap.
  std::int32_t ahead(std::uint32_t sequence) const noexcept {
    return static_cast<std::int32_t>(sequence - expected_);
  }

  bool is_active_ = false;
  bool is_ending_ = false;  // nothing more will come
  bool begins_ = false;     // the next piece begins a stream
  Way way_;
  std::uint32_t first_ = 0, expected_ = 0;  // sequence numbers of the stream's first byte, and of the next one
  std::optional<std::uint32_t> end_;        // of the FIN
  std::span<const std::byte> current_;      // in order, and not delivered yet
  std::array<Handshake, 2> handshakes_;     // the newest of both directions
  std::size_t next_handshake_ = 0;
  std::size_t others_ = 0;  // segments with data of other connections, since the last of the stream
  std::array<Held, most_held> held_;
  std::size_t held_count_ = 0;
  std::unique_ptr<std::byte[]> room_;  // `longest` bytes for each of held_
  std::uint64_t holes_ = 0;
};

}  // namespace imud
