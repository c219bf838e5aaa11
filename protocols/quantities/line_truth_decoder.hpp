// LineTruthDecoder: truth formats whose records are lines of text.
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>

#include "protocols/truth_format.hpp"
#include "protocols/wire/line_assembler.hpp"

namespace imud {

// A record ends with a line feed. The last record of a datagram needs no line feed, and an empty datagram is one
// empty record. In a stream a record without its line feed is incomplete, unless the record is the last of a file
// and decode() returns ok.
class LineTruthDecoder : public TruthDecoder {
 public:
  // The longest line, in characters; longer than any datagram. A longer line of a stream is dropped and counted.
  static constexpr std::size_t max_line = 65536;

  void feed(std::span<const std::byte> bytes, TruthInput input, HostTime arrival) noexcept override;
  std::optional<TruthResult> next(Truth& truth) noexcept override;
  void end_of_file() noexcept override;
  void finish() noexcept override;

 private:
  std::optional<TruthResult> decode_last(Truth& truth) noexcept;
  // Decodes one line, given without its line feed; returns as next() does.
  virtual TruthResult decode(std::string_view line, Truth& truth) noexcept = 0;
  // Returns true if the last line of a file is an incomplete record. `result`: the result of decode() for that
  // line. Default: true, unless the line carries no state.
  virtual bool is_cut_short(TruthResult result) const noexcept { return result != TruthResult::no_state; }

  LineAssembler<max_line> lines_;
  bool is_last_ = false;    // the line that is held is the last of a file
  bool ends_here_ = false;  // the last record of a datagram, without a line feed, is still to be decoded
};

}  // namespace imud
