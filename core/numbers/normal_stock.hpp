// NormalStock: normal deviates of a stream that a second thread computes before the first one needs them.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/numbers/random.hpp"

namespace imud {

// Two blocks of batches: while the taking thread has the batches of one block, it requests the next block, which the
// filling thread computes. Neither waits for the other: where a block is not there in time, the taking thread
// computes its batches itself. The numbers are the same either way. Only the constructor allocates; nothing locks or
// throws.
class NormalStock {
 public:
  // `samples`, of a block, is above 0, and is rounded up to whole batches.
  explicit NormalStock(std::size_t samples);

  // The taking thread. Returns false, and leaves `deviates` as they are, if the batch is not there.
  bool take(const NormalBatch& batch, NormalBatch::Deviates& deviates) noexcept;
  // The filling thread: computes what is requested.
  void fill() noexcept;

 private:
  enum class State : std::uint8_t { idle, requested, filling, filled };
  struct Block {
    std::atomic<State> state = State::idle;
    NormalBatch first = {};  // written by the taking thread, unless a block is requested or being filled
    std::vector<NormalBatch::Deviates> batches;
  };
  static void request(Block& block, const NormalBatch& first) noexcept;

  std::array<Block, 2> blocks_;
};

}  // namespace imud
