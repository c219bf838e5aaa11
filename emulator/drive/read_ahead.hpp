// ReadAhead: decodes a capture beside the thread that samples.
#pragma once

#include <atomic>
#include <memory>
#include <thread>
#include <vector>

#include "emulator/drive/truth_pieces.hpp"
#include "emulator/engine/batch_ring.hpp"

namespace imud {

// A run from a ReadAhead equals a run from the capture.
class ReadAhead {
 public:
  // Opens the capture, a regular file, and begins to read. Throws PortError.
  explicit ReadAhead(const TruthConfig& config);
  // Ends the thread. The port of open() must no longer be used.
  ~ReadAhead();
  ReadAhead(const ReadAhead&) = delete;
  ReadAhead& operator=(const ReadAhead&) = delete;

  // Returns the format whose decoder reads the port of open(). open() must be called only once. The ReadAhead must
  // outlive the format and the port.
  const TruthFormat& format() const noexcept { return *format_; }
  std::unique_ptr<Port> open();

  // A piece, and the state of the capture's port after it.
  struct Item {
    TruthPiece piece;
    PortCounters counters;
    double progress = 0;
  };
  struct Batch {
    std::vector<Item> items;  // the first `count` are used, all keep their memory
    std::size_t count = 0;
    bool is_last = false;
  };
  using Ring = BatchRing<Batch, 4>;

 private:
  void run() noexcept;
  void fill(Batch& batch);

  TruthPieceReader reader_;
  const std::unique_ptr<TruthFormat> format_;
  Ring ring_;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

}  // namespace imud
