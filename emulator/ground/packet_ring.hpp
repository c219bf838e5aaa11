// PacketRing: a bounded queue of packets from the sampling thread to the thread that writes them.
#pragma once

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "core/frame.hpp"
#include "core/time.hpp"
#include "transports/capture/pcapng_writer.hpp"
#include "transports/endpoint.hpp"

namespace imud {

// A ring of bytes that the constructor allocates. One thread pushes, one other pops; neither waits nor locks.
class PacketRing {
 public:
  struct Head {
    std::uint32_t size = 0;  // of the bytes that follow
    std::uint16_t interface = 0;
    PacketDirection direction = PacketDirection::unknown;
    CanHeader can = {};
    HostTime time;
    Endpoint peer = {};  // its port is 0 where there is none
  };

  // `capacity`: bytes; rounded up to a power of two.
  explicit PacketRing(std::size_t capacity) : bytes_(std::bit_ceil(capacity)) {}

  // Returns whether a packet of `size` bytes fits. Pushing thread.
  bool has_room(std::size_t size) const noexcept {
    const std::size_t used = tail_.load(std::memory_order_relaxed) - head_.load(std::memory_order_acquire);
    return size + sizeof(Head) <= bytes_.size() - used;
  }
  // Adds a packet, or returns false if it does not fit. Pushing thread.
  bool push(Head head, std::span<const std::byte> bytes) noexcept {
    if (!has_room(bytes.size())) return false;
    head.size = static_cast<std::uint32_t>(bytes.size());
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    copy_in(tail, std::as_bytes(std::span(&head, 1)));
    copy_in(tail + sizeof head, bytes);
    tail_.store(tail + sizeof head + bytes.size(), std::memory_order_release);
    return true;
  }

  // Takes the oldest packet, or returns false if there is none. Popping thread.
  bool pop(Head& head, std::vector<std::byte>& bytes) {
    const std::size_t at = head_.load(std::memory_order_relaxed);
    if (at == tail_.load(std::memory_order_acquire)) return false;
    copy_out(at, std::as_writable_bytes(std::span(&head, 1)));
    bytes.resize(head.size);
    copy_out(at + sizeof head, bytes);
    head_.store(at + sizeof head + head.size, std::memory_order_release);
    return true;
  }

 private:
  void copy_in(std::size_t at, std::span<const std::byte> bytes) noexcept {
    const std::size_t begin = at & (bytes_.size() - 1), first = std::min(bytes.size(), bytes_.size() - begin);
    if (first > 0) std::memcpy(bytes_.data() + begin, bytes.data(), first);
    if (first < bytes.size()) std::memcpy(bytes_.data(), bytes.data() + first, bytes.size() - first);
  }
  void copy_out(std::size_t at, std::span<std::byte> bytes) const noexcept {
    const std::size_t begin = at & (bytes_.size() - 1), first = std::min(bytes.size(), bytes_.size() - begin);
    if (first > 0) std::memcpy(bytes.data(), bytes_.data() + begin, first);
    if (first < bytes.size()) std::memcpy(bytes.data() + first, bytes_.data(), bytes.size() - first);
  }

  std::vector<std::byte> bytes_;
  alignas(64) std::atomic<std::size_t> head_ = 0;  // total bytes popped
  alignas(64) std::atomic<std::size_t> tail_ = 0;  // total bytes pushed
};

}  // namespace imud
