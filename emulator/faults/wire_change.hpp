// WireChange: the change that a fault of the wire makes to the bytes of frames.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/frame.hpp"
#include "core/uart.hpp"
#include "emulator/faults/fault_numbers.hpp"
#include "emulator/faults/wire_faults.hpp"
#include "emulator/plan/fault.hpp"
#include "protocols/frame_seal.hpp"
#include "transports/uart/uart_wire.hpp"

namespace imud {

// A frame while it is changed. Bytes that do not fit are lost.
class ChangingFrame {
 public:
  std::span<std::byte> bytes() noexcept { return {bytes_.data(), size_}; }
  std::span<std::byte> room() noexcept { return bytes_; }
  void resize(std::size_t size) noexcept { size_ = size < bytes_.size() ? size : bytes_.size(); }
  void assign(std::span<const std::byte> bytes) noexcept;
  void push(std::byte byte) noexcept {
    if (size_ < bytes_.size()) bytes_[size_++] = byte;
  }

 private:
  std::array<std::byte, FrameBuffer::max_bytes> bytes_;
  std::size_t size_ = 0;
};

// One occurrence of a fault. Its changes depend on the bytes since its begin, not on their division into frames,
// except for the kinds that concern whole frames. No allocation.
class WireChange {
 public:
  WireChange() = default;
  // Begins the occurrence.
  WireChange(const ActiveFault& fault, const FaultNumbers& numbers) noexcept;
  // Takes the fault's values for a sample. Must be called once per sample.
  void update(const ActiveFault& fault) noexcept;

  const ActiveFault& fault() const noexcept { return fault_; }
  WireFault kind() const noexcept { return kind_; }
  FaultNumbers& numbers() noexcept { return numbers_; }

  // Changes `frame`, or the frames of a transfer (FrameSeal::transfer()), with the header `can`. `other` is room
  // to work in; the changed frame is the one that is returned. `seal` writes the checks of frames; nullptr: the
  // frames have none. `is_last`: the line is idle afterwards.
  ChangingFrame& change(ChangingFrame& frame, ChangingFrame& other, FrameSeal* seal, const CanHeader& can,
                        const UartSettings& uart, bool is_last) noexcept;
  // Writes the bytes of the host that the device receives to `received`. Returns their number.
  std::size_t receive(std::span<const std::byte> sent, const UartSettings& uart,
                      std::span<std::byte> received) noexcept;

  // Returns how many events at a rate of `per_s` a second are due in a sample of `period_s`.
  std::size_t due(double per_s, double period_s) noexcept;
  double owed = 0;  // the rest of due(), or another value that the kind keeps between samples

 private:
  void change_bits(std::span<std::byte> bytes) noexcept;
  void lose_bytes(ChangingFrame& frame) noexcept;
  ChangingFrame& insert_bytes(ChangingFrame& frame, ChangingFrame& other) noexcept;
  void cut(ChangingFrame& frame) noexcept;
  ChangingFrame& reseal(ChangingFrame& frame, ChangingFrame& other, FrameSeal* seal, const CanHeader& can) noexcept;
  ChangingFrame& resample(ChangingFrame& frame, ChangingFrame& other, UartSettings uart, bool is_last) noexcept;
  void draw_run() noexcept;

  ActiveFault fault_;
  WireFault kind_ = WireFault::silence;
  FaultNumbers numbers_;
  // The random kinds of bits and bytes: the probability that `left_` was drawn with, and the bits or bytes up to the
  // next change, which is included.
  double probability_ = 0;
  std::uint64_t left_ = 0;
  bool is_wrong_ = false;  // bit_errors: the present run is one of wrong bits
  UartWire to_host_, from_host_;
};

}  // namespace imud
