// StoredTruths: a capture that is decoded once, for many replays of it.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "emulator/plan/config.hpp"
#include "protocols/truth_format.hpp"
#include "transports/port.hpp"

namespace imud {

// Holds every truth, refusal and remark that the port and the decoder of a capture return, in order. A run from it
// equals a run from the capture. Immutable.
class StoredTruths {
 public:
  // Reads the capture to its end. Returns nullopt if it has more than `most` records. Throws PortError.
  static std::optional<StoredTruths> read(const TruthConfig& config, std::size_t most);

  // Returns the format whose decoders read the port of open(). Both must not outlive this.
  const TruthFormat& format() const noexcept { return *format_; }
  std::unique_ptr<Port> open() const;
  // Returns true if each truth is later than the one before: none is inserted or refused for its time.
  bool ascend() const noexcept { return ascend_; }

  // A record, or the remark on a record that is no truth.
  struct Record {
    TruthResult result = TruthResult::ok;
    Truth truth;
    std::string remark;
  };
  // The records of one call of Port::receive(), and the decoder's losses after it.
  struct Piece {
    std::vector<Record> records;
    HostTime time;
    Endpoint from;
    StreamLosses losses;
  };
  struct Content {
    std::vector<Piece> pieces;  // the last has the records and the losses of the end
    PortCounters counters;
    std::string end_warning, other_content;
  };

 private:
  StoredTruths() = default;

  std::shared_ptr<Content> content_;
  std::unique_ptr<TruthFormat> format_;
  bool ascend_ = true;
};

}  // namespace imud
