// StoredTruths: a capture that is decoded once, for many replays of it.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "emulator/drive/truth_pieces.hpp"

namespace imud {

// Holds every truth, refusal and remark that the port and the decoder of a capture return, in order. A run from
// StoredTruths equals a run from the capture. Immutable.
class StoredTruths {
 public:
  // Reads the capture to its end. Returns nullopt if it has more than `most` records. Throws PortError.
  static std::optional<StoredTruths> read(const TruthConfig& config, std::size_t most);

  // Returns the format whose decoders read the port of open(). Both must not outlive this.
  const TruthFormat& format() const noexcept { return *format_; }
  std::unique_ptr<Port> open() const;
  // Returns true if each truth is later than the one before: none is inserted or refused for its time.
  bool ascend() const noexcept { return ascend_; }

  struct Content {
    std::vector<TruthPiece> pieces;
    PortCounters counters;
    std::string end_warning, other_content;
  };

 private:
  StoredTruths() = default;

  std::shared_ptr<Content> content_;
  std::unique_ptr<TruthFormat> format_;
  std::optional<bool> keeps_datagrams_;
  bool ascend_ = true;
};

}  // namespace imud
