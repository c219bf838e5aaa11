// LineTruthDecoder: truth formats whose records are lines of text.
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>

#include "protocols/line_assembler.hpp"
#include "protocols/truth_format.hpp"

namespace imud {

// A record ends with a line feed. In a datagram the last one needs none, and an empty datagram is one empty record;
// in a stream a record without its line feed is incomplete.
class LineTruthDecoder : public TruthDecoder {
 public:
  // Characters, more than fit into a datagram. A longer line of a stream is left out and counted.
  static constexpr std::size_t max_line = 65536;

  void feed(std::span<const std::byte> bytes, TruthInput input, HostTime arrival) noexcept final;
  std::optional<TruthResult> next(Truth& truth) noexcept final;
  void finish() noexcept override;

 private:
  // As next(), of one line without its line feed.
  virtual TruthResult decode(std::string_view line, Truth& truth) noexcept = 0;

  LineAssembler<max_line> lines_;
  bool ends_here_ = false;  // what was fed is a datagram whose last record has not been decoded yet
};

}  // namespace imud
