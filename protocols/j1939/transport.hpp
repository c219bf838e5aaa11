// Messages of more than 8 bytes, by the transport protocol of SAE J1939-21, 5.10: to all nodes (BAM) or to one node
// (RTS/CTS).
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "core/time.hpp"
#include "protocols/j1939/message.hpp"

namespace imud::j1939 {

// The first byte of TP.CM.
enum Control : std::uint8_t {
  request_to_send = 16,
  clear_to_send = 17,
  end_of_message = 19,
  broadcast_announce = 32,
  abort_connection = 255,
};

// The reason in TP.CM_Abort.
enum class Abort : std::uint8_t {
  busy = 1,       // there is a connection between the nodes already
  resources = 2,  // the message is longer than the receiver's buffer, or the receiver does not need it
  timeout = 3,
  clear_while_sending = 4,
  retransmissions = 5,
  bad_sequence = 7,
};

// The transfers of one node, in both directions. A session ends when one of the time-outs T1 to T4 passes without the
// message that it awaits; a broadcast that is sent ends after its last packet. Times are by the device's clock, as in
// Device.
class Transport {
 public:
  static constexpr std::size_t max_size =
      112;  // bytes of a message, so that all packets fit into one answer to a CTS
  static constexpr Nanoseconds broadcast_gap = std::chrono::milliseconds(50);  // before each packet of a BAM
  static constexpr Nanoseconds t1 = std::chrono::milliseconds(750);            // from packet to packet
  static constexpr Nanoseconds t2 = std::chrono::milliseconds(1250);           // from CTS to a packet
  static constexpr Nanoseconds t3 = std::chrono::milliseconds(1250);           // from the last packet, or RTS, to CTS
  static constexpr Nanoseconds t4 = std::chrono::milliseconds(1050);  // from a CTS that holds the connection open

  // Receives messages with the parameter group number `accepted`, and refuses all others. `aborted` and `timed_out`
  // count the transfers that are aborted, and that time out.
  Transport(std::uint32_t accepted, std::uint64_t& aborted, std::uint64_t& timed_out) noexcept
      : accepted_(accepted), aborted_(aborted), timed_out_(timed_out) {}

  // Ends all sessions without a message, as a node must that has lost its address.
  void clear() noexcept;

  // Sends a message of 9 to max_size bytes from the address `own` to `destination`, or by BAM to all nodes. BAMs are
  // sent one after another. `data` must remain valid until the session ends. Returns false if there are too many
  // sessions, or a session with this destination.
  bool send(std::uint32_t pgn, std::uint8_t destination, Data data, std::uint8_t own, DeviceTime now,
            FrameBuffer& out) noexcept;

  // Processes messages TP.CM and TP.DT to all nodes or to `own`, and ignores all others. Returns the data of a
  // message that is complete with this one; valid until the next call. `own`: the node's address; null_address while
  // the node may not send. Then it receives only broadcasts.
  std::optional<Data> receive(const Message& message, std::uint8_t own, DeviceTime now, FrameBuffer& out) noexcept;

  std::optional<DeviceTime> deadline() const noexcept;
  void poll(std::uint8_t own, DeviceTime now, FrameBuffer& out) noexcept;
  void step_clock(Nanoseconds by) noexcept;

 private:
  static constexpr std::size_t packet_size = 7;
  static constexpr unsigned max_repetitions = 2;  // repetitions of a packet that a receiver may request

  struct Session {
    bool is_active = false;
    bool is_waiting = false;  // outgoing BAM: waits for the end of another BAM
    std::uint32_t pgn = 0;
    std::uint8_t peer = everyone;  // outgoing: the destination; incoming: the source
    bool to_everyone = false;
    std::size_t size = 0;
    unsigned packets = 0;
    unsigned next = 1;  // the next packet
    DeviceTime due;     // of the next packet, or the end of a time-out
    // Outgoing
    Data data = {};
    unsigned repetitions = 0;
    // Incoming
    unsigned at_once = 0;  // packets that the sender can send after one CTS
    std::array<std::byte, max_size> buffer = {};
  };

  void control(const Session& session, std::uint64_t content, std::uint8_t own, FrameBuffer& out) const noexcept;
  void abort(std::uint8_t peer, std::uint32_t pgn, Abort reason, std::uint8_t own, FrameBuffer& out) noexcept;
  void end(Session& session, Abort reason, std::uint8_t own, FrameBuffer& out) noexcept;
  void begin_broadcast(Session& session, std::uint8_t own, DeviceTime now, FrameBuffer& out) noexcept;
  void send_packet(Session& session, std::uint8_t own, FrameBuffer& out) const noexcept;
  void on_control(const Message& message, std::uint8_t own, DeviceTime now, FrameBuffer& out) noexcept;
  void on_clear_to_send(Session& session, const Message& message, std::uint8_t own, DeviceTime now,
                        FrameBuffer& out) noexcept;
  void request_packets(Session& session, std::uint8_t own, DeviceTime now, FrameBuffer& out) const noexcept;
  void open(const Message& message, std::uint8_t own, DeviceTime now, FrameBuffer& out) noexcept;
  std::optional<Data> on_data(const Message& message, std::uint8_t own, DeviceTime now, FrameBuffer& out) noexcept;
  Session* incoming(std::uint8_t source, bool to_everyone) noexcept;
  Session* outgoing(std::uint8_t destination) noexcept;
  template <class Each>
  void for_each(Each&& each) noexcept;

  std::uint32_t accepted_;
  std::array<Session, 4> incoming_;
  std::array<Session, 6> outgoing_;
  std::uint64_t& aborted_;
  std::uint64_t& timed_out_;
};

}  // namespace imud::j1939
