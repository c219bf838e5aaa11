// Port: a file descriptor that sends and receives frames and never waits. Transport: a kind of port.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/frame.hpp"
#include "core/time.hpp"
#include "core/uart.hpp"
#include "transports/endpoint.hpp"
#include "transports/port_spec.hpp"

namespace imud {

// The purpose of a port.
enum class Role : std::uint8_t {
  device,    // imud as the sensor: sends samples, receives the host's bytes; a pty is made, a UDP peer is sent to
  listener,  // receives: truth, or imu-decode; a UDP port is bound, a file is read, an existing pty is opened
};

// The treatment of frames that the line of a port cannot carry at once.
enum class Delivery : std::uint8_t {
  timely,    // a frame that cannot leave soon is dropped: realtime
  complete,  // the sender waits until all frames have left: lockstep, fast
};

// The settings of a port that are not in its text. All but the role have defaults.
struct PortSettings {
  constexpr PortSettings(Role port_role) noexcept : role(port_role) {}

  Role role;
  // The UART of the device behind the port when the port opens (Port::set_line() changes it). It replaces the text's
  // `baud`, `parity` and `stop`. If its baud is 0, the device has no UART and the text applies.
  UartSettings uart;
  // Emulated UART only: characters arrive when the line would have carried them, not at once.
  bool paced = false;
  Delivery delivery = Delivery::timely;  // of a queue for a CAN interface, or of a file's buffer
  // A virtual CAN interface only: the thread that opens the port takes the lowest priority, so that receivers on the
  // same processor run first.
  bool yields = false;
  // A virtual CAN interface without a limit of its rate only: samples leave in batches, and the host's frames are
  // read after each batch.
  bool collects = false;
  // A device on a CAN bus only: sends frames of CAN FD.
  bool sends_fd = false;
  // A listener of UDP only: receives the datagrams of this sender alone, and counts others as foreign.
  std::optional<Endpoint> from;
  // True: a regular file is written beside the old file and replaces it at commit(). False: the old file is
  // truncated at the first flush().
  bool replaces_file = false;
};

// The state of a port at the last call of one of its functions. A lost device is a state, never an exit.
enum class PortState : std::uint8_t {
  ready,
  no_reader,      // no process has the other end open: frames are discarded
  wrong_speed,    // the client of a pty has set another speed than the line's: both sides read garbage, and frames
                  // count as sent
  error_warning,  // a CAN controller has counted 96 errors or more (ISO 11898-1); frames leave
  error_passive,  // 128 errors or more: the controller no longer disturbs the frames of others, and its own frames
                  // may leave late
  lost,           // unplugged, removed, down, or bus-off: the port reopens itself with back-off
};

struct PortCounters {
  std::uint64_t sent = 0;        // frames that the kernel took whole
  std::uint64_t replies = 0;     // of these, frames in answer to the host
  std::uint64_t dropped = 0;     // frames that the kernel did not take; a frame taken in part is not counted yet
  std::uint64_t failed = 0;      // of the dropped: frames lost to an error of a file, such as a full disk
  std::uint64_t received = 0;    // frames or chunks
  std::uint64_t lost_count = 0;  // times the device was lost; streams of a capture that others follow
  std::uint64_t truncated = 0;   // datagrams of a capture that are cut short, or fragments; holes in its streams
  std::uint64_t not_ours = 0;    // packets of a capture that are not UDP, or for another port
  std::uint64_t foreign = 0;     // datagrams of other senders than PortSettings::from
  Endpoint foreign_from;         // the sender of the newest of these
  std::uint64_t connections_refused = 0;  // because the port has another peer
  // CAN: error frames of the controller; times that the controller entered a state, see PortState; frames that an
  // adapter refused.
  std::uint64_t bus_errors = 0, error_warnings = 0, error_passives = 0, bus_offs = 0, bus_restarts = 0, refused = 0;

  // Counts frames that the kernel took whole.
  void count_sent(bool is_reply, std::uint64_t frames = 1) noexcept {
    sent += frames;
    if (is_reply) replies += frames;
  }
};

// One end of a link. One thread at a time may use a port. After opening, a port does not wait, allocate, throw or
// log, except in commit().
class Port {
 public:
  virtual ~Port() = default;

  // Sends the frames of one sample, in order. Frames that the kernel does not take now are dropped whole and counted.
  // No frame is torn: the rest of a frame that was taken in part is sent first at the next call. A caller that must
  // not drop a frame, and may wait, polls descriptor() for POLLOUT first, unless the port has_room().
  virtual void send(std::span<const Frame> frames) noexcept = 0;

  // Sets the time of the frames that are sent from now on, by the clock of the device that sends them. A port that
  // records times uses it in place of the host's clock.
  void set_time(DeviceTime time) noexcept { time_ = time; }

  // Sends an answer to the host, as send() does. On an overloaded line, samples are dropped before answers.
  virtual void reply(std::span<const Frame> frames) noexcept {
    is_reply_ = true;
    send(frames);
    is_reply_ = false;
  }
  // Drops the frames that are held back, and counts them. Called at the end of a run.
  virtual void discard_pending() noexcept {}
  // Called once, after the last frame of a run that has not failed: PortSettings::replaces_file takes effect. May
  // throw std::runtime_error.
  virtual void commit() {}

  // Returns the next frame (CAN, UDP) or chunk of bytes (serial, pty, file), or nullopt if none is there. The bytes
  // stay valid until the next call.
  struct Received {
    Frame frame;
    HostTime time;       // of arrival; a capture's own time stamp
    Endpoint from = {};  // UDP and captures: the sender; elsewhere its port is 0
    // The bytes are a piece of a stream, although the transport keeps datagrams: a capture has both. A new stream
    // begins with the first piece after PortCounters::lost_count has risen.
    bool is_piece = false;
    bool is_last = false;  // the port knows that nothing else had come when this had
  };
  virtual std::optional<Received> receive() noexcept = 0;

  // Returns true once receive() will never return anything again: a file or capture has ended.
  virtual bool at_end() const noexcept { return false; }
  // Describes how a capture ended if it is damaged ("cut short in record 12"); empty otherwise.
  virtual std::string_view end_warning() const noexcept { return {}; }
  // Returns whether the recorded datagrams are kept apart, where this differs from file to file; nullopt:
  // Transport::keeps_datagrams holds for every file.
  virtual std::optional<bool> keeps_datagrams() const noexcept { return std::nullopt; }
  // Describes an ended capture without datagrams for the UDP port, or without a stream of the TCP port: "300
  // datagrams to port 9810 and none to 9811". Empty if the capture had one of these.
  virtual std::string_view other_content() const noexcept { return {}; }

  // Changes the UART's settings for all later frames. A real line drops new frames until the earlier frames have
  // left. A port without a UART ignores the call.
  virtual void set_line(const UartSettings&) noexcept {}

  // Unplugs the cable (false), or plugs it in again (true). A pty without a keeper hangs its client up and removes
  // its link; when the cable is plugged in again, the link leads to another pty, which a client has to open. The
  // default does nothing: the peer of such a port sees no cable.
  virtual void set_connected(bool) noexcept {}
  // Begins (true) or ends (false) a break, during which the line is at space. Returns false if the port cannot
  // make a break.
  virtual bool set_break(bool) noexcept { return false; }

  // Sends the held bytes, as far as possible now: a file's buffer, the rest of a frame taken in part, the characters
  // that a paced line has carried by now.
  virtual void flush() noexcept {}
  // Returns when flush() can send something more, if that depends on time alone; otherwise nullopt.
  virtual std::optional<HostTime> next_flush() const noexcept { return std::nullopt; }
  // Returns true if something is held back that flush() can send as soon as descriptor() is writable: poll for
  // POLLOUT.
  virtual bool wants_output() const noexcept { return false; }
  // Flushes. Returns false while the other end is known not to have read everything that was sent: closing a pty in
  // this state would discard the unread bytes.
  virtual bool is_drained() noexcept { return true; }
  // Returns true if the frames of a sample have room in the port's own buffer: send() drops none of them, and the
  // caller need not wait. Returns false if the port has no buffer of its own, or if too many frames wait in it.
  virtual bool has_room() const noexcept { return false; }
  // Returns false if receive() never returns anything: do not poll for POLLIN.
  virtual bool can_receive() const noexcept { return true; }
  // CAN: receive() returns the data and remote frames that pass at least one of `filters`, and every error frame.
  // Until the first call, and with more than 64 filters, every frame passes. The port's own frames are confirmed only
  // if they pass, too. May be called at any time; earlier frames are not filtered again.
  virtual void set_filters(std::span<const CanFilter>) noexcept {}
  // One of the port's own frames, and the time at which the interface sent the frame: the driver of a CAN
  // controller confirms a frame when it was on the bus; for vcan, vxcan and slcan the kernel confirms a frame when
  // the interface takes it.
  struct Confirmation {
    CanHeader can;
    HostTime time;
  };
  static constexpr std::size_t max_confirmations = 64;
  // Returns the oldest confirmation that receive() has found, or nullopt if there is none; the last max_confirmations
  // are kept. receive() itself does not return the port's own frames. Only a CAN port with `confirm=yes` has any.
  virtual std::optional<Confirmation> next_confirmation() noexcept { return std::nullopt; }
  // Returns the descriptor for poll(), or -1 if there is nothing to wait for: a capture, a regular file, a lost
  // device, a pty that nobody has open. It changes when the port reopens. While it is -1, call send() or receive()
  // periodically: they check whether the device is back.
  virtual int descriptor() const noexcept { return -1; }

  // The speeds that both ends of a pty are set to, in bit/s, as last seen; 0: not known.
  struct alignas(8) Speeds {  // one atomic word
    unsigned line = 0, client = 0;
  };

  // Returns the port's text with the number that the system has chosen in place of 0, "udp:127.0.0.1:41234"; empty
  // if the system has chosen none. Allocates: call it after opening.
  virtual std::string chosen_port() const { return {}; }
  // Returns how much of a capture has been read, from 0 to 1; nullopt if its size is not known.
  virtual std::optional<double> progress() const noexcept { return std::nullopt; }

  PortState state() const noexcept { return state_; }
  // Returns the errno of the last write to a file that failed; 0: none has.
  int error() const noexcept { return error_; }
  Speeds speeds() const noexcept { return speeds_; }
  const PortCounters& counters() const noexcept { return counters_; }

 protected:
  PortState state_ = PortState::ready;
  bool is_reply_ = false;  // send() is called for a reply
  DeviceTime time_;        // of the frames that are sent
  int error_ = 0;
  Speeds speeds_;
  PortCounters counters_;
};

// The kind of UART that a transport has.
enum class Uart : std::uint8_t {
  none,
  real,      // hardware, which paces its characters by itself
  emulated,  // a speed without hardware: characters arrive at once, or paced if PortSettings::paced
};

// How long a frame occupies the wire.
struct WireTime {
  double bits = 0;             // on the wire, with framing; the maximum where the number depends on the data
  double average_bits = 0;     // the same with random data
  double own_bits = 0;         // the same with the frame's own data
  double bit_rate = 0;         // bit/s; of a CAN FD bus, the nominal bit rate; 0: not known
  double seconds = 0;          // 0: not known
  double average_seconds = 0;  // 0: not known
  double own_seconds = 0;      // 0: not known
};

// One entry of the table: everything that other folders know of a kind of port. Code outside of its file uses the
// properties, never the name. Except for check(), the functions require a spec that has passed check().
struct Transport {
  std::string_view name;                     // the word before the colon in a port: the file's stem
  std::string_view summary;                  // one line
  std::string_view syntax;                   // "pty:LINK?baud=115200"
  std::string_view example;                  // a valid port with an option or two: "pty:imu1?baud=115200"
  std::string_view document;                 // the interface followed
  std::span<const PortOption> options = {};  // all that its ports have; check_port() checks that each is in its range

  bool carries_can = false;           // frames have an identifier; otherwise they are bytes
  bool carries_any = false;           // bytes or frames with an identifier, as recorded
  bool keeps_datagrams = false;       // one frame sent is one frame received; otherwise a stream of bytes
  bool ends = false;                  // a listener reads recorded data up to their end
  bool brings_truth = false;          // may be the port of the truth
  bool serves_device = true;          // Role::device is possible, beside Role::listener
  bool is_shared = false;             // several imus may have the same address: a bus, a receiver of datagrams
  bool has_path = false;              // the address is a path in the file system; - is a standard stream
  bool makes_link = false;            // the path is a symbolic link, which a device's port makes
  bool reads_standard_input = false;  // as a listener at the address -
  bool has_private_copy = false;      // a port at another path serves to measure the duration of writes
  bool has_readers = false;           // a process opens and closes the other end of a device's port
  Uart uart = Uart::none;             // if there is one, the options `baud`, `parity` and `stop` set it

  // Files that `imud replay` and `imu-truth capture` open by this transport if no transport is named: suffixes of
  // their names (".csv .txt"), without the suffix of compression; "*" stands for all that no other transport claims.
  std::string_view suffixes = {};

  // Returns true if the file is the record of a run. This transport reads a record whatever the file's name is,
  // and `imud replay` repeats the run. nullptr: this transport reads no records.
  bool (*is_record)(const std::string& path) = nullptr;

  // Throws PortError if a port of this kind cannot have this address, this combination of options, or these
  // settings; the text of the error states the fault and the remedy. Opens nothing. check_port() checks the role
  // and each single option. The default refuses no port.
  void (*check)(const PortSpec& spec, const PortSettings& settings) = [](const PortSpec&, const PortSettings&) {};
  // Opens a port. Throws PortError, which names the failed action.
  std::unique_ptr<Port> (*open)(const PortSpec& spec, const PortSettings& settings);

  // Returns how long `frame` occupies the wire. nullptr: frames leave instantly.
  WireTime (*wire_time)(const PortSpec& spec, const PortSettings& settings, const Frame& frame) = nullptr;
  // Returns the UDP port whose datagrams a listener receives; nullopt: the listener receives datagrams to all
  // ports, or its port is chosen when it opens. Throws PortError if the spec has not passed check(). nullptr: the
  // transport does not use UDP. A transport that `ends` takes the number from its option `port`, which also
  // selects the streams of a TCP port.
  std::optional<std::uint16_t> (*udp_port)(const PortSpec& spec) = nullptr;
  // Returns the port number at one end of a TCP connection; with this number the same stream can be selected in a
  // capture. nullopt: the number is chosen when the port opens. Throws PortError if the spec has not passed
  // check(). nullptr: the transport does not use TCP.
  std::optional<std::uint16_t> (*tcp_port)(const PortSpec& spec) = nullptr;
  // Returns true if frames of a device at `device` arrive at a listener at `listener`. Both have passed check().
  // nullptr: they never arrive.
  bool (*reaches)(const PortSpec& device, const PortSpec& listener) = nullptr;
  // Returns true if a device's frames go to standard output. nullptr: never.
  bool (*is_standard_output)(const PortSpec& spec) = nullptr;
};

// Implements Transport::open for a class whose constructor takes spec and settings.
template <class Class>
std::unique_ptr<Port> open_as(const PortSpec& spec, const PortSettings& settings) {
  return std::make_unique<Class>(spec, settings);
}

// The table, made by the build from the transports' files, sorted by name.
std::span<const Transport* const> transports() noexcept;
const Transport* find_transport(std::string_view name) noexcept;

// Returns the transport that a port's text "scheme:rest" names; nullptr if there is none.
const Transport* transport_of(std::string_view port) noexcept;

// Returns the syntax, without options, of each transport that fulfils `condition`.
template <class Condition>
std::vector<std::string_view> port_examples(Condition condition) {
  std::vector<std::string_view> all;
  for (const Transport* transport : transports())
    if (condition(*transport)) all.push_back(transport->syntax.substr(0, transport->syntax.find('?')));
  return all;
}

// Throws PortError if the transport does not support the role of `settings`, if an option is unknown or out of its
// range, or if its check() throws.
void check_port(const Transport& transport, const PortSpec& spec, const PortSettings& settings);

// Opens "scheme:address?key=value&...". Throws PortError.
std::unique_ptr<Port> open_port(std::string_view port, const PortSettings& settings);

// Returns the transport whose Transport::is_record() recognises a regular file; nullptr if the file is no record.
const Transport* record_transport_of(const std::string& path);

// Returns the port that reads a capture: `capture` itself if it begins with the scheme of a transport that `ends`,
// otherwise the port of the transport for such a record or file name.
std::string capture_port(std::string_view capture);

// Returns the port that reads standard input: as datagrams with borders, as a stream of bytes, or as CAN frames.
std::string standard_input_port(bool keeps_datagrams, bool carries_can = false);

}  // namespace imud
