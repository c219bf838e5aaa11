// Settings: the options that one protocol or truth format has beside the common options.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

namespace imud {

struct FrameDescription;  // protocols/frames/frame_description.hpp

using SettingValue = std::variant<bool, std::int64_t, double, std::string, std::vector<std::string>>;

// A setting of a table entry, of the type of `initial`. A number must be in [min, max]; if min equals max, any
// finite number is valid. A text must be one of `choices`; if `choices` is empty, any text is valid. The choices
// of a list are for display only: the table entry checks a list.
struct Setting {
  std::string_view key;
  std::string_view help;  // one line, with the unit
  std::variant<bool, std::int64_t, double, std::string_view, std::span<const std::string_view>> initial;
  double min = 0;
  double max = 0;
  std::span<const std::string_view> choices = {};
  bool names_frames = false;  // the text names a FrameDescription, which Settings::attach() gets
  // The description that Settings have from the start; nullptr: none.
  const std::shared_ptr<const FrameDescription>* frames = nullptr;
};

// Each function makes a row of an entry's table.
constexpr Setting flag_setting(std::string_view key, std::string_view help, bool initial) {
  return {key, help, initial};
}
constexpr Setting integer_setting(std::string_view key, std::string_view help, std::int64_t initial, double min,
                                  double max) {
  return {key, help, initial, min, max};
}
constexpr Setting real_setting(std::string_view key, std::string_view help, double initial, double min, double max) {
  return {key, help, initial, min, max};
}
constexpr Setting text_setting(std::string_view key, std::string_view help, std::string_view initial,
                               std::span<const std::string_view> choices = {}) {
  return {key, help, initial, 0, 0, choices};
}
// The name of a file that describes frames, or of a shipped description. The caller that sets the name also reads
// the file, because protocols read no TOML.
constexpr Setting frames_setting(std::string_view key, std::string_view help) {
  return {.key = key, .help = help, .initial = std::string_view(), .names_frames = true};
}
constexpr Setting list_setting(std::string_view key, std::string_view help,
                               std::span<const std::string_view> initial = {},
                               std::span<const std::string_view> choices = {}) {
  return {key, help, initial, 0, 0, choices};
}

// Values for declared settings; `declared` must outlive them. Reading an undeclared key or another type is a
// programming error and throws std::logic_error.
class Settings {
 public:
  explicit Settings(std::span<const Setting> declared = {});

  // Sets a declared key; an integer is accepted for a double. Throws std::invalid_argument, whose message gives the
  // valid values, for an unknown key, another type, a number out of range, or a text that is not among the choices.
  void set(std::string_view key, SettingValue value);
  // Does the same as set() with the value in a text: "true", "12", "0x7F", "1.5", "text" or "a,b,c".
  void set_text(std::string_view key, std::string_view text);

  // Sets the content of the file that the setting with Setting::names_frames names. A later set() of that key
  // removes the content.
  void attach(std::shared_ptr<const FrameDescription> frames) { frames_ = std::move(frames); }
  const std::shared_ptr<const FrameDescription>& frames() const { return frames_; }  // nullptr: none

  bool flag(std::string_view key) const;
  std::int64_t integer(std::string_view key) const;
  double real(std::string_view key) const;
  const std::string& text(std::string_view key) const;
  const std::vector<std::string>& list(std::string_view key) const;
  const SettingValue& value(std::string_view key) const;  // of any type

 private:
  template <class T>
  const T& get(std::string_view key) const;
  std::size_t find(std::string_view key) const;  // declared_.size() if there is none
  std::span<const Setting> declared_;
  std::vector<SettingValue> values_;  // as declared_
  std::shared_ptr<const FrameDescription> frames_;
};

// Makes a T, whose constructor takes the settings: a function for Protocol::make and Protocol::make_decoder.
template <class Base, class T>
std::unique_ptr<Base> make_as(const Settings& settings) {
  return std::make_unique<T>(settings);
}

}  // namespace imud
