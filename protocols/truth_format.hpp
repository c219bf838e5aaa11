// TruthFormat: how one simulator writes its truth.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

#include "core/frame.hpp"
#include "core/truth.hpp"
#include "protocols/settings.hpp"

namespace imud {

// What became of one record (a datagram, or a line of a text file).
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

// Decodes one simulator's records. Keeps what a header row said; otherwise without state. Allocates nothing after it
// is made. One thread.
class TruthDecoder {
 public:
  virtual ~TruthDecoder() = default;
  // Fills `truth` and returns ok, or says what is wrong and leaves `truth` unspecified. Any bytes are harmless.
  virtual TruthResult decode(std::span<const std::byte> record, Truth& truth) = 0;
  // Writes the answer to a truth whose `acknowledge` is set: the truth answered, the time reached and the samples
  // emitted so far in the run. Default: the format has none.
  virtual void acknowledge(const Truth& truth, TruthTime reached, std::uint64_t samples, FrameBuffer& out) noexcept;
};

struct TruthFormat {
  std::string_view name;              // keyword in the configuration: the file's stem with '-' for '_'
  std::string_view summary;           // one line
  std::string_view document;          // the document and revision followed
  bool text;                          // a file holds one record a line; otherwise only datagrams
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
