// RFC 9293.
#include "transports/capture/tcp_stream.hpp"

#include <algorithm>
#include <utility>

namespace imud {

TcpSegment tcp_segment(const IpPacket& ip, std::uint16_t port) noexcept {
  using Outcome = TcpSegment::Outcome;
  TcpSegment segment{Outcome::not_ours};
  const auto bytes = ip.payload;
  constexpr std::size_t ports = 4, shortest = 20;
  if (ip.outcome != IpPacket::Outcome::found || ip.protocol != IpPacket::tcp || bytes.size() < ports) return segment;
  segment.from = ip.from;
  segment.to = ip.to;
  segment.from.port = network_u16(bytes, 0);
  segment.to.port = network_u16(bytes, 2);
  const bool is_ours = port != 0 && (segment.from.port == port || segment.to.port == port);
  if (is_ours) segment.outcome = Outcome::truncated;
  if (bytes.size() < shortest) return segment;
  const std::size_t header = (network_u8(bytes, 12) >> 4U) * 4U;
  if (header < shortest || header > bytes.size()) return segment;
  segment.payload = bytes.subspan(header);
  constexpr unsigned fin = 1, syn = 2, rst = 4;
  const unsigned flags = network_u8(bytes, 13);
  segment.begins = (flags & syn) != 0;
  segment.ends = (flags & fin) != 0;
  segment.resets = (flags & rst) != 0;
  segment.sequence = std::uint32_t{network_u16(bytes, 4)} << 16U | network_u16(bytes, 6);
  if (segment.begins) ++segment.sequence;  // SYN counts as a byte
  if (is_ours && !ip.is_fragment && !ip.is_cut) segment.outcome = Outcome::whole;
  return segment;
}

TcpStream::TcpStream() : room_(std::make_unique_for_overwrite<std::byte[]>(most_held * longest)) {}

bool TcpStream::push(const TcpSegment& segment) noexcept {
  const Way way{segment.from, segment.to};
  if (segment.begins) take_handshake(way, segment);
  if (!is_active_ && (segment.payload.empty() || !begin(way, segment))) return false;
  if (way != way_) {
    if (way != way_.reversed() && !segment.payload.empty()) ignore(way);
    return false;
  }
  others_ = 0;
  if (is_ending_) return false;
  if (segment.resets) is_ending_ = true;
  const std::uint32_t end = segment.sequence + static_cast<std::uint32_t>(segment.payload.size());
  if (segment.ends) end_ = end;
  if (ahead(end) <= 0) return segment.ends || !segment.payload.empty();
  if (ahead(segment.sequence) > 0)
    hold(segment);
  else
    current_ = segment.payload.subspan(static_cast<std::size_t>(-std::int64_t{ahead(segment.sequence)}));
  return true;
}

// Called when another connection has sent data. If only other connections have sent data for a while, the end of
// the stream is missing in the capture.
void TcpStream::ignore(const Way& way) noexcept {
  for (Handshake& handshake : handshakes_)
    if (handshake.way == way) handshake = {};  // its begin would be missing in a later stream
  if (++others_ > most_held) is_ending_ = true;
}

// A new connection between the same ports, or after a connection whose last bytes are missing, ends the earlier
// connection.
void TcpStream::take_handshake(const Way& way, const TcpSegment& segment) noexcept {
  const bool is_ours = way == way_ || way == way_.reversed();
  const auto known = std::find_if(handshakes_.begin(), handshakes_.end(),
                                  [&](const Handshake& handshake) { return handshake.way == way; });
  const std::uint32_t before = way == way_ ? first_ : known != handshakes_.end() ? known->first : segment.sequence;
  if (is_active_ && (is_ours ? segment.sequence != before : end_.has_value())) is_ending_ = true;
  if (known != handshakes_.end()) {
    known->first = segment.sequence;
    return;
  }
  handshakes_[next_handshake_] = {way, segment.sequence};
  next_handshake_ = 1 - next_handshake_;
}

// Returns false if the payload repeats bytes of the earlier connection.
bool TcpStream::begin(const Way& way, const TcpSegment& segment) noexcept {
  const auto handshake =
      std::find_if(handshakes_.begin(), handshakes_.end(), [&](const Handshake& known) { return known.way == way; });
  const bool is_known = handshake != handshakes_.end();
  const std::uint32_t end = segment.sequence + static_cast<std::uint32_t>(segment.payload.size());
  if (way == way_ && (!is_known || handshake->first == first_) && ahead(end) <= 0) return false;
  // A capture may begin in the middle of a connection.
  const std::uint32_t first = is_known ? handshake->first : segment.sequence;
  way_ = way;
  first_ = expected_ = first;
  end_.reset();
  is_active_ = begins_ = true;
  others_ = 0;
  return true;
}

void TcpStream::hold(const TcpSegment& segment) noexcept {
  const auto same = std::find_if(held_.begin(), held_.end(), [&](const Held& held) {
    return held.is_used && held.sequence == segment.sequence && held.size >= segment.payload.size();
  });
  if (same != held_.end() || segment.payload.size() > longest) return;
  const auto free = std::find_if(held_.begin(), held_.end(), [](const Held& held) { return !held.is_used; });
  *free = {true, segment.sequence, segment.payload.size()};
  std::copy(segment.payload.begin(), segment.payload.end(),
            room_.get() + static_cast<std::size_t>(free - held_.begin()) * longest);
  ++held_count_;
}

// Continues with the earliest kept segment.
void TcpStream::skip_hole() noexcept {
  std::int32_t nearest = 0;
  for (const Held& held : held_)
    if (held.is_used && (nearest == 0 || ahead(held.sequence) < nearest)) nearest = ahead(held.sequence);
  expected_ += static_cast<std::uint32_t>(nearest);
  ++holes_;
  begins_ = true;
}

std::optional<TcpStream::Piece> TcpStream::next() noexcept {
  if (!current_.empty()) {
    const auto bytes = std::exchange(current_, {});
    expected_ += static_cast<std::uint32_t>(bytes.size());
    return Piece{bytes, std::exchange(begins_, false)};
  }
  while (held_count_ > 0) {
    for (std::size_t i = 0; i < held_.size(); ++i) {
      Held& held = held_[i];
      if (!held.is_used || ahead(held.sequence) > 0) continue;
      held.is_used = false;
      --held_count_;
      const auto known = static_cast<std::size_t>(-std::int64_t{ahead(held.sequence)});
      if (known >= held.size) continue;
      const std::span bytes(room_.get() + i * longest + known, held.size - known);
      expected_ += static_cast<std::uint32_t>(bytes.size());
      return Piece{bytes, std::exchange(begins_, false)};
    }
    if (held_count_ == 0 || (!is_ending_ && held_count_ < most_held)) break;
    skip_hole();
  }
  if (is_active_ && (is_ending_ || (end_ && ahead(*end_) <= 0))) {
    if (end_ && ahead(*end_) > 0) ++holes_;  // the last bytes are missing
    is_active_ = is_ending_ = false;
  }
  return std::nullopt;
}

}  // namespace imud
