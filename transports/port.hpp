// Port: a file descriptor that sends and receives frames without ever waiting.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "core/frame.hpp"
#include "core/time.hpp"
#include "core/uart.hpp"
#include "transports/port_spec.hpp"

namespace imud {

// What the port is for.
enum class Role : std::uint8_t {
  device,    // imud as the sensor: sends samples, receives the host's bytes; a pty is made, a UDP peer is sent to
  listener,  // receives: truth, or imu-decode; a UDP port is bound, a file is read, an existing pty is opened
};

// What send() may see; a lost device is a state, never an exit.
enum class PortState : std::uint8_t {
  ready,
  no_reader,    // nobody has the other end open: frames are discarded
  wrong_speed,  // the client of a pty has set another speed than the line's: both sides read garbage, frames count as
                // sent
  lost,         // unplugged, removed, or down: reopened by itself with back-off
};

struct PortCounters {
  std::uint64_t sent = 0;        // frames that the kernel took whole
  std::uint64_t dropped = 0;     // frames that it did not take, dropped whole; one torn is neither for a while
  std::uint64_t received = 0;    // frames or chunks
  std::uint64_t lost_count = 0;  // times the device was lost
  std::uint64_t truncated = 0;   // datagrams of a capture that are cut short, or fragments
  std::uint64_t not_ours = 0;    // packets of a capture that are for another port or no UDP
};

class Port {
 public:
  virtual ~Port() = default;

  // Sends the frames of one sample, in order. Never waits: what the kernel does not take now is dropped whole and
  // counted; no frame is torn (of one that was taken in part, the rest goes first at the next call). Who may wait and
  // wants nothing dropped (a run that is not in real time) polls descriptor() for POLLOUT first.
  virtual void send(std::span<const Frame> frames) noexcept = 0;

  // As send(), of an answer to the host: of a line that has more to carry than it can, answers have the better
  // chance.
  virtual void reply(std::span<const Frame> frames) noexcept { send(frames); }
  // At the end: what is still held back will not be sent, and counts as dropped.
  virtual void give_up() noexcept {}

  // The next frame (CAN, UDP) or chunk of bytes (serial, pty, file) that is there; nullopt if nothing is. The bytes
  // stay valid until the next call.
  struct Received {
    Frame frame;
    HostTime time;  // of arrival; a capture's own time stamp
  };
  virtual std::optional<Received> receive() noexcept = 0;

  // True once receive() will never return anything again: the end of a file or capture.
  virtual bool at_end() const noexcept { return false; }
  // A word on how a capture ended if it did not end well ("cut short in record 12"); empty otherwise.
  virtual std::string_view end_warning() const noexcept { return {}; }

  // The device's UART is set otherwise: holds for what is sent from now on. Frames are dropped until what was sent
  // before is out.
  virtual void set_line(const UartSettings&) noexcept {}

  // Pushes out what send() holds back: a file's buffer, the rest of a frame taken in part, what a paced line has
  // received by now. Never waits either.
  virtual void flush() noexcept {}
  // When flush() will have something to do next; nullopt if that is no matter of time.
  virtual std::optional<HostTime> due() const noexcept { return std::nullopt; }
  // False while it is known that the other end has not read all that was sent: closing a pty takes that away.
  virtual bool is_read() noexcept { return true; }
  // False if receive() never returns anything: do not wait for it.
  virtual bool hears() const noexcept { return true; }
  // For poll(); -1 if there is nothing to wait for: a capture, a regular file, a lost device, a pty that nobody has
  // open. send() and receive() look whether it is back, so one of them must be called now and then. Changes when it
  // is reopened.
  virtual int descriptor() const noexcept { return -1; }

  // What both ends of a pty are set to, in bit/s, as last seen; 0: not known.
  struct alignas(8) Speeds {  // one atomic word
    unsigned line = 0, client = 0;
  };

  PortState state() const noexcept { return state_; }
  Speeds speeds() const noexcept { return speeds_; }
  const PortCounters& counters() const noexcept { return counters_; }

 protected:
  PortState state_ = PortState::ready;
  Speeds speeds_;
  PortCounters counters_;
};

// One entry of the table.
struct Transport {
  std::string_view name;      // the word before the colon in a port: the file's stem
  std::string_view summary;   // one line
  std::string_view syntax;    // "serial:/dev/ttyUSB0?baud=921600"
  std::string_view document;  // the interface followed
  bool carries_can;           // frames with an identifier; otherwise bytes
  // Throws PortError that says what is wrong with the spec and what would be right, without touching the system: an
  // unknown option, a value out of range, a role that this transport has not.
  void (*check)(const PortSpec& spec, Role role);
  // Opens a port whose spec has passed check(). Throws PortError that says what failed on what.
  std::unique_ptr<Port> (*open)(const PortSpec& spec, Role role);
};

// The table, made by the build from the transports' files, sorted by name.
std::span<const Transport* const> transports() noexcept;
const Transport* find_transport(std::string_view name) noexcept;

// Opens "scheme:rest?key=value&...".
std::unique_ptr<Port> open_port(std::string_view spec, Role role);

}  // namespace imud
