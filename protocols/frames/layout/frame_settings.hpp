// FrameSettings: the settings of a description, and what messages and requests say about them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/time.hpp"
#include "protocols/frames/layout/frame_description.hpp"

namespace imud {

// Returns true if the texts are equal. `ignores_case`: the case of ASCII letters is ignored.
bool is_same_text(std::string_view a, std::string_view b, bool ignores_case) noexcept;

// A value of a setting: its index in the list, or, of a range, its distance from the lowest value.
using FrameValue = std::uint64_t;

// A setting and one of its values.
struct FrameChosen {
  std::size_t setting = 0;
  FrameValue value = 0;
};

// The values that one setting must have: either the listed ones, or, where `mask` is not 0, the numbers of a range
// that have the bits `wanted` in it.
struct FrameCondition {
  std::size_t setting = 0;
  std::vector<FrameValue> values = {};
  std::uint64_t mask = 0, wanted = 0;
  std::uint64_t lowest = 0;  // number of the range

  bool allows(FrameValue value) const noexcept;
  bool excludes(const FrameCondition& other) const noexcept;  // no value of the setting is allowed by both
  bool operator==(const FrameCondition&) const = default;
};

// Returns true if all conditions hold with these values of all settings.
bool all_hold(std::span<const FrameCondition> conditions, std::span<const FrameValue> values) noexcept;
// Returns true if no values of the settings satisfy all conditions of both lists.
bool exclude(std::span<const FrameCondition> some, std::span<const FrameCondition> others) noexcept;

// When a message is sent, as far as settings decide.
struct FrameSwitch {
  std::vector<FrameCondition> when;  // all must hold
  std::optional<std::size_t> rate;   // the setting that has the rate
  std::vector<Nanoseconds> periods;  // of its values; 0: nothing is sent
  bool is_streamed = true;           // false: only sent when a request polls it

  // Returns true if the message is streamed with these values of all settings.
  bool is_on(std::span<const FrameValue> values) const noexcept;
  // Returns true if no values of the settings let both be sent.
  bool excludes(const FrameSwitch& other) const noexcept { return exclude(when, other.when); }
  bool is_always_on() const noexcept { return is_streamed && when.empty() && !rate; }
};

// The functions that are not noexcept throw std::invalid_argument, whose message has the fault and the remedy.
class FrameSettings {
 public:
  using Setting = FrameHostDescription::Setting;

  // Refuses nothing: `faults()` has what is wrong.
  explicit FrameSettings(const FrameDescription& description);
  // Returns the faults of the settings themselves.
  std::vector<FrameFault> faults() const;

  std::size_t size() const noexcept { return all_.size(); }
  const Setting& operator[](std::size_t index) const noexcept { return all_[index]; }

  std::optional<std::size_t> find(std::string_view name, bool ignores_case = false) const noexcept;
  // Returns the value with this text. For a number, any text of the number is accepted, such as "0100" for 100.
  std::optional<FrameValue> find_value(std::size_t setting, std::string_view text,
                                       bool ignores_case = false) const noexcept;
  // find_code() returns the value with a code, and code() the code of a value. A number of a range is its own
  // code.
  std::optional<FrameValue> find_code(std::size_t setting, std::uint64_t code) const noexcept;
  std::uint64_t code(FrameChosen chosen) const noexcept;
  // Returns the value as a number; 0 if the value is a text.
  double number(FrameChosen chosen) const noexcept;
  // Returns the text of a value, which is in `room` if the setting has a range.
  using Room = std::array<char, 20>;
  std::string_view text(FrameChosen chosen, Room& room) const noexcept;
  // Returns the texts of the values that are listed, or of the delivered, the lowest and the highest one of a range.
  std::vector<std::string> examples(std::size_t setting) const;

  // Returns the index of the setting of that name, or a value of it.
  std::size_t at(const std::string& name) const;
  FrameValue value_at(std::size_t setting, const std::string& text) const;
  FrameCondition condition(const FrameHostDescription::Choice& choice) const;
  // Returns the condition of an optional element: "NAME.BIT", "!NAME.BIT" or "NAME=VALUE".
  FrameCondition condition(std::string_view text) const;
  std::vector<FrameValue> delivered() const;
  // Returns when the message is sent. Adds what is wrong with it to `faults`.
  FrameSwitch switch_of(const FrameDescription::Message& message, std::vector<FrameFault>& faults) const;
  // Refuses a setting of which a value has no code, or one of more than so many bits.
  void require_codes(std::size_t setting, unsigned bits) const;
  // Returns the periods of a setting whose values are rates in Hz; 0 for the rate 0, at which nothing is sent.
  std::vector<Nanoseconds> periods(std::size_t setting) const;
  // Refuses a setting of which a value is no bit rate.
  void require_bauds(std::size_t setting) const;

 private:
  // Calls `check` with the values of a list, or with the delivered, the lowest and the highest one of a range.
  template <class Check>
  void each_end(std::size_t setting, Check check) const;
  std::string word(FrameChosen chosen) const;

  std::vector<Setting> all_;
  std::vector<std::vector<double>> numbers_;       // of the values that are listed
  std::vector<std::vector<std::uint64_t>> codes_;  // of these; one without has `no_code`
  static constexpr std::uint64_t no_code = ~std::uint64_t{0};
};

}  // namespace imud
