// Pieces of a capture: the results of its port and its decoder, so that a run takes the capture without decoding.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/plan/config.hpp"
#include "protocols/truth_format.hpp"
#include "transports/port.hpp"

namespace imud {

// A record, or the remark on a record that is no truth.
struct TruthRecord {
  TruthResult result = TruthResult::ok;
  Truth truth;
  std::string remark;
};

// The records of one call of Port::receive(), and the decoder's losses after it.
struct TruthPiece {
  std::vector<TruthRecord> records;
  HostTime time;
  Endpoint from;
  bool is_of_stream = false;  // Port::Received::is_piece
  StreamLosses losses;
};

// Reads a capture to its end, as TruthIntake does. One thread.
class TruthPieceReader {
 public:
  // Opens the capture. Throws PortError.
  explicit TruthPieceReader(const TruthConfig& config);

  // Fills `piece`, whose memory is used again. Waits for a fifo; a capture whose port has skipped many packets gives
  // a piece without records, so that a run can stop meanwhile. Returns false after the last piece, which has the
  // records and the losses of the end.
  bool read(TruthPiece& piece);
  const Port& port() const noexcept { return *port_; }

 private:
  void take_all(TruthPiece& piece);

  const std::unique_ptr<Port> port_;
  const std::unique_ptr<TruthDecoder> decoder_;
  TruthInput input_;
  std::string of_settings_;  // the remark on the settings, which belongs to the first record without state
  std::uint64_t times_lost_ = 0;
  HostTime time_;
  Endpoint from_;
  bool has_ended_ = false;
};

// Pieces in order, for the port of a run.
class TruthPieces {
 public:
  virtual ~TruthPieces() = default;
  // Returns the next piece, valid until the next call; nullptr at the end. May wait for a thread that decodes.
  virtual const TruthPiece* next() noexcept = 0;
  virtual bool at_end() const noexcept = 0;
  // Returns the counters of the capture's port after the last piece that was returned.
  virtual const PortCounters& counters() const noexcept = 0;
  virtual std::optional<double> progress() const noexcept = 0;
  virtual std::string_view end_warning() const noexcept = 0;
  virtual std::string_view other_content() const noexcept = 0;
};

// Returns a port whose received bytes stand for the pieces, and the format like `format` that decodes them.
std::unique_ptr<Port> port_of(std::unique_ptr<TruthPieces> pieces, std::optional<bool> keeps_datagrams);
std::unique_ptr<TruthFormat> format_of_pieces(const TruthFormat& format);

}  // namespace imud
