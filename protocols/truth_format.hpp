// TruthFormat: how one simulator encodes its truth, and what imud sends to it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>

#include "core/frame.hpp"
#include "core/time.hpp"
#include "core/truth.hpp"
#include "protocols/settings.hpp"

namespace imud {

// The result of decoding one record (a datagram, a line of text, a message).
enum class TruthResult : std::uint8_t {
  ok,             // `truth` is whole
  no_state,       // well-formed, but carries no state: a header row, a blank line, a comment
  too_short,      // fewer bytes or columns than the format has
  too_long,       // more bytes or columns than the format has
  not_this_kind,  // wrong magic or first word
  bad_version,
  bad_checksum,
  bad_number,    // text that is not a number
  not_finite,    // NaN or infinity
  out_of_range,  // finite, but impossible for a vehicle (core/truth.hpp), or contradictory
  no_columns,    // a row before its header, and no columns configured; a header that lacks a required column
  withheld,      // whole, but a fault of the truth delays or drops it
};

// The frame N of a format's truths, as far as its settings determine it, and whether they have a rate.
struct TruthFrame {
  enum class Kind : std::uint8_t {
    unknown,   // not known before a header row, or poses are relative to an unspecified N
    local,     // a local level, at a place that the truth does not have
    inertial,  // the origin is the Earth's centre; the Earth's angle is not known
    earth,     // inertial, and each truth has the angle (Truth::earth_angle)
  };
  Kind kind = Kind::unknown;
  bool has_rate = true;  // false: no truth has a rate
  // rad, earth only: Truth::earth_angle of every truth; nullopt: each truth has its own.
  std::optional<double> angle = std::nullopt;
};

// The kind of input of a TruthDecoder.
enum class TruthInput : std::uint8_t {
  datagram,  // one whole datagram: its end ends a record
  stream,    // the next piece of a stream, of any length: a record may begin in one piece and end in another
};

// Counters of stream input that yielded no record.
struct StreamLosses {
  std::uint64_t too_long = 0;       // records longer than the decoder's buffer
  std::size_t longest = 0;          // bytes of the decoder's buffer, once a record was longer
  std::uint64_t last_lines = 0;     // whole last lines of files without a line feed; each is still a record
  std::uint64_t cut_short = 0;      // records that were incomplete when the input ended
  std::size_t cut_short_by = 0;     // bytes of the newest cut record, less its whole lines (below)
  std::size_t cut_short_lines = 0;  // whole lines of the newest cut record, in a format of records of several lines
};

// Decodes the messages of one simulator, and produces messages for it. A pure state machine: it has no clock and no
// port, and allocates nothing after it is made. One thread.
//
// feed() is called with all that the port receives, and next() after each feed() until it returns nothing. A format
// that sends unsolicited messages (greeting, subscription, heartbeat, retransmission) has deadlines, at which poll()
// is called; either side may send first. A format whose simulator waits for an answer sets Truth::acknowledge:
// acknowledge() is called when the samples up to that truth have been sent.
//
// Each frame appended to a FrameBuffer becomes one datagram, or one uninterrupted write to the stream.
class TruthDecoder {
 public:
  virtual ~TruthDecoder() = default;

  // Called when the simulator can be reached: once, or on a stream each time that it connects. If the format sends a
  // greeting, deadline() <= now afterwards. Not called for a capture, to which nothing can be sent. Default: does
  // nothing.
  virtual void start(HostTime now) noexcept;

  // Sets the next bytes, which must stay valid until next() has returned nothing. `arrival` is the host's time, or
  // the time stamp of a capture. No input is harmful.
  virtual void feed(std::span<const std::byte> bytes, TruthInput input, HostTime arrival) noexcept = 0;
  // Decodes the next record: fills `truth` and returns ok, or returns the fault and leaves `truth` unspecified.
  // Returns nothing when the input is used up; an unfinished record is kept.
  virtual std::optional<TruthResult> next(Truth& truth) noexcept = 0;
  // Writes a remark on the last record to `room`, for the log: what was expected and what was found, such as the
  // column that caused a refusal, or the columns of a header row that are not used. Returns the length of the
  // remark; 0: there is no remark. Requires a call directly after next() has returned `result`. Before the first
  // feed(), a call with no_state writes a remark on the settings. Default: no remark.
  virtual std::size_t describe(TruthResult result, std::span<char> room) const noexcept;
  // Called at most once, when next() has returned nothing at the end of a file, before finish(): a last line without
  // its line feed is decoded by next() if it is whole. Default: does nothing.
  virtual void end_of_file() noexcept;
  // Ends the input, or on a stream the connection: an unfinished record is dropped, and counted as cut short. Later
  // input begins a new stream. Default: does nothing, for a decoder that holds nothing.
  virtual void finish() noexcept;

  // Returns the time at which poll() must be called next, or nullopt if nothing is scheduled. Any other call may
  // change it.
  virtual std::optional<HostTime> deadline() const noexcept;
  // Performs all actions due up to `now`, which is deadline() or later; appends messages for the simulator.
  // Afterwards deadline() is later than `now`.
  virtual void poll(HostTime now, FrameBuffer& out) noexcept;
  // Appends the answer to `truth`, whose `acknowledge` is set. Truth up to `used_until` has been used; `samples` have
  // been emitted so far in the run. Default: appends nothing.
  virtual void acknowledge(const Truth& truth, TruthTime used_until, std::uint64_t samples,
                           FrameBuffer& out) noexcept;
  // Sets the pulse width, us, of servo number `servo` in all later messages to the simulator. Requires `servo`
  // below TruthFormat::servos. Default: does nothing, for a format without servos.
  virtual void set_servo(std::size_t servo, std::uint16_t pulse_us) noexcept;

  // Returns the frame N of the decoder's truths, as far as known before the first feed(). Default: unknown, with a
  // rate.
  virtual TruthFrame frame() const noexcept;

  const StreamLosses& losses() const noexcept { return losses_; }

 protected:
  StreamLosses losses_;
};

// The base class of a format in which each record is a datagram.
class DatagramTruthDecoder : public TruthDecoder {
 public:
  void feed(std::span<const std::byte> bytes, TruthInput input, HostTime arrival) noexcept final;
  std::optional<TruthResult> next(Truth& truth) noexcept final;

 protected:
  // The last datagram fed.
  std::span<const std::byte> datagram() const noexcept { return datagram_; }
  HostTime arrival() const noexcept { return arrival_; }

 private:
  // Decodes one datagram; returns as next() does.
  virtual TruthResult decode(std::span<const std::byte> datagram, Truth& truth) noexcept = 0;

  std::span<const std::byte> datagram_;
  HostTime arrival_;
  bool is_new_ = false;
};

// The columns of a quantity, in a format whose records are rows with named columns. Their values are in the unit of
// `help`.
struct ColumnGroup {
  enum Need : std::uint8_t {
    required,
    one_of,    // at least one of the one_of groups is required; the first group present is used
    optional,  // used if all of its columns are present
  };
  std::span<const std::string_view> names;  // as they are written in the header row
  std::string_view help;
  Need need = optional;
};

// One entry of the table.
struct TruthFormat {
  std::string_view name;         // keyword in the configuration: the file's stem with '-' for '_'; nasa_42 is "42"
  std::string_view summary;      // one line
  std::string_view document;     // the document and revision followed
  bool delimits_itself = false;  // records are found in streams and files, too; false: only in datagrams
  bool acknowledges = false;     // acknowledge() sends an answer, so that the simulator can wait for the samples
  std::span<const Setting> settings = {};     // beside `port` and `format` in [truth]
  std::span<const ColumnGroup> columns = {};  // all used columns, required ones first; empty: none
  // Throws std::invalid_argument if the settings are inconsistent; the message is "KEY: ", then the fault and the
  // remedy.
  std::unique_ptr<TruthDecoder> (*make)(const Settings& settings);
  // Names, in the simulator's own words, the quantities that a simulator has to send so that the truth has a
  // specific force or an accumulated velocity.
  std::string_view force_from = {};
  // The setting `columns` takes the quantities of protocols/quantities/truth_quantities.hpp.
  bool maps_quantities = false;
  // The format's truths may lack rate or specific force. Both are then derived from the poses
  // (core/pose/pose_fit.hpp) unless the configuration says otherwise. A format without this always gives the rate.
  bool derives = false;
  // How many servos TruthDecoder::set_servo() can set.
  std::size_t servos = 0;
  // The usual transport of the format's records, for the port of an example configuration.
  enum class Way : std::uint8_t {
    datagrams,
    connection,  // as a stream
    file,
  };
  Way way = Way::datagrams;
  // The address of the example port, after the transport's name. A format that sends first needs the simulator's
  // address here. Empty: any address will do.
  std::string_view example_port = {};
  // The simulator's names for the position and for the velocity, in a format whose simulator may omit them. Empty:
  // "positions", "velocities".
  std::string_view position_from = {}, velocity_from = {};
};

// Returns the word for `result` in summaries and logs: "short", "crc", ...; "" for ok.
std::string_view cause(TruthResult result) noexcept;

// The table, made by the build from the files in protocols/truth_formats, sorted by their stems.
std::span<const TruthFormat* const> truth_formats() noexcept;
// Returns nullptr if no format has that name.
const TruthFormat* find_truth_format(std::string_view name) noexcept;

}  // namespace imud
