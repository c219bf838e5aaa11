#include "core/numbers/normal_stock.hpp"

namespace imud {

NormalStock::NormalStock(std::size_t samples) {
  for (Block& block : blocks_) block.batches.resize((samples + NormalBatch::samples - 1) / NormalBatch::samples);
}

bool NormalStock::take(const NormalBatch& batch, NormalBatch::Deviates& deviates) noexcept {
  const std::uint64_t size = blocks_[0].batches.size(), number = batch.number / size, index = batch.number % size;
  NormalBatch first = batch;
  first.number -= index;
  Block& block = blocks_[number % 2];
  if (index == 0) {
    NormalBatch next = first;
    next.number += size;
    request(blocks_[(number + 1) % 2], next);
  }
  if (block.state.load(std::memory_order_acquire) != State::filled || block.first != first) return false;
  deviates = block.batches[index];
  return true;
}

// A block that is still being filled keeps its request.
void NormalStock::request(Block& block, const NormalBatch& first) noexcept {
  State state = block.state.load(std::memory_order_acquire);
  if (state == State::requested) block.state.compare_exchange_strong(state, State::idle, std::memory_order_acquire);
  if (state == State::filling) return;
  block.first = first;
  block.state.store(State::requested, std::memory_order_release);
}

void NormalStock::fill() noexcept {
  for (Block& block : blocks_) {
    State state = State::requested;
    if (!block.state.compare_exchange_strong(state, State::filling, std::memory_order_acquire)) continue;
    NormalBatch batch = block.first;
    for (NormalBatch::Deviates& deviates : block.batches) {
      batch.compute(deviates);
      ++batch.number;
    }
    block.state.store(State::filled, std::memory_order_release);
  }
}

}  // namespace imud
