// Port: a file descriptor that sends and receives frames and never waits. Transport: a kind of port.
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

// What a port is for.
enum class Role : std::uint8_t {
  device,    // imud as the sensor: sends samples, receives the host's bytes; a pty is made, a UDP peer is sent to
  listener,  // receives: truth, or imu-decode; a UDP port is bound, a file is read, an existing pty is opened
};

// The state that send() found. A lost device is a state, never an exit.
enum class PortState : std::uint8_t {
  ready,
  no_reader,    // nobody has the other end open: frames are discarded
  wrong_speed,  // the client of a pty has set another speed than the line's: both sides read garbage, and frames
                // count as sent
  lost,         // unplugged, removed, or down: the port reopens itself with back-off
};

struct PortCounters {
  std::uint64_t sent = 0;        // frames that the kernel took whole
  std::uint64_t dropped = 0;     // frames that it did not take; one that it took in part is not counted yet
  std::uint64_t received = 0;    // frames or chunks
  std::uint64_t lost_count = 0;  // times the device was lost
  std::uint64_t truncated = 0;   // datagrams of a capture that are cut short, or fragments
  std::uint64_t not_ours = 0;    // packets of a capture that are not UDP, or for another port
};

// One end of a link. One thread at a time uses it. After opening it does not wait, allocate, throw or log.
class Port {
 public:
  virtual ~Port() = default;

  // Sends the frames of one sample, in order. Frames that the kernel does not take now are dropped whole and counted.
  // No frame is torn: the rest of one that was taken in part goes first at the next call. A caller that wants nothing
  // dropped, and may wait, polls descriptor() for POLLOUT first.
  virtual void send(std::span<const Frame> frames) noexcept = 0;

  // Sends an answer to the host, as send() does. On a line that is asked to carry more than it can, answers are
  // dropped later than samples.
  virtual void reply(std::span<const Frame> frames) noexcept { send(frames); }
  // Drops the frames that are held back, and counts them. Called at the end of a run.
  virtual void discard_pending() noexcept {}

  // Returns the next frame (CAN, UDP) or chunk of bytes (serial, pty, file), or nullopt if none is there. The bytes
  // stay valid until the next call.
  struct Received {
    Frame frame;
    HostTime time;  // of arrival; a capture's own time stamp
  };
  virtual std::optional<Received> receive() noexcept = 0;

  // Returns true once receive() will never return anything again: a file or capture has ended.
  virtual bool at_end() const noexcept { return false; }
  // Describes how a capture ended if it is damaged ("cut short in record 12"); empty otherwise.
  virtual std::string_view end_warning() const noexcept { return {}; }

  // Changes the UART's settings for all that is sent from now on. Until the frames sent before are out, new ones are
  // dropped. A port without UART ignores it.
  virtual void set_line(const UartSettings&) noexcept {}

  // Sends what is held back as far as that is possible now: a file's buffer, the rest of a frame taken in part, the
  // characters that a paced line has carried by now.
  virtual void flush() noexcept {}
  // Returns when flush() can send something more, if that depends on time alone; otherwise nullopt.
  virtual std::optional<HostTime> next_flush() const noexcept { return std::nullopt; }
  // Returns true if something is held back that flush() can send as soon as descriptor() is writable: poll for
  // POLLOUT.
  virtual bool wants_output() const noexcept { return false; }
  // Flushes, then returns false while the other end is known not to have read all that was sent: closing a pty now
  // would discard it.
  virtual bool is_drained() noexcept { return true; }
  // Returns false if receive() never returns anything: do not poll for POLLIN.
  virtual bool can_receive() const noexcept { return true; }
  // Returns the descriptor for poll(), or -1 if there is nothing to wait for: a capture, a regular file, a lost
  // device, a pty that nobody has open. It changes when the port reopens. While it is -1, call send() or receive()
  // now and then: they look whether the device is back.
  virtual int descriptor() const noexcept { return -1; }

  // The speeds that both ends of a pty are set to, in bit/s, as last seen; 0: not known.
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
