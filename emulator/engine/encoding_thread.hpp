// EncodingThread: makes the frames of samples and sends them, beside the thread that samples.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <span>
#include <thread>
#include <vector>

#include "core/numbers/normal_stock.hpp"
#include "core/sample.hpp"
#include "emulator/engine/batch_ring.hpp"
#include "emulator/imu/channel.hpp"

namespace imud {

// For imus whose ports only send, where the host's clock does not pace: nothing that leaves acts on a later sample,
// so that the next samples can be taken meanwhile. While samples are on their way, this thread alone uses the devices
// and the ports. The frames are the same as without it. The constructor allocates; nothing else here does, after a
// run's first samples.
class EncodingThread {
 public:
  // `channels`: how many imus there are. `stop` ends the waits for readers. `numbers` are filled while no sample
  // waits to be sent.
  EncodingThread(std::size_t channels, const std::atomic<bool>& stop, std::deque<NormalStock>& numbers);
  // Sends the samples that were put, and ends the thread.
  ~EncodingThread();
  EncodingThread(const EncodingThread&) = delete;
  EncodingThread& operator=(const EncodingThread&) = delete;

  // The number of samples that are passed on together.
  static constexpr std::size_t batch_size = 1024;
  // Returns true if the frames of all these imus may be made here.
  static bool serves(std::span<const std::unique_ptr<Channel>> channels) noexcept;

  // The sampling thread: passes on the prepared samples of an instant. Waits while samples are many batches ahead.
  void put(std::span<Channel* const> prepared) noexcept;
  // Waits until all frames of the samples that were put have been sent.
  void finish() noexcept;

 private:
  // Four cache lines. A replay waits for the lines that go from one processor to the other; a whole sample would have
  // nine.
  struct alignas(64) Item {
    Channel* channel = nullptr;
    Channel::Outgoing outgoing;
    static constexpr std::uint32_t none = ~0U;
    std::uint32_t whole = none;  // the number of its sample in Batch::samples; none: `motion` has all of the sample
    bool is_last = false;        // of its instant
    SampleOfMotion motion;
  };
  static_assert(sizeof(Item) == 256);
  // Whole instants. Items and samples are used again, and written in their places.
  struct Batch {
    std::vector<Item> items;
    std::size_t count = 0;  // of the items that are filled, the first ones; 0: the end
    std::vector<Sample> samples;
    std::uint32_t sample_count = 0;
  };

  void run() noexcept;
  void send(std::span<Item> instant, std::span<Sample> samples) noexcept;
  void publish() noexcept;

  static constexpr std::size_t batches = 3;
  const std::atomic<bool>& stop_;
  std::deque<NormalStock>& numbers_;
  BatchRing<Batch, batches> ring_;
  Batch* filling_ = nullptr;
  std::vector<Sample> motions_;  // of an instant, whose items have no sample in Batch::samples
  std::thread thread_;
};

}  // namespace imud
