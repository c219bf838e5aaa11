// FrameSettings: the settings of a description, and the conditions of messages and requests on them.
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

// A value of a setting: its index in the list of values; in a range, its distance from the lowest value.
using FrameValue = std::uint64_t;

// A setting and one of its values.
struct FrameChosen {
  std::size_t setting = 0;
  FrameValue value = 0;
};

// A condition: a setting has one of the listed values or, if `mask` is not 0, a number of a range whose bits in
// `mask` are `wanted`.
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
// Returns true if no values of the settings can satisfy all conditions of both lists.
bool exclude(std::span<const FrameCondition> some, std::span<const FrameCondition> others) noexcept;

// The settings that switch a message, and its rates.
struct FrameSwitch {
  static constexpr Nanoseconds each_sample{-1};  // the period of the rate inf

  std::vector<FrameCondition> when;  // all must hold
  std::optional<std::size_t> rate;   // the setting that has the rate
  std::vector<Nanoseconds> periods;  // for each value of that setting; 0: nothing is sent; or each_sample
  bool is_streamed = true;           // false: only sent when a request polls it

  // Returns true if the message is streamed with these values of all settings.
  bool is_on(std::span<const FrameValue> values) const noexcept;
  // Returns true if no values of the settings let both messages be sent.
  bool excludes(const FrameSwitch& other) const noexcept { return exclude(when, other.when); }
  bool is_always_on() const noexcept { return is_streamed && when.empty() && !rate; }
};

// The functions that are not noexcept throw std::invalid_argument with the fault and the remedy.
class FrameSettings {
 public:
  using Setting = FrameHostDescription::Setting;

  // Does not throw if a setting is wrong: see faults().
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
  // Returns the text of a value. If the setting has a range, the text is in `room`.
  using Room = std::array<char, 20>;
  std::string_view text(FrameChosen chosen, Room& room) const noexcept;
  // Returns the texts of the listed values; of a range, the texts of the delivered, the lowest and the highest value.
  std::vector<std::string> examples(std::size_t setting) const;

  // Return the index of the setting with this name, and the value with this text.
  std::size_t at(const std::string& name) const;
  FrameValue value_at(std::size_t setting, const std::string& text) const;
  FrameCondition condition(const FrameHostDescription::Choice& choice) const;
  // Returns the condition of an optional element: "NAME.BIT", "!NAME.BIT" or "NAME=VALUE".
  FrameCondition condition(std::string_view text) const;
  std::vector<FrameValue> delivered() const;
  // Returns the switch of a message. Adds the faults of its settings to `faults`.
  FrameSwitch switch_of(const FrameDescription::Message& message, std::vector<FrameFault>& faults) const;
  // Throws if a value of the setting has no code, or a code of more than `bits` bits.
  void require_codes(std::size_t setting, unsigned bits) const;
  // Returns FrameSwitch::periods of a setting whose values are rates in Hz.
  std::vector<Nanoseconds> periods(std::size_t setting) const;
  // Throws if a value of the setting is no bit rate.
  void require_bauds(std::size_t setting) const;

 private:
  // Calls `check` with each listed value; for a range, with the delivered, the lowest and the highest value.
  template <class Check>
  void each_end(std::size_t setting, Check check) const;
  std::string word(FrameChosen chosen) const;

  std::vector<Setting> all_;
  std::vector<std::vector<double>> numbers_;       // of the listed values
  std::vector<std::vector<std::uint64_t>> codes_;  // of the listed values; a value without a code has `no_code`
  static constexpr std::uint64_t no_code = ~std::uint64_t{0};
};

}  // namespace imud
