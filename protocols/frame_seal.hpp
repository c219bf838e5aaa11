// FrameSeal: writes the checks of a product's frames again, for faults of the wire that change content.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <type_traits>

#include "core/frame.hpp"

namespace imud {

class Settings;

// No function but a constructor throws or allocates. One thread.
class FrameSeal {
 public:
  virtual ~FrameSeal() = default;

  // Writes the right checks to `frame`, a whole frame of the product, and returns its bytes that can change without a
  // change of the framing; bits of a check among them are written over. Empty if the bytes are no such frame, or if
  // it has no check; what the bytes are then is undefined. `can`: its header.
  virtual std::span<std::byte> reseal(std::span<std::byte> frame, const CanHeader& can) noexcept = 0;

  // Where a check covers a transfer of several CAN frames, reseal() takes the data of these, one after another.
  // Returns how many of `frames`, from the first one on, are a transfer, at least 1; there is a first one.
  // Default: 1.
  virtual std::size_t transfer(std::span<const Frame> frames) const noexcept;

  // Where the line adds escapes to frames, reseal() takes a frame without them. open() writes such a frame to
  // `content`, close() the frame with its escapes to `line`; both return the size, and 0 if it is no whole frame, or
  // does not fit. Default: the frame as it is.
  virtual std::size_t open(std::span<const std::byte> line, std::span<std::byte> content) noexcept;
  virtual std::size_t close(std::span<const std::byte> content, std::span<std::byte> line) noexcept;
};

// Makes the seal of a product whose checks depend on no setting, from FrameSeal::reseal() and, if not nullptr,
// FrameSeal::transfer(): for `make_seal` of an entry.
template <auto reseal_frame, auto transfer_of = nullptr>
std::unique_ptr<FrameSeal> seal_by(const Settings&) {
  struct Seal final : FrameSeal {
    std::span<std::byte> reseal(std::span<std::byte> frame, const CanHeader& can) noexcept override {
      return reseal_frame(frame, can);
    }
    std::size_t transfer(std::span<const Frame> frames) const noexcept override {
      if constexpr (std::is_null_pointer_v<decltype(transfer_of)>)
        return FrameSeal::transfer(frames);
      else
        return transfer_of(frames);
    }
  };
  return std::make_unique<Seal>();
}

}  // namespace imud
