// FrameCaptures: the parts of a request that were captured. The two forms of requests: lines of text (FrameLine), and
// bytes (FrameBytes). Answers may be FrameBytes, too.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/frames/layout/frame_layout.hpp"
#include "protocols/frames/layout/frame_settings.hpp"

namespace imud {

// The captures of a request that was received. The views are of the received bytes.
struct FrameCaptures {
  static constexpr std::size_t most = FrameHostDescription::most_settings;

  std::span<const std::byte> bytes;        // of a binary request
  std::string_view line;                   // of a line, without its end
  std::string_view any;                    // by {any}
  std::optional<std::size_t> setting;      // by {setting}
  std::string_view value;                  // the text by {value} or {NAME}, which may be no value of the setting
  std::array<FrameChosen, most> chosen{};  // settings with their values, each once
  std::size_t count = 0;                   // of `chosen`
  bool is_allowed = true;                  // false: a captured value is no value of its setting

  // Adds a value of the setting with this index, in place of an earlier value. `chosen_value`: nullopt: the captured
  // value is no value of the setting.
  void add(std::size_t index, std::optional<FrameValue> chosen_value) noexcept;
};

// A pattern of a line: text with {setting}, {value}, {NAME} of a setting, or {any}. A capture ends at the next
// character of the pattern. Therefore the time of a comparison is linear.
class FrameLine {
 public:
  // Throws std::invalid_argument.
  FrameLine(std::string_view pattern, bool ignores_case, const FrameSettings& settings);

  // Compares a line with the pattern. Requires a line without its line end. Sets `captures` if the result is true.
  bool match(std::string_view line, const FrameSettings& settings, FrameCaptures& captures) const noexcept {
    return match(line, ignores_case_, settings, captures);
  }
  bool match(std::string_view line, bool ignores_case, const FrameSettings& settings,
             FrameCaptures& captures) const noexcept;
  bool ignores_case() const noexcept { return ignores_case_; }
  bool captures_setting() const noexcept { return captures_setting_; }
  bool captures_values() const noexcept { return captures_values_; }
  // Returns true if a captured value may be a number of a range.
  bool captures_ranges() const noexcept { return captures_ranges_; }
  bool has_any() const noexcept { return has_any_; }

  // Returns lines that match, at most 1024: with each listed value, and with the ends of ranges; {any} is "1".
  std::vector<std::string> lines(const FrameSettings& settings) const;
  // Returns for each setting the beginning of the lines that match, up to the first {any}, {value} or {NAME}.
  std::vector<std::string> beginnings(const FrameSettings& settings) const;

 private:
  enum class Kind : std::uint8_t { text, setting, value, named, any };
  struct Part {
    Kind kind = Kind::text;
    std::string text;
    std::size_t setting = 0;  // of `named`
    char end = '\0';          // the character after a capture; '\0': the end of the line
  };
  std::vector<Part> parts_;
  bool ignores_case_;
  bool captures_setting_ = false, captures_values_ = false, captures_ranges_ = false, has_any_ = false;
};

// Bytes by a list of elements, which may have captures. A request may have `{NAME}:u16`, `bits:u8:0={NAME}` and `??`.
// If the request has a length, it may also have `_:*` for any bytes, and `{items}` for items. An answer may have
// `{NAME}:u16`, `bits:u8:0={NAME}`, and bytes of the request, `{3}` or `{3-6}`.
class FrameBytes {
 public:
  enum class Role : std::uint8_t { request, item, answer };
  using Items = std::vector<std::vector<FrameHostDescription::Text>>;
  // `place`: text before the elements in faults. `request_size`: how many bytes of the request an answer may repeat.
  // `items` are the items of a request. Throws FrameFaults with every fault.
  FrameBytes(const FrameDescription& description, std::span<const FrameHostDescription::Text> elements,
             const std::string& place, Role role, std::size_t request_size, const FrameSettings& settings,
             const Items& items = {});

  std::size_t size() const noexcept { return layout_->size(); }    // bytes of an answer
  std::size_t fixed() const noexcept { return layout_->fixed(); }  // bytes at the begin of a request, at fixed places
  bool captures_values() const noexcept { return captures_values_; }
  bool has_quantities() const noexcept { return has_quantities_; }
  const FrameLayout& layout() const noexcept { return *layout_; }

  // Compares the beginning of `held` with the pattern. Requires a `held` that is not empty. Sets `captures` if the
  // result is `yes`.
  FrameLayout::Match match(std::span<const std::byte> held, const FrameSettings& settings,
                           FrameCaptures& captures) const noexcept;
  // Returns a request that matches, with these values of the settings. Bytes that may have any value are 0.
  std::vector<std::byte> example(std::span<const FrameValue> values, const FrameSettings& settings) const;
  // Returns true if the same bytes may begin with a request of this form and with a request of the other form.
  bool overlaps(const FrameBytes& other) const noexcept { return layout_->may_coincide(*other.layout_); }

  // Writes the answer to `out`, which must have size() bytes. `values` are the values of all settings.
  void write(const Reading& newest, std::span<const std::byte> request, std::span<const FrameValue> values,
             const FrameSettings& settings, std::span<std::byte> out) const noexcept;

 private:
  struct Capture {
    std::size_t offset = 0;
    FrameNumber number;
    unsigned low = 0, width = 8;         // bits of the number
    std::optional<std::size_t> setting;  // nullopt: repeats `number.bytes` bytes of the request from `first` on
    std::size_t first = 0;
  };
  class Parser;
  void capture(std::span<const std::byte> bytes, const FrameSettings& settings,
               FrameCaptures& captures) const noexcept;
  bool capture_items(std::span<const std::byte> bytes, const FrameSettings& settings,
                     FrameCaptures& captures) const noexcept;
  void fill(std::span<const FrameValue> values, const FrameSettings& settings,
            std::span<std::byte> out) const noexcept;

  std::optional<FrameLayout> layout_;
  std::vector<Capture> captures_;
  std::vector<FrameBytes> items_;
  bool captures_values_ = false, has_quantities_ = false;
};

}  // namespace imud
