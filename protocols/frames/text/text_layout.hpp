// TextLayout: a line of text, compiled into a list of its pieces. Encoder and decoder use the same list.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "protocols/frames/layout/frame_description.hpp"
#include "protocols/frames/layout/frame_test_values.hpp"
#include "protocols/frames/layout/message_layout.hpp"
#include "protocols/frames/text/text_piece.hpp"

namespace imud {

class TextLayout final : public MessageLayout {
 public:
  static constexpr std::size_t most_pieces = 128;

  // Compiles message.text. Throws FrameFaults with every fault of the message.
  TextLayout(const FrameDescription& description, const FrameDescription::Message& message);

  std::size_t longest() const noexcept override { return longest_; }
  std::size_t carries() const noexcept override { return 0; }
  Encoded encode(const Reading& reading, const State& state, std::span<double> carried,
                 std::span<std::byte> frame) const noexcept override;
  Found match(std::span<const std::byte> held) const noexcept override;
  bool has_check() const noexcept override;
  bool reseal(std::span<std::byte> frame) const noexcept override;
  std::int64_t time_lsb_ns() const noexcept override { return time_lsb_ns_; }
  Decoded wrapping() const noexcept override;
  std::optional<Decoded> decode(std::span<const std::byte> frame, ReadBack& read) const noexcept override;
  // The value of a choice of two texts is 1 for the first and 0 for the second text. If an angle without sign has the
  // same name, the choice is the sign of this angle instead.
  void read_fields(std::span<const std::byte> frame, std::span<FieldValue> values) const noexcept override;

 private:
  // The offsets at which the pieces of a frame begin; the last element is the end of the frame.
  using Places = std::array<std::uint16_t, most_pieces + 1>;
  class Compiler;

  Encoded write(const Reading& reading, const State& state, const FrameTestValues* given, Places& places,
                std::span<std::byte> frame) const noexcept;
  std::size_t write_field(const TextPiece& piece, const Reading& reading, const State& state,
                          const FrameTestValues* given, char* out, unsigned& saturated) const noexcept;
  std::size_t write_check(const TextPiece& piece, std::span<const std::byte> frame, const Places& places,
                          char* out) const noexcept;
  // Returns the next piece that is no label; nullptr if there is none.
  const TextPiece* next(std::size_t index) const noexcept;
  // Returns true if a field always ends where `next` begins: no text of the field has the first character of `next`.
  static bool is_closed_by(const TextPiece& field, const TextPiece& next) noexcept {
    return next.kind == TextPiece::Kind::literal && !field.format.may_have(next.text.front());
  }
  Match find(std::string_view held, Places& places) const noexcept;
  std::size_t field_end(std::size_t index, std::string_view held, std::size_t begin) const noexcept;
  bool read_field(std::size_t index, std::string_view text, ReadBack& read, Decoded& decoded) const noexcept;

  static FieldValue field_value(const TextPiece& piece, std::string_view text) noexcept;

  // For a name in fields(): the piece with the number, and the piece with its sign.
  struct Named {
    std::size_t number = 0;
    std::optional<std::size_t> sign = {};
  };

  std::vector<TextPiece> pieces_;
  std::vector<Named> named_;
  std::size_t longest_ = 0;
  std::int64_t time_lsb_ns_ = 1;
};

}  // namespace imud
