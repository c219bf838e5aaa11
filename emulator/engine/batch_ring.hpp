// BatchRing: batches that one thread fills and another thread takes, in order.
#pragma once

#include <semaphore.h>

#include <array>
#include <cstddef>

namespace imud {

// `Batch` is default-constructible, and keeps its memory from one use to the next. A waiting thread
// sleeps until the other thread has gone on.
template <class Batch, std::size_t size>
class BatchRing {
 public:
  BatchRing() noexcept {
    ::sem_init(&free_, 0, size);
    ::sem_init(&filled_, 0, 0);
  }
  ~BatchRing() {
    ::sem_destroy(&free_);
    ::sem_destroy(&filled_);
  }
  BatchRing(const BatchRing&) = delete;
  BatchRing& operator=(const BatchRing&) = delete;

  std::array<Batch, size>& batches() noexcept { return batches_; }

  // For the filling thread: next_free() waits for a batch that is not in use, and publish() passes on this batch.
  Batch& next_free() noexcept {
    wait(free_);
    return batches_[filling_];
  }
  void publish() noexcept {
    filling_ = (filling_ + 1) % size;
    ::sem_post(&filled_);
  }
  // Waits until all published batches are returned. The filling thread must not hold a batch.
  void wait_until_returned() noexcept {
    for (std::size_t i = 0; i < size; ++i) wait(free_);
    for (std::size_t i = 0; i < size; ++i) ::sem_post(&free_);
  }

  // For the taking thread: has_filled() returns whether a published batch waits. next_filled() waits for the oldest
  // published batch, and give_back() returns this batch.
  bool has_filled() noexcept {
    int count = 0;
    ::sem_getvalue(&filled_, &count);
    return count > 0;
  }
  Batch& next_filled() noexcept {
    wait(filled_);
    return batches_[taking_];
  }
  void give_back() noexcept {
    taking_ = (taking_ + 1) % size;
    ::sem_post(&free_);
  }

 private:
  static void wait(sem_t& semaphore) noexcept {
    while (::sem_wait(&semaphore) != 0) continue;  // a signal has interrupted it
  }

  std::array<Batch, size> batches_{};
  alignas(64) sem_t free_;
  std::size_t filling_ = 0;
  alignas(64) sem_t filled_;
  std::size_t taking_ = 0;
};

}  // namespace imud
