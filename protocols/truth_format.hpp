// TruthFormat: how one simulator writes its truth, and what it has to be sent in return.
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
  too_long,       // more
  not_this_kind,  // the magic or the first word is another's
  bad_version,
  bad_checksum,
  bad_number,    // text that is no number
  not_finite,    // NaN or infinity
  out_of_range,  // finite, but no vehicle does that (core/truth.hpp), or fields that contradict one another
  no_columns,    // a row before its header, and no columns configured; a header that lacks a required column
};

// The kind of input of a TruthDecoder.
enum class TruthInput : std::uint8_t {
  datagram,  // one whole datagram: its end ends a record
  stream,    // the next piece of a stream, of any length: a record may begin in one piece and end in another
};

// The parts of a stream that became no record.
struct StreamLosses {
  std::uint64_t too_long = 0;    // records that the decoder has no room for
  std::uint64_t cut_short = 0;   // records that were incomplete when the input ended
  std::size_t cut_short_by = 0;  // bytes that were there of the newest of these
};

// Decodes what one simulator sends, and writes what the simulator has to be sent. A state machine: it knows no clock
// and no port, and allocates nothing once made. One thread.
//
// feed() is given all that the port receives; after each call next() is called until it returns nothing. A format
// that sends something unasked (greeting, subscription, heartbeat, repetition of what was not answered) has
// deadlines, at which poll() is called; which side sends first is the format's matter. A format whose simulator waits
// for an answer sets Truth::acknowledge: acknowledge() is called when the samples due up to that truth have been
// sent.
//
// Each frame appended to a FrameBuffer is one datagram, or is written to the stream whole.
class TruthDecoder {
 public:
  virtual ~TruthDecoder() = default;

  // The simulator can be reached from now on: once, or, on a stream, each time that it connects. A greeting is due at
  // once, that is deadline() <= now. Not called for a capture, to which nothing can be sent. Default: nothing is due.
  virtual void start(HostTime now) noexcept;

  // Sets the next bytes, which have to stay valid until next() has returned nothing. `arrival` is the host's time, or
  // the time stamp of a capture. Any bytes are harmless.
  virtual void feed(std::span<const std::byte> bytes, TruthInput input, HostTime arrival) noexcept = 0;
  // Decodes the next record: fills `truth` and returns ok, or returns what is wrong and leaves `truth` unspecified.
  // Returns nothing when what was fed is used up; what it held of an unfinished record is kept.
  virtual std::optional<TruthResult> next(Truth& truth) noexcept = 0;
  // The input has ended, or on a stream the simulator has disconnected: an unfinished record is dropped, and counted
  // as cut short. What is fed afterwards is from the beginning of a new stream. Default: nothing is held.
  virtual void finish() noexcept;

  // When poll() is to be called next; nullopt: not before another call.
  virtual std::optional<HostTime> deadline() const noexcept;
  // Does what is due at `now`, which is deadline() or later, and appends what the simulator is to be sent. Afterwards
  // deadline() is later than `now`.
  virtual void poll(HostTime now, FrameBuffer& out) noexcept;
  // Appends the answer to a truth whose `acknowledge` is set: the truth answered, the time up to which truth is in
  // use, and the samples emitted so far in the run. Default: the format has none.
  virtual void acknowledge(const Truth& truth, TruthTime used_until, std::uint64_t samples,
                           FrameBuffer& out) noexcept;

  const StreamLosses& losses() const noexcept { return losses_; }

 protected:
  StreamLosses losses_;
};

// A format each of whose records is a datagram.
class DatagramTruthDecoder : public TruthDecoder {
 public:
  void feed(std::span<const std::byte> bytes, TruthInput input, HostTime arrival) noexcept final;
  std::optional<TruthResult> next(Truth& truth) noexcept final;

 private:
  // As next(), of one datagram.
  virtual TruthResult decode(std::span<const std::byte> datagram, Truth& truth) noexcept = 0;

  std::optional<std::span<const std::byte>> datagram_;
};

// One entry of the table.
struct TruthFormat {
  std::string_view name;              // keyword in the configuration: the file's stem with '-' for '_'
  std::string_view summary;           // one line
  std::string_view document;          // the document and revision followed
  bool delimits_itself;               // its records are found in a stream or file too; otherwise only in datagrams
  bool acknowledges;                  // acknowledge() answers, so that the simulator can wait for the samples
  std::span<const Setting> settings;  // beside `port` and `format` in [truth]
  // Throws std::invalid_argument that says what would be right, for settings that make no sense.
  std::unique_ptr<TruthDecoder> (*make)(const Settings& settings);
};

// The word for `result` that summaries and logs use: "short", "crc", ...; "" for ok.
std::string_view cause(TruthResult result) noexcept;

// The table, made by the build from the files in protocols/truth_formats, sorted by name.
std::span<const TruthFormat* const> truth_formats() noexcept;
const TruthFormat* find_truth_format(std::string_view name) noexcept;

}  // namespace imud
