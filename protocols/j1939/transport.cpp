#include "protocols/j1939/transport.hpp"

#include <algorithm>

#include "protocols/wire/deadlines.hpp"

namespace imud::j1939 {
namespace {

// Returns a TP.CM: the control byte, four bytes whose meaning depends on it, and the parameter group number of the
// transferred message.
constexpr std::uint64_t control_word(Control control, std::uint32_t content, std::uint32_t pgn) noexcept {
  return std::uint64_t{control} | std::uint64_t{content} << 8 | std::uint64_t{pgn} << 40;
}
// Returns the content of an RTS, a BAM or an end of message. `packets_at_once`: most packets for a CTS.
constexpr std::uint32_t announced(std::size_t size, unsigned packets, unsigned packets_at_once) noexcept {
  return static_cast<std::uint32_t>(size) | packets << 16 | packets_at_once << 24;
}

}  // namespace

template <class Each>
void Transport::for_each(Each&& each) noexcept {
  for (Session& session : incoming_)
    if (session.is_active) each(session);
  for (Session& session : outgoing_)
    if (session.is_active) each(session);
}

void Transport::clear() noexcept {
  for_each([](Session& session) { session.is_active = false; });
}

void Transport::control(const Session& session, std::uint64_t content, std::uint8_t own,
                        FrameBuffer& out) const noexcept {
  j1939::send({transfer_priority, pgn::transfer_control, session.peer, own}, content, out);
}

void Transport::abort(std::uint8_t peer, std::uint32_t pgn, Abort reason, std::uint8_t own,
                      FrameBuffer& out) noexcept {
  ++(reason == Abort::timeout ? timed_out_ : aborted_);
  if (peer == everyone) return;
  const std::uint32_t content = 0xFFFF'FF00U | static_cast<std::uint32_t>(reason);
  j1939::send({transfer_priority, pgn::transfer_control, peer, own}, control_word(abort_connection, content, pgn),
              out);
}

void Transport::end(Session& session, Abort reason, std::uint8_t own, FrameBuffer& out) noexcept {
  session.is_active = false;
  abort(session.to_everyone ? everyone : session.peer, session.pgn, reason, own, out);
}

Transport::Session* Transport::outgoing(std::uint8_t destination) noexcept {
  for (Session& session : outgoing_)
    if (session.is_active && !session.is_waiting && session.peer == destination) return &session;
  return nullptr;
}

bool Transport::send(std::uint32_t pgn, std::uint8_t destination, Data data, std::uint8_t own, DeviceTime now,
                     FrameBuffer& out) noexcept {
  const bool has_peer = outgoing(destination) != nullptr;
  const auto free = std::ranges::find(outgoing_, false, &Session::is_active);
  if (free == outgoing_.end() || (has_peer && destination != everyone)) return false;
  for (const Session& session : outgoing_)
    if (session.is_active && session.peer == everyone && destination == everyone && session.pgn == pgn)
      return true;  // everyone receives it anyway
  *free = Session{};
  free->is_active = true;
  free->pgn = pgn;
  free->peer = destination;
  free->to_everyone = destination == everyone;
  free->size = data.size();
  free->packets = static_cast<unsigned>((data.size() + packet_size - 1) / packet_size);
  free->data = data;
  if (free->to_everyone) {
    free->is_waiting = has_peer;
    if (!has_peer) begin_broadcast(*free, own, now, out);
    return true;
  }
  control(*free, control_word(request_to_send, announced(free->size, free->packets, 255), pgn), own, out);
  free->due = now + t3;
  return true;
}

void Transport::begin_broadcast(Session& session, std::uint8_t own, DeviceTime now, FrameBuffer& out) noexcept {
  session.is_waiting = false;
  control(session, control_word(broadcast_announce, announced(session.size, session.packets, 255), session.pgn), own,
          out);
  session.due = now + broadcast_gap;
}

void Transport::send_packet(Session& session, std::uint8_t own, FrameBuffer& out) const noexcept {
  std::array<std::byte, 8> packet;
  packet.fill(std::byte{0xFF});
  packet[0] = static_cast<std::byte>(session.next);
  const std::size_t begin = (session.next - 1) * packet_size;
  std::ranges::copy(session.data.subspan(begin, std::min(packet_size, session.size - begin)), packet.begin() + 1);
  j1939::send({transfer_priority, pgn::transfer_data, session.peer, own}, packet, out);
  ++session.next;
}

void Transport::on_clear_to_send(Session& session, const Message& message, std::uint8_t own, DeviceTime now,
                                 FrameBuffer& out) noexcept {
  const unsigned count = message[1], first = message[2];
  if (count == 0) {
    session.due = now + t4;
    return;
  }
  if (first < 1 || first > session.packets) return end(session, Abort::bad_sequence, own, out);
  if (first < session.next && ++session.repetitions > max_repetitions)
    return end(session, Abort::retransmissions, own, out);
  session.next = first;
  for (unsigned i = 0; i < count && session.next <= session.packets; ++i) send_packet(session, own, out);
  session.due = now + t3;
}

Transport::Session* Transport::incoming(std::uint8_t source, bool to_everyone) noexcept {
  for (Session& session : incoming_)
    if (session.is_active && session.peer == source && session.to_everyone == to_everyone) return &session;
  return nullptr;
}

// Requests the packets from the next one on, by CTS.
void Transport::request_packets(Session& session, std::uint8_t own, DeviceTime now, FrameBuffer& out) const noexcept {
  const unsigned count = std::min(session.at_once, session.packets - session.next + 1);
  control(session, control_word(clear_to_send, count | session.next << 8 | 0xFFFF'0000U, session.pgn), own, out);
  session.due = now + t2;
}

// Processes an RTS or a BAM. A second one from the same node replaces the first.
void Transport::open(const Message& message, std::uint8_t own, DeviceTime now, FrameBuffer& out) noexcept {
  const std::uint8_t source = message.header.source;
  const bool to_everyone = message[0] == broadcast_announce;
  const std::uint32_t pgn = message.number_at(5);
  Session* session = incoming(source, to_everyone);
  if (session != nullptr && session->pgn != pgn && !to_everyone) return abort(source, pgn, Abort::busy, own, out);
  const std::size_t size = message[1] | std::size_t{message[2]} << 8;
  const unsigned packets = message[3];
  const bool is_possible =
      size > 8 && packets == (size + packet_size - 1) / packet_size && (to_everyone || message[4] != 0);
  if (session == nullptr) {
    const auto free = std::ranges::find(incoming_, false, &Session::is_active);
    if (free != incoming_.end()) session = &*free;
  }
  if (pgn != accepted_ || !is_possible || size > max_size || session == nullptr) {
    if (session != nullptr) session->is_active = false;
    if (!to_everyone) abort(source, pgn, Abort::resources, own, out);
    return;
  }
  *session = Session{};
  session->is_active = true;
  session->pgn = pgn;
  session->peer = source;
  session->to_everyone = to_everyone;
  session->size = size;
  session->packets = packets;
  session->at_once = message[4];
  session->due = now + t1;
  if (!to_everyone) request_packets(*session, own, now, out);
}

std::optional<Data> Transport::on_data(const Message& message, std::uint8_t own, DeviceTime now,
                                       FrameBuffer& out) noexcept {
  Session* const session = incoming(message.header.source, message.header.destination == everyone);
  if (session == nullptr) return std::nullopt;
  const unsigned sequence = message[0];
  if (sequence + 1 == session->next) return std::nullopt;  // a packet that was sent twice
  if (sequence != session->next || message.data.size() != 8) {
    end(*session, Abort::bad_sequence, own, out);
    return std::nullopt;
  }
  const std::size_t begin = (sequence - 1) * packet_size;
  std::ranges::copy(message.data.subspan(1, std::min(packet_size, session->size - begin)),
                    session->buffer.begin() + static_cast<std::ptrdiff_t>(begin));
  session->due = now + t1;
  if (session->next++ < session->packets) {
    if (!session->to_everyone && sequence % session->at_once == 0) request_packets(*session, own, now, out);
    return std::nullopt;
  }
  session->is_active = false;
  if (!session->to_everyone)
    control(*session, control_word(end_of_message, announced(session->size, session->packets, 255), session->pgn),
            own, out);
  return std::span(session->buffer).first(session->size);
}

void Transport::on_control(const Message& message, std::uint8_t own, DeviceTime now, FrameBuffer& out) noexcept {
  const bool is_mine = message.header.destination == own && own != null_address;
  const std::uint8_t source = message.header.source;
  const std::uint32_t pgn = message.number_at(5);
  if (message.data.size() != 8) return;
  Session* const sent = is_mine ? outgoing(source) : nullptr;
  const bool is_of_sent = sent != nullptr && sent->pgn == pgn;
  switch (message[0]) {
    case request_to_send:
      if (is_mine) open(message, own, now, out);
      break;
    case broadcast_announce:
      if (!is_mine) open(message, own, now, out);
      break;
    case clear_to_send:
      if (is_of_sent) on_clear_to_send(*sent, message, own, now, out);
      break;
    case end_of_message:
      if (is_of_sent) sent->is_active = false;
      break;
    case abort_connection: {
      Session* const received = is_mine ? incoming(source, false) : nullptr;
      for (Session* session : {is_of_sent ? sent : nullptr, received})
        if (session != nullptr && session->pgn == pgn) {
          session->is_active = false;
          ++aborted_;
        }
      break;
    }
    default:
      break;
  }
}

std::optional<Data> Transport::receive(const Message& message, std::uint8_t own, DeviceTime now,
                                       FrameBuffer& out) noexcept {
  if (message.header.destination != own && message.header.destination != everyone) return std::nullopt;
  if (message.header.pgn == pgn::transfer_control) on_control(message, own, now, out);
  if (message.header.pgn == pgn::transfer_data) return on_data(message, own, now, out);
  return std::nullopt;
}

std::optional<DeviceTime> Transport::deadline() const noexcept {
  std::optional<DeviceTime> first;
  const auto take = [&](const Session& session) {
    if (session.is_active && !session.is_waiting) first = earlier(first, session.due);
  };
  std::ranges::for_each(incoming_, take);
  std::ranges::for_each(outgoing_, take);
  return first;
}

void Transport::poll(std::uint8_t own, DeviceTime now, FrameBuffer& out) noexcept {
  for (Session& session : incoming_) {
    if (session.is_active && session.due <= now) end(session, Abort::timeout, own, out);
  }
  for (Session& session : outgoing_) {
    if (!session.is_active || session.is_waiting || session.due > now) continue;
    if (session.to_everyone) {
      send_packet(session, own, out);
      session.due = now + broadcast_gap;
      if (session.next <= session.packets) continue;
      session.is_active = false;
      for (Session& other : outgoing_) {
        if (!other.is_active || !other.is_waiting) continue;
        begin_broadcast(other, own, now, out);
        break;
      }
      continue;
    }
    end(session, Abort::timeout, own, out);
  }
}

void Transport::step_clock(Nanoseconds by) noexcept {
  for_each([by](Session& session) { session.due = session.due + by; });
}

}  // namespace imud::j1939
