// FrameSeal: recomputes the checks in a product's frames after a simulated wire fault has changed the content.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <type_traits>

#include "core/frame.hpp"

namespace imud {

class Settings;

// Only a constructor throws or allocates. One thread.
class FrameSeal {
 public:
  virtual ~FrameSeal() = default;

  // Writes the right checks to `frame`, a whole frame of the product. Returns the bytes of the frame that can
  // change without a change of the framing; reseal() overwrites the bits of a check among these bytes. Returns an
  // empty span if `frame` is no frame of the product, or has no check; the content of `frame` is then undefined.
  // `can`: the header of the frame.
  virtual std::span<std::byte> reseal(std::span<std::byte> frame, const CanHeader& can) noexcept = 0;

  // Where a check covers a transfer of several CAN frames, reseal() takes the data of all frames of the transfer,
  // one after another. Returns how many of `frames`, from the first frame on, form the transfer; at least 1.
  // Requires at least one frame. Default: 1.
  virtual std::size_t transfer(std::span<const Frame> frames) const noexcept;

  // Where the line adds escapes to frames, reseal() takes a frame without them. open() writes the frame without
  // escapes to `content`; close() writes the frame with escapes to `line`. Both return the size written, or 0 if
  // the input is no whole frame, or the output does not fit. Default: both copy the frame unchanged.
  virtual std::size_t open(std::span<const std::byte> line, std::span<std::byte> content) noexcept;
  virtual std::size_t close(std::span<const std::byte> content, std::span<std::byte> line) noexcept;
};

// Makes the seal of a product whose checks depend on no setting: a function for Protocol::make_seal.
// `reseal_frame` implements FrameSeal::reseal(); `transfer_of`, unless nullptr, implements FrameSeal::transfer().
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
